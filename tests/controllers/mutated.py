"""Model files that somebody changed in one place, with the digest as it was, without one, or made anew."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from selector.controllers.model_file import ModelFile, _digest, model_text, parsed_model
from selector.controllers.self_check import model_findings
from selector.errors import ModelFileError

Document = dict[str, Any]
FACTORS = (-1.0, 0.5, 1.5, 3.0)


def _pick(rng: np.random.Generator, of: list[Any]) -> Any:
    return of[int(rng.integers(len(of)))]


def _scaled(of: Document, factor: float) -> None:
    for output in of["outputs"]:
        for term in output["terms"]:
            term["coefficient"] *= factor


def fallback_coefficients(rng: np.random.Generator, d: Document) -> None:
    _scaled(_pick(rng, d["fallbacks"]), _pick(rng, list(FACTORS)))


def fallback_intercept(rng: np.random.Generator, d: Document) -> None:
    _pick(rng, _pick(rng, d["fallbacks"])["outputs"])["intercept"] += float(rng.normal(0.0, 5.0))


def fallback_of_another_sensor(rng: np.random.Generator, d: Document) -> None:
    first, second = d["fallbacks"][:2]
    first["without"], second["without"] = second["without"], first["without"]


def coefficient(rng: np.random.Generator, d: Document) -> None:
    _pick(rng, _pick(rng, d["outputs"])["terms"])["coefficient"] *= _pick(rng, list(FACTORS))


def scaling(rng: np.random.Generator, d: Document) -> None:
    _pick(rng, [*d["inputs"], *d["states"]])[_pick(rng, ["centre", "scale"])] += float(rng.uniform(0.1, 2.0))


def memory(rng: np.random.Generator, d: Document) -> None:
    _pick(rng, d["states"])["tau_s"] *= _pick(rng, [0.1, 0.5, 2.0, 60.0])


def range_seen(rng: np.random.Generator, d: Document) -> None:
    item = _pick(rng, d["inputs"])
    width = item["valid_max"] - item["valid_min"]
    end, sign = _pick(rng, [("valid_min", -1.0), ("valid_max", 1.0)])
    item[end] += sign * width * _pick(rng, [-0.3, 0.3, 2.0])


def limits_of_readings(rng: np.random.Generator, d: Document) -> None:
    item = _pick(rng, [one for one in d["inputs"] if one["reading_max"] is not None])
    item[_pick(rng, ["reading_min", "reading_max"])] = _pick(rng, [None, 0.0, 20.0, 60.0])


def rate(rng: np.random.Generator, d: Document) -> None:
    item = _pick(rng, [one for one in d["inputs"] if one["rate_limit_per_min"] is not None])
    item["rate_limit_per_min"] = _pick(rng, [None, 0.01, 0.5, 100.0])


def clamp_or_slew(rng: np.random.Generator, d: Document) -> None:
    limits = _pick(rng, d["guard"]["limits"])
    name = _pick(rng, [name for name in ("clamp_um", "slew_um_per_s") if limits[name]])
    limits[name] *= _pick(rng, [0.1, 0.5, 2.0, 10.0])


def guard(rng: np.random.Generator, d: Document) -> None:
    changes = {
        "break_codes": [], "recover_after_s": 0.0, "hold_at_most_s": 3000.0, "stuck_after_s": None,
        "restart": "new-start", "new_start_after_s": 86_400.0, "on_fault": "hold", "outside_valid_range": "fault",
    }  # fmt: skip
    name = _pick(rng, list(changes))
    d["guard"][name] = changes[name]


def sign(rng: np.random.Generator, d: Document) -> None:
    k = int(rng.integers(len(d["outputs"])))
    for of in (d, *d["fallbacks"]):
        of["outputs"][k]["sign"] = "correction = displacement"


def unit(rng: np.random.Generator, d: Document) -> None:
    _pick(rng, d["inputs"])["unit"] = _pick(rng, ["K", "degF", "m", "um"])


def vector(rng: np.random.Generator, d: Document) -> None:
    series = _pick(rng, list(_pick(rng, d["test_vectors"])["expected"].values()))
    series[int(rng.integers(len(series)))] += float(rng.normal(0.0, 1.0))


def guard_vector(rng: np.random.Generator, d: Document) -> None:
    found = _pick(rng, d["guard_vectors"])
    series = _pick(rng, [*found["expected"].values(), *found["readings"].values()])
    series[int(rng.integers(len(series)))] += float(rng.choice([-30.0, 30.0]))


def digest(rng: np.random.Generator, d: Document) -> None:
    d["digest"] = d["digest"][:5] + ("0" if d["digest"][5] != "0" else "1") + d["digest"][6:]


KINDS: tuple[Callable[[np.random.Generator, Document], None], ...] = (
    fallback_coefficients, fallback_intercept, fallback_of_another_sensor, coefficient, scaling, memory, range_seen,
    limits_of_readings, rate, clamp_or_slew, guard, sign, unit, vector, guard_vector, digest,
)  # fmt: skip


def mutated(model: ModelFile, seed: int) -> tuple[str, Document]:
    """The name of what was changed in a sealed file, and the changed document; never the same as before."""
    rng, before = np.random.default_rng(seed), json.loads(model_text(model))
    kind = KINDS[seed % len(KINDS)]
    while True:
        document = json.loads(model_text(model))
        kind(rng, document)
        if document != before:
            return kind.__name__, document


def outcome(document: Document) -> str:
    """What a reader of the file is told: refused, told (a finding beside the plain ones) or silent."""
    try:
        findings = model_findings(parsed_model(json.dumps(document)))
    except ModelFileError:
        return "refused"
    if any(finding.level == "error" for finding in findings):
        return "refused"
    return "told" if any(finding.id != "test-vectors-agree" for finding in findings) else "silent"


def without_digest(document: Document) -> Document:
    return {key: value for key, value in document.items() if key != "digest"}


def forged(document: Document) -> Document:
    """With a digest that fits, as nobody makes it by accident."""
    return document | {"digest": _digest(document)}
