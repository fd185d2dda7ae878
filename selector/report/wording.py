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
    proof, faults = _improvement(selection, useful), _faults(selection, useful)
    if useless:
        first = f"Do not use the model of {listed(useless)}; for {listed(useful)}, {keep[0].lower()}{keep[1:]}{rest}."
        return Advice("part", first, (*warnings, proof, faults))
    return Advice("use", f"{keep}{rest}.", (proof, faults))


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
    return label_of(title, selection.provenance, description or {})


def label_of(title: str, *told: Mapping[str, Any]) -> Literal["simulated", "reconstructed"] | None:
    """What a title and what is told of data say about them, see `data_label`."""
    said = [title, *(text for one in told for text in _telling(one))]
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


def _improvement(selection: Selection, names: tuple[str, ...]) -> str:
    proof = selection.proof
    falls, worse = [], []
    for name in names:
        parts = proof.per_response[name]
        before, after = proof.baselines_um[name]["none"], proof.rmse_um(name)
        least, most = min(part.rmse_um for part in parts), max(part.rmse_um for part in parts)
        spread = f"{number_text(least, 2)} to {number_text(most, 2)} µm on {_SINGLE[proof.left_out]}, "
        falls.append(
            f"from {number_text(before, 2)} to {number_text(after, 2)} µm "
            f"({spread * (len(parts) > 1)}largest {number_text(proof.max_um(name), 2)} µm)"
        )
        larger = sum(part.rmse_um >= part.before_rmse_um for part in parts)
        if larger:
            worse.append(f"that of {name} on {larger} of {len(parts)}")
    if len(names) == 1:
        text = f"{_UNSEEN[proof.left_out]} the {names[0]} error falls {falls[0]}, root mean square."
    else:
        text = f"{_UNSEEN[proof.left_out]} the errors fall, root mean square: "
        text += "; ".join(f"{name} {fall}" for name, fall in zip(names, falls, strict=True)) + "."
    return text + (f" The error is larger than without compensation: {listed(worse)}." if worse else "")


def _uselessness(selection: Selection, name: str) -> str:
    ways = selection.proof.baselines_um[name]
    return (
        f"{_UNSEEN[selection.proof.left_out]} the {name} error is "
        f"{number_text(selection.proof.rmse_um(name))} µm with the model, {number_text(ways['none'])} µm without any "
        f"compensation and {number_text(ways['mean'])} µm with a constant (root mean square)."
    )


def _faults(selection: Selection, names: tuple[str, ...]) -> str:
    worst = {}
    for name in names:
        gains = [gain for gain in selection.faults if gain.response == name]
        if gains:
            worst[name] = max(gains, key=lambda gain: gain.worst_um)
    if not worst:
        return ""
    said = []
    for name, gain in worst.items():
        how = "broken (open)" if gain.open_um >= gain.stuck_um else "stuck"
        said.append(f"{number_text(gain.worst_um, 2)} µm in {name} with {gain.sensor} {how}")
    kelvin = max(gain.per_kelvin_um for gain in selection.faults if gain.response in worst)
    text = f"Worst single sensor fault: {'; '.join(said)}. "
    text += f"A reading 1 K too high costs at most {number_text(kelvin, 2)} µm."
    without = {name: max(part.before_max_um for part in selection.proof.per_response[name]) for name in worst}
    beyond = [name for name, gain in worst.items() if gain.worst_um > without[name]]
    if beyond:
        limits = " and ".join(number_text(without[name], 2) for name in beyond)
        text += (
            f" In {listed(beyond)} the worst fault is larger than any error without compensation ({limits} µm): it "
            "must be noticed before its correction reaches the axis."
        )
    return text
