"""Does a model file keep its word? Vectors of model, fallbacks and guard made and recomputed, settings sensible."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from selector.controllers.closed_values import CheckVector, GuardVector
from selector.controllers.evaluator import Equations, evaluate, output_bound_um
from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.decided import decided_limits
from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.guard.vectors import MINUTE_S, START_DEGC, guard_vectors, recomputed
from selector.controllers.model_file import Fallback, Input, ModelFile, read_model, with_digest
from selector.errors import ModelFileError
from selector.findings import Finding, Level, Where
from selector.text_file import shell_word
from selector.types import Array

DAY_S = 86_400.0
COLDEST_DEGC, HOTTEST_DEGC = -30.0, 120.0  #: What a working machine can have anywhere.


def _not_proved(model: ModelFile) -> Iterator[Finding]:
    for name, proof in model.validation.items():
        error, without = proof.heldout_rmse_um, proof.heldout_baseline_um
        if error is not None and without is not None and error >= without:
            yield FINDINGS.finding(
                "proof-against-it",
                f"On data that it had not seen the model of {name} left {error:.3g} µm, no model or a constant "
                f"{without:.3g} µm.",
                Where(channel=name),
                {"heldout_rmse_um": error, "without_um": without},
            )


def _break_codes(model: ModelFile) -> Iterator[Finding]:
    for item in model.inputs:
        low, high = _plausible_degc(item)
        for code in model.guard.break_codes:
            if item.unit == "degC" and low <= code <= high:
                yield FINDINGS.finding(
                    "break-code-in-valid-range",
                    f"{item.name}: {code:g} °C counts as a broken sensor, but is a temperature that it can have "
                    f"({low:g} … {high:g} °C).",
                    evidence={"input": item.name, "break_code": code, "from_degc": low, "to_degc": high},
                )


def _plausible_degc(item: Input) -> tuple[float, float]:
    """Readings that are no fault otherwise."""
    low, high = max(COLDEST_DEGC, item.reading_limits[0]), min(HOTTEST_DEGC, item.reading_limits[1])
    if item.reference == "absolute":
        low, high = min(low, item.valid_min), max(high, item.valid_max)
    return low, high


def _never_met(model: ModelFile) -> Iterator[Finding]:
    """Limits that no reading of a working sensor can meet: it would never be believed."""
    for item in model.inputs:
        low, high = item.reading_limits
        width = item.valid_max - item.valid_min
        least, most = (item.valid_min, item.valid_max) if item.reference == "absolute" else (-math.inf, math.inf)
        if item.unit == "degC":
            least, most = max(least, COLDEST_DEGC), min(most, HOTTEST_DEGC)
        if low >= high or low > most or high < least or (item.reference == "rise" and high - low < 0.5 * width):
            said = f"{low:g} … {high:g} {item.unit.replace('degC', '°C')}"
            yield _unmet(
                f"{item.name}: readings count as good within {said} only, where it cannot be and do what the model has "
                "seen: it is never believed.",
                {"input": item.name, "reading_min": item.reading_min, "reading_max": item.reading_max},
                "error",
            )
        rate = item.rate_limit_per_min
        if rate is not None and width / rate > DAY_S / MINUTE_S:
            yield _unmet(
                f"{item.name}: at the {rate:g} a minute that are believed its valid range takes "
                f"{width / rate / 1440.0:.3g} days; a machine that warms up looks like a jump.",
                {"input": item.name, "rate_limit_per_min": rate},
            )
    good_s, still_s = model.guard.recover_after_s, model.guard.stuck_after_s
    if good_s > DAY_S:
        said = f"Nothing is corrected until readings were good for {good_s / DAY_S:.3g} days (recover_after_s)."
        yield _unmet(said, {"recover_after_s": good_s})
    if still_s is not None and still_s < MINUTE_S:
        said = f"A sensor that reads the same for {still_s:g} s counts as broken (stuck_after_s); at rest each does."
        yield _unmet(said, {"stuck_after_s": still_s})


def _unmet(said: str, evidence: Mapping[str, Any], level: Level = "warning") -> Finding:
    return FINDINGS.finding("limits-never-met", said, evidence=evidence, level=level)


def _too_slow(model: ModelFile) -> Iterator[Finding]:
    for limits in model.guard.limits:
        name, clamp_um, slew = limits.output, limits.clamp_um, limits.slew_um_per_s
        if clamp_um is not None and limits.dead_band_um >= clamp_um:
            yield FINDINGS.finding(
                "dead-band-too-wide",
                f"{name}: within ±{limits.dead_band_um:g} µm nothing is moved, and the clamp is ±{clamp_um:g} µm: "
                "the correction stays at 0.",
                evidence={"output": name, "dead_band_um": limits.dead_band_um, "clamp_um": clamp_um},
            )
        if clamp_um is not None and slew is not None and clamp_um / slew > DAY_S:
            yield FINDINGS.finding(
                "slew-too-slow",
                f"{name}: at {slew:g} µm/s the correction takes {clamp_um / slew / DAY_S:.3g} days to {clamp_um:g} "
                "µm; machines warm up in hours.",
                evidence={"output": name, "slew_um_per_s": slew, "clamp_um": clamp_um},
                suggestion=f"choose a faster slew limit, e.g. --slew {shell_word(name)}=1",
            )


#: Relative to the largest contribution to an output: 1e6 times the rounding of float64, so that a program that adds in
#: another order passes, and 1e-7 µm at 100 µm, far below what any control resolves.
TOLERANCE = 1e-9
STEP_S = 60.0
CORNERS_OF_ALL_UP_TO = 5
RAMP_SAMPLES = 25

_READING_DECIMALS = 6


def usable_model(path: str | Path) -> tuple[ModelFile, tuple[Finding, ...]]:
    """The model in a file that keeps its word, and what was found.

    Raises ModelFileError: the file cannot be read, does not follow the schema, is not what its digest says, or a
    finding is of level ``error``.
    """
    model = read_model(path)
    findings = model_findings(model)
    require_usable(findings, path)
    return model, findings


def require_usable(findings: Iterable[Finding], path: str | Path) -> None:
    """Ends with a `ModelFileError` where a finding is of level ``error``."""
    wrong = [finding.statement for finding in findings if finding.level == "error"]
    if wrong:
        raise ModelFileError(
            "; ".join(wrong),
            expected="a model file whose vectors and numbers agree with each other",
            where=str(path),
            advice="do not use this file; make it again with `selector select --out DIR`",
        )


def model_findings(model: ModelFile) -> tuple[Finding, ...]:
    """What is wrong with a model that follows the schema; the first finding says how the test vectors went.

    Findings of level ``error`` (``test-vector-mismatch``, ``guard-vector-mismatch``, ``output-not-finite``,
    ``limits-never-met``): the model must not be used.
    """
    return (
        *_vector_findings(model),
        *_guard_vector_findings(model),
        *_size_findings(model),
        *_range_findings(model),
        *_contradicting_fallbacks(model),
        *_break_codes(model),
        *_too_slow(model),
        *_never_met(model),
        *_not_proved(model),
        *_reached_clamps(model),
    )


def sealed(model: ModelFile, *, is_kept: bool = False) -> ModelFile:
    """The model with test vectors, those of its guard, and a digest; `is_kept`: with the test vectors that it has."""
    vectors = model.test_vectors if is_kept else check_vectors(model)
    return with_digest(model.model_copy(update={"test_vectors": vectors, "guard_vectors": guard_vectors(model)}))


def check_vectors(model: ModelFile) -> tuple[CheckVector, ...]:
    """Test vectors with the outputs of the reference evaluator.

    ``start`` (start readings not given), ``corners`` of the valid ranges (all of them for up to five inputs, else each
    input alone and all together), and ``ramp`` (up, hold, back at uneven steps as long as the slowest memory).
    """
    start = {item.name: START_DEGC for item in model.inputs if item.reference == "rise"}
    corners = list(_corners(model.inputs))
    ramp_s, ramp = _ramp(model)
    return (
        _vector(model, "start", [0.0, STEP_S], [{item.name: _at(item, 0.0) for item in model.inputs}] * 2, None),
        _vector(model, "corners", [STEP_S * k for k in range(len(corners))], corners, start),
        _vector(model, "ramp", ramp_s, ramp, start),
    )


def _vector(
    model: ModelFile, name: str, time_s: list[float], rows: list[dict[str, float]], start: Mapping[str, float] | None
) -> CheckVector:
    axes = {item.position.axis: item.position for item in model.outputs if item.position is not None}
    # to and fro between the ends of the valid positions, so that the slope is seen at both
    positions = {
        axis: [(part.valid_min_m, part.valid_max_m)[k % 2] for k in range(len(rows))] for axis, part in axes.items()
    }
    asked = CheckVector(
        name=name,
        time_s=tuple(time_s),
        readings={item.name: tuple(row[item.name] for row in rows) for item in model.inputs},
        start_readings=None if start is None else dict(start),
        positions_m={axis: tuple(series) for axis, series in positions.items()} or None,
        expected={},
    )
    everything: list[Equations] = [model, *model.fallbacks]
    expected, *fallbacks = (_recomputed(of, asked) for of in everything)
    return CheckVector(**dict(asked) | {"expected": expected, "fallbacks": tuple(fallbacks)})


def _recomputed(model: Equations, vector: CheckVector) -> dict[str, tuple[float, ...]]:
    found = evaluate(model, vector.time_s, vector.readings, vector.start_readings, vector.positions_m)
    return {output: tuple(series.tolist()) for output, series in found.items()}


def _at(item: Input, share: float) -> float:
    """A reading for which x stands at this share of the valid range."""
    x = item.valid_min + share * (item.valid_max - item.valid_min)
    return round(x + START_DEGC if item.reference == "rise" else x, _READING_DECIMALS)


def _corners(inputs: tuple[Input, ...]) -> Iterator[dict[str, float]]:
    if len(inputs) <= CORNERS_OF_ALL_UP_TO:
        for ends in itertools.product((0.0, 1.0), repeat=len(inputs)):
            yield {item.name: _at(item, end) for item, end in zip(inputs, ends, strict=True)}
        return
    for everywhere in (0.0, 0.5, 1.0):
        yield {item.name: _at(item, everywhere) for item in inputs}
    for one, end in itertools.product(inputs, (0.0, 1.0)):
        yield {item.name: _at(item, end if item is one else 0.5) for item in inputs}


def _ramp(model: ModelFile) -> tuple[list[float], list[dict[str, float]]]:
    slowest_s = max((state.tau_s for state in model.states), default=STEP_S * RAMP_SAMPLES / 3.0)
    shares = np.linspace(0.0, 1.0, RAMP_SAMPLES)
    # uneven steps: a program that takes its own cycle time for the step is found out
    time_s = np.round(3.0 * slowest_s * shares**1.5, 3)
    level = np.interp(shares, [0.0, 0.4, 0.7, 1.0], [0.0, 1.0, 1.0, 0.2])
    rows = []
    for k in range(RAMP_SAMPLES):
        # the inputs follow one another, as heat does
        late = {item.name: level[max(0, k - i % 4)] for i, item in enumerate(model.inputs)}
        rows.append({item.name: _at(item, float(late[item.name])) for item in model.inputs})
    return [round(float(value) + 0.001 * k, 3) for k, value in enumerate(time_s)], rows


def _vector_findings(model: ModelFile) -> Iterator[Finding]:
    lacking = [] if model.digest is not None else ["digest"]
    lacking += [] if model.guard_vectors else ["vectors of its guard"]
    lacking += (
        ["vectors of its fallbacks"] if any(len(v.fallbacks) < len(model.fallbacks) for v in model.test_vectors) else []
    )
    if not model.test_vectors:
        said = "The model file has no test vectors: a program on a control cannot check itself against it."
        yield FINDINGS.finding("no-test-vectors", said)
        return
    largest, samples, wrong = 0.0, 0, False
    everything: list[Equations] = [model, *model.fallbacks]
    for vector in model.test_vectors:
        for number, (of, expected) in enumerate(zip(everything, (vector.expected, *vector.fallbacks), strict=False)):
            computed = _recomputed(of, vector)
            for output in of.outputs:
                given, found = np.asarray(expected[output.name]), np.asarray(computed[output.name])
                allowed = TOLERANCE * max(output_bound_um(of, output), float(np.max(np.abs(given))))
                difference = np.abs(given - found)
                samples += len(given)
                # written so that NaN counts as wrong
                bad = np.flatnonzero(~(difference <= allowed))
                if len(bad):
                    wrong = True
                    without = _without(model.fallbacks[number - 1]) if number else ""
                    yield _mismatch(vector.name, output.name, without, int(bad[0]), given, found, len(bad))
                else:
                    largest = max(largest, float(np.max(difference)))
    if not wrong:
        said = f"All {samples} expected outputs were recomputed; the largest difference is {largest:.3g} µm."
        yield FINDINGS.finding(
            "test-vectors-agree", said, evidence={"samples": samples, "max_abs_difference_um": largest}
        )
    if lacking:
        yield FINDINGS.finding(
            "not-sealed",
            f"The file has no {' and no '.join(lacking)}: a change there is not noticed.",
            evidence={"lacking": lacking},
        )


def _mismatch(vector: str, output: str, without: str, k: int, given: Array, found: Array, count: int) -> Finding:
    what = f"the fallback {without} gives" if without else "the coefficients give"
    return FINDINGS.finding(
        "test-vector-mismatch",
        f"Test vector {vector!r}: {what} {output} = {found[k]:.9g} µm at sample {k}, the file expects {given[k]:.9g} "
        f"µm ({count} such samples). The file was changed after it was exported.",
        evidence={
            "vector": vector,
            "output": output,
            "fallback": without or None,
            "sample": k,
            "expected_um": float(given[k]),
            "computed_um": float(found[k]) if math.isfinite(found[k]) else None,
            "samples": count,
        },
    )


def _without(of: Fallback) -> str:
    return f"without {', '.join(of.without)}"


def _guard_vector_findings(model: ModelFile) -> Iterator[Finding]:
    """What the guard gives now against what it gave when the file was written, to the last digits."""
    if not model.guard_vectors:
        return
    limits, guarded = decided_limits(model)[0], GuardedModel(model)
    for vector in model.guard_vectors:
        found = recomputed(model, guarded, vector)
        for field, given, now in _series(vector, found):
            allowed = (
                TOLERANCE * limits[field].clamp_um if field in limits and given is vector.expected.get(field) else 0.0
            )
            bad = np.flatnonzero(~(np.abs(np.asarray(given, float) - np.asarray(now, float)) <= allowed))
            if len(bad):
                k = int(bad[0])
                yield FINDINGS.finding(
                    "guard-vector-mismatch",
                    f"Guard vector {vector.name!r}: {field} is {now[k]:.9g} in call {k}, the file expects "
                    f"{given[k]:.9g} ({len(bad)} such calls). Guard, limits or ranges were changed after the file was "
                    "written.",
                    evidence={"vector": vector.name, "field": field, "call": k, "calls": len(bad)},
                )


def _series(vector: GuardVector, now: Mapping[str, Any]) -> Iterator[tuple[str, Sequence[float], Sequence[float]]]:
    yield from ((name, series, now["expected"][name]) for name, series in vector.expected.items())
    yield "mode", vector.mode, now["mode"]
    yield from ((f"sensor code of {name}", codes, now["sensors"][name]) for name, codes in vector.sensors.items())


def _courses(model: ModelFile) -> Iterator[CheckVector]:
    """Vectors in which the inputs move together, as they do on a machine."""
    return (vector for vector in model.test_vectors if vector.name in ("ramp", "recorded"))


def _contradicting_fallbacks(model: ModelFile) -> Iterator[Finding]:
    """Fallbacks that are farther from the model than no correction at all, where all sensors are good."""
    for k, fallback in enumerate(model.fallbacks):
        for vector in _courses(model):
            for name, series in (vector.fallbacks[k] if k < len(vector.fallbacks) else {}).items():
                own, whole = np.asarray(series), np.asarray(vector.expected[name])
                if np.sum((own - whole) ** 2) > np.sum(whole**2) > 0.0:
                    at = int(np.argmax(np.abs(whole)))
                    yield FINDINGS.finding(
                        "fallback-contradicts",
                        f"The fallback {_without(fallback)} gives {name} = {series[at]:.3g} µm where the model gives "
                        f"{vector.expected[name][at]:.3g} µm (vector {vector.name!r}): no correction would be nearer.",
                        evidence={"without": list(fallback.without), "output": name, "vector": vector.name},
                    )


def _reached_clamps(model: ModelFile) -> Iterator[Finding]:
    """Clamps that cut off a third or more where all sensors go through their ranges."""
    for limits in model.guard.limits:
        wanted = [np.abs(np.asarray(vector.expected[limits.output])) for vector in _courses(model)]
        if limits.clamp_um is not None and wanted:
            course, where = np.concatenate(wanted), "of the file's test vectors"
            yield from filter(None, [clamp_reached(limits.output, limits.clamp_um, course, where, least=1.0 / 3.0)])


def clamp_reached(
    output: str, clamp_um: float, wanted_um: Array, where: str, run: str | None = None, least: float = 0.1
) -> Finding | None:
    """How much of a correction its clamp cuts off; None if it is less than this share of the largest."""
    cut = np.maximum(np.abs(wanted_um) - clamp_um, 0.0)
    largest, lost = float(np.max(np.abs(wanted_um), initial=0.0)), float(np.max(cut, initial=0.0))
    if not lost > least * largest:
        return None
    share, rms = float(np.mean(cut > 0.0)), float(np.sqrt(np.mean(cut**2)))
    lost_um = {"lost_max_um": lost, "lost_rms_um": rms}
    return FINDINGS.finding(
        "clamp-reached",
        f"The clamp of {output}, ±{clamp_um:g} µm, cuts the correction in {100 * share:.0f} % of the samples {where}: "
        f"up to {lost:.3g} of {largest:.3g} µm are left, {rms:.3g} µm rms.",
        Where(channel=output, run=run),
        {"clamp_um": clamp_um, "largest_um": largest, "share_of_samples": share} | lost_um,
        f"if the machine may be corrected so far, export with --clamp {shell_word(output)}={math.ceil(largest)}",
    )


def _size_findings(model: ModelFile) -> Iterator[Finding]:
    everything: list[Equations] = [model, *model.fallbacks]
    for of, output in ((one, output) for one in everything for output in one.outputs):
        if not math.isfinite(output_bound_um(of, output)):
            name = f"{output.name} of a fallback" if isinstance(of, Fallback) else output.name
            said = f"{name} can overflow while every input is in its valid range."
            yield FINDINGS.finding("output-not-finite", said, evidence={"output": output.name})


def _range_findings(model: ModelFile) -> Iterator[Finding]:
    for item in model.inputs:
        if (level := item.valid_min) == item.valid_max:
            said = f"{item.name} was {level:g} throughout: the model does not know what a change of it does."
            own = {"input": item.name, "valid_min": level, "valid_max": level}
            yield FINDINGS.finding(
                "valid-range-empty", said, evidence=own | {"centre": item.centre, "scale": item.scale}
            )
