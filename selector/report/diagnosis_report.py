"""The report of a diagnosis: first the answer and what to do, then where, how much better, why, what it misses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

from selector import __version__
from selector.atomic_file import write_whole
from selector.diagnosis.answer import Diagnosis, Errors, Fit, NamedEffect, Place, recalibration_of
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.shown_units import displayed, p_words, unit_words
from selector.diagnosis.wording import (
    amount,
    duration_words,
    headline,
    listed,
    name_of,
    quantity_words,
    sure_words,
    suspicion_words,
    what_to_do,
)
from selector.figures.diagnosis import before_after, detectability, evidence, next_runs, told_apart
from selector.figures.mismatch_map import mismatch_map
from selector.findings import Where
from selector.report import origin
from selector.report.numbers import NONE, number_text, share_text, span_text
from selector.report.page import Pictures, rendered
from selector.report.tables import Table, remarks_of, table
from selector.report.wording import label_of

MOST_PLACES = 60
_UNTESTED = "not testable here"
_MAP = (
    "Orange: more was recorded than simulated; blue: less; 1 is the rms that stands beside the response. In grey what "
    "the machine did, from its lowest (light) to its highest value (dark)."
)
_BEFORE_AFTER = "The shaded part was held out: nothing was fitted to it, and the error in the title is that part's."
_EVIDENCE = (
    "Every effect was fitted to some blocks of the record and judged on the others. Noise alone gains about nothing; p "
    "is the probability that noise gains as much, adjusted for all effects tested."
)
_DETECTABLE = (
    "Dotted: the error that is left. What is smaller than a dot may be there without being seen in this record."
)


def write_diagnosis_report(
    found: Diagnosis,
    path: str | Path,
    *,
    title: str | None = None,
    description: Mapping[str, Any] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> Path:
    """Write the report of a diagnosis as one HTML file that needs no network; whole or not at all.

    Parameters
    ----------
    found : Diagnosis
    path : path
        The file; its folder must exist.
    title : str, optional
        Heading of the page.
    description : mapping, optional
        How the recordings were read, as `selector describe` says it.
    provenance : mapping, optional
        ``machine``: its name; ``runs``: file and SHA-256 of every run; further facts are shown as they are.

    Raises
    ------
    OptionError
        The file cannot be written; an old file of that name is untouched.
    """
    target = Path(path)
    page = diagnosis_html(found, title=title, description=description, provenance=provenance)
    # a lone surrogate in a name must not end the report
    write_whole(target, page.encode("utf-8", "replace"))
    return target


def diagnosis_html(
    found: Diagnosis,
    *,
    title: str | None = None,
    description: Mapping[str, Any] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> str:
    """The report as text, see `write_diagnosis_report`."""
    pictures = Pictures()
    told, described = _visible(provenance or {}), _visible(description or {})
    machine = told.get("machine")
    findings = tuple(
        replace(
            one, statement=_visible(one.statement), where=Where(**{k: _visible(v) for k, v in vars(one.where).items()})
        )
        for one in found.findings
    )
    apart, runs, missed = told_apart(found), next_runs(found), detectability(found)
    is_tested = any(not one.note.startswith(_UNTESTED) for one in found.evidence)
    values: dict[str, Any] = {
        "title": title or ": ".join(["What the simulation left out", *([str(machine)] if machine else [])]),
        "version": __version__,
        "label": label_of(title or "", told, described),
        "verdict": found.verdict,
        "first": _visible(found.headline or headline(found)),
        "more": [_visible(step) for step in what_to_do(found)],
        "urgent": remarks_of(findings, "error", "warning"),
        "map": pictures.add(mismatch_map(found), _MAP) if found.fit else None,
        "places": _places(found),
        "effects": [_effect(found, effect) for effect in found.effects],
        "fits": [
            pictures.add(before_after(found, name), _BEFORE_AFTER if k == 0 else "") for k, name in enumerate(found.fit)
        ],
        "errors": _errors(found),
        "recalibration": _recalibration(found),
        "evidence": pictures.add(evidence(found), _EVIDENCE) if is_tested else None,
        "tested": _tested(found),
        "untested": _untested(found),
        "apart": None if apart is None else pictures.add(apart),
        "runs": None if runs is None else pictures.add(runs),
        "next": _next(found),
        "detectability": None if missed is None else pictures.add(missed, _DETECTABLE),
        "detectable": _detectable(found),
        "remarks": remarks_of(findings),
        "reading": origin.reading_tables(described),
        "files": origin.files_table(told),
        "origin": origin.remaining_table({**told, "seed": found.seed}),
    }
    return rendered("diagnosis.html", values)


def _places(found: Diagnosis) -> Table | None:
    if not found.where:
        return None
    places = sorted(found.where, key=lambda place: -place.share)
    left = len(places) - MOST_PLACES
    note = f"{left} smaller windows are in diagnosis.json." if left > 0 else ""
    return table(["channel", "place", "run", ">from", ">to", "state of the machine", ">share"], [
        _place(place) for place in places[:MOST_PLACES]
    ], note)  # fmt: skip


def _place(place: Place) -> list[str]:
    times = [NONE if time is None else duration_words(time) for time in (place.from_s, place.to_s)]
    cells = [place.channel, place.place or NONE, place.run or "all", *times, unit_words(place.regime or NONE)]
    return [_visible(cell) for cell in cells] + [share_text(place.share)]


def _effect(found: Diagnosis, effect: NamedEffect) -> dict[str, Any]:
    """What is said of one effect that was named."""
    known = next((one for one in catalogue() if one.id == effect.id), None)
    rows = [[name, quantity_words(quantity)] for name, quantity in effect.parameters.items()]
    told = [f"{sure_words(effect.confidence)}, {p_words(effect.p_value, 'p = ')}"]
    told.append(f"{share_text(effect.share)} of the mismatch")
    if effect.suspected:
        told.append(f"suspected: {suspicion_words(found, effect)}")
    return {
        "id": effect.id,
        "name": name_of(effect.id),
        "statement": _visible(effect.statement),
        "told": "; ".join(told) + ".",
        "channels": _visible(listed(list(effect.channels or (effect.channel,)))),
        "place": _visible(effect.place or ""),
        "parameters": table(["parameter", ">value (95 % interval)"], rows) if rows else None,
        "physics": known.physics if known else "",
        "refuted_by": known.refuted_by if known else "",
        "reference": known.reference if known else "",
        "alike": listed([name_of(id_) for id_ in effect.cannot_be_told_from], "or"),
        "experiment": _visible(effect.experiment),
    }


def _errors(found: Diagnosis) -> Table | None:
    if not found.fit:
        return None
    rows = [row for name, fit in found.fit.items() for row in _error_rows(name, fit)]
    headings = ["response", "rows", ">as simulated", ">recalibrated", ">with what was found", ">noise"]
    note = "Placebos are wrong effects of the same size: what they close is what chance closes."
    closed = [">share of the gap closed", ">closed by placebos"]
    return table([*headings, *closed], rows, note)


def _error_rows(name: str, fit: Fit) -> list[list[str]]:
    def cells(errors: Errors, recalibrated: float | None) -> list[str]:
        shown = (errors.rmse_before, recalibrated, errors.rmse_after, errors.noise_floor)
        return [NONE if value is None or not isfinite(value) else amount(value, fit.unit) for value in shown]

    shares = [
        NONE if one is None else _share(one.value, one.low, one.high) for one in (fit.gap_closed, fit.placebo_gain)
    ]
    name = _visible(name)
    return [
        [name, "held out", *cells(fit.heldout, fit.recalibrated_heldout), *shares],
        [name, "fitted", *cells(fit.train, None), NONE, NONE],
    ]


def _share(value: float, low: float | None, high: float | None) -> str:
    if low is None or high is None:
        return share_text(value)
    return f"{share_text(value)} ({100 * low:.0f} to {100 * high:.0f})".replace("-", "−")


def _recalibration(found: Diagnosis) -> Table | None:
    rows = [
        [_visible(response), name, quantity_words(quantity)]
        for response, quantities in found.recalibration.items()
        for name, quantity in recalibration_of(quantities).items()
    ]
    return table(["response", "of the simulation", ">should be (95 % interval)"], rows) if rows else None


def _tested(found: Diagnosis) -> Table | None:
    if not found.evidence:
        return None
    rows, marked = [], []
    tested = [one for one in found.evidence if not one.note.startswith(_UNTESTED)]
    for k, one in enumerate(sorted(tested, key=lambda one: (not one.named, -one.gain))):
        cells = [number_text(one.gain), p_words(one.p_value)]
        rows.append(
            [one.id, _visible(one.channel), *cells, "named" if one.named else _visible(one.note) or "not named"]
        )
        if one.named:
            marked.append(k)
    if not rows:
        return None
    return table(["effect", "response", ">gain", ">p", "what came of it"], rows, marked=marked)


def _untested(found: Diagnosis) -> Table | None:
    """Effects that this record says nothing of, by the reason."""
    by_reason: dict[tuple[str, str], list[str]] = {}
    for one in found.evidence:
        if one.note.startswith(_UNTESTED):
            by_reason.setdefault((one.note.removeprefix(_UNTESTED).lstrip(" :"), one.id), []).append(one.channel)
    effects: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for (reason, id_), channels in by_reason.items():
        effects.setdefault((reason, tuple(channels)), []).append(id_)
    rows = [
        [_visible(reason), ", ".join(ids), _visible(listed(channels))] for (reason, channels), ids in effects.items()
    ]
    return table(["why not", "effects", "response"], rows) if rows else None


def _next(found: Diagnosis) -> Table | None:
    if not found.next_runs:
        return None
    rows = [
        [
            _visible(run.description),
            listed([name_of(id_) for id_ in run.separates]),
            NONE if run.power is None else share_text(run.power),
            span_text(run.duration_s),
        ]
        for run in found.next_runs
    ]
    return table(["run", "tells apart", ">chance", ">takes"], rows)


def _detectable(found: Diagnosis) -> Table | None:
    if not found.detectable:
        return None
    rows = [
        [one.id, _visible(one.channel), amount(one.size, one.unit), share_text(one.chance), _visible(one.note)]
        for one in found.detectable
    ]
    units = listed(sorted({displayed(one.unit, one.size)[1] for one in found.detectable}))
    return table(
        ["effect", "response", ">smallest size", ">found in", "remark"], rows, f"Sizes are rms of the course [{units}]."
    )


def _visible(value: Any) -> Any:
    """Without the control characters that names may hold, also inside of what is nested."""
    if isinstance(value, str):
        return "".join(sign if sign.isprintable() or sign in "\n\t" else " " for sign in value)
    if isinstance(value, Mapping):
        return {_visible(key): _visible(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_visible(item) for item in value]
    return value
