"""The first thing on the page: what to do, in plain words, and what kind of data it rests on."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from selector.report.numbers import listed, number_text
from selector.selection import Selection

USELESS = "no-better-than-nothing"
_UNSEEN = {
    "run": "On runs that the model has not seen",
    "condition": "Under conditions that the model has not seen",
    "block": "On stretches of the only run that the model has not seen",
}
_SINGLE = {"run": "single runs", "condition": "single conditions", "block": "single stretches"}
_TELLING_KEYS = ("machine", "name", "note", "origin", "source", "kind", "label", "comment", "title", "description")


@dataclass(frozen=True)
class Advice:
    """What to do.

    Attributes
    ----------
    verdict : {"use", "part", "do not use"}
    first : str
        The first sentence.
    more : tuple of str
    """

    verdict: Literal["use", "part", "do not use"]
    first: str
    more: tuple[str, ...]


def advice(selection: Selection) -> Advice:
    """What the proof says one should do; a model that is no better than nothing is not to be used."""
    useless = tuple(name for name in selection.models if name in useless_responses(selection))
    useful = tuple(name for name in selection.models if name not in useless)
    keep = f"Keep sensor{'s' * (len(selection.chosen) > 1)} {listed(selection.chosen)}"
    dropped = len(selection.sensors) - len(selection.chosen)
    rest = f"; the other {dropped} of {len(selection.sensors)} are not needed" if dropped > 1 else ""
    warnings = tuple(_uselessness(selection, name) for name in useless)
    if not useful:
        return Advice("do not use", f"Do not use this model{_of(useless, selection)}.", warnings)
    proof = tuple(_improvement(selection, name) for name in useful)
    faults = tuple(_fault(selection, name) for name in useful)
    if useless:
        first = f"Do not use the model of {listed(useless)}; for {listed(useful)}, {keep[0].lower()}{keep[1:]}{rest}."
        return Advice("part", first, (*warnings, *proof, *faults))
    return Advice("use", f"{keep}{rest}.", (*proof, *faults))


def useless_responses(selection: Selection) -> frozenset[str]:
    """Responses whose model does not beat leaving the machine alone."""
    return frozenset(
        finding.where.channel or name
        for finding in selection.findings
        if finding.id == USELESS
        for name in ([finding.where.channel] if finding.where.channel else list(selection.models))
    )


def data_label(
    selection: Selection, description: Mapping[str, Any] | None, title: str
) -> Literal["simulated", "reconstructed"] | None:
    """Whether the data say of themselves that they are no measurement (machine name, notes, title)."""
    said = [title, *_telling(selection.provenance), *_telling(description or {})]
    text = " ".join(said).lower()
    if re.search(r"\breconstruct", text):
        return "reconstructed"
    return "simulated" if re.search(r"\bsimulat|\bsynthetic", text) else None


def _telling(value: Any, key: str = "machine") -> Iterator[str]:
    if isinstance(value, str):
        if key in _TELLING_KEYS:
            yield value
    elif isinstance(value, Mapping):
        for inner, item in value.items():
            # statements of findings speak about anything
            if inner != "findings":
                yield from _telling(item, str(inner).lower())


def _of(names: tuple[str, ...], selection: Selection) -> str:
    return f" of {listed(names)}" if len(selection.models) == 1 else ""


def _improvement(selection: Selection, name: str) -> str:
    proof = selection.proof
    parts = proof.per_response[name]
    before, after = proof.baselines_um[name]["none"], proof.rmse_um(name)
    least, most = min(part.rmse_um for part in parts), max(part.rmse_um for part in parts)
    worse = sum(part.rmse_um >= part.before_rmse_um for part in parts)
    but = f" On {worse} of {len(parts)} it is larger than without compensation." if worse else ""
    spread = f"; {number_text(least, 2)} to {number_text(most, 2)} µm on {_SINGLE[proof.left_out]}" * (len(parts) > 1)
    largest = number_text(proof.max_um(name), 2)
    return (
        f"{_UNSEEN[proof.left_out]} the {name} error falls from {number_text(before, 2)} to "
        f"{number_text(after, 2)} µm (root mean square{spread}; largest error {largest} µm).{but}"
    )


def _uselessness(selection: Selection, name: str) -> str:
    ways = selection.proof.baselines_um[name]
    return (
        f"{_UNSEEN[selection.proof.left_out]} the {name} error is "
        f"{number_text(selection.proof.rmse_um(name))} µm with the model, {number_text(ways['none'])} µm without any "
        f"compensation and {number_text(ways['mean'])} µm with a constant (root mean square)."
    )


def _fault(selection: Selection, name: str) -> str:
    gains = [gain for gain in selection.faults if gain.response == name]
    if not gains:
        return ""
    worst = max(gains, key=lambda gain: gain.worst_um)
    how = "broken (open)" if worst.open_um >= worst.stuck_um else "stuck"
    without = max(part.before_max_um for part in selection.proof.per_response[name])
    more = (
        f" That is more than the largest error without any compensation ({number_text(without, 2)} µm): such a fault "
        "must be noticed before the correction is used."
        if worst.worst_um > without
        else ""
    )
    return (
        f"Worst single sensor fault for {name}: {number_text(worst.worst_um, 2)} µm, {worst.sensor} {how}; a reading "
        f"1 K too high costs at most {number_text(max(gain.per_kelvin_um for gain in gains), 2)} µm.{more}"
    )
