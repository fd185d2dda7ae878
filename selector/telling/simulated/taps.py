"""What is told of a fit to a tap test: stiffness and ψ with intervals, modes before and after, what taps do not see."""

import math
from collections.abc import Sequence

import numpy as np

from selector.findings import Finding
from selector.json_text import fields_of
from selector.number_text import listed, number_text
from selector.physics.vibration.taps import TapFit, TapMode, TapParameter
from selector.telling.account import Account, Captioned, Drawing, Table, legend, remarks_of, section, sections, table
from selector.telling.numbers import NONE, share_text
from selector.types import Vector

_MOST_DRAWN = 6


def tap_account(fit: TapFit, findings: Sequence[Finding], *, drawn: bool = False) -> Account:
    """All that is told of a model that was fitted to taps; a page is `drawn`."""
    pictures = []
    if drawn:
        from selector.figures.simulated.vibration import tapped_compliances

        panels = {f"{one.of} / {one.at}": _curves(fit, k) for k, one in enumerate(fit.responses[:_MOST_DRAWN])}
        pictures = [Drawing(tapped_compliances(panels, f"Compliances: {_left(fit)}"), legend("taps.compliances"))]
    read = [
        {
            "of": one.of,
            "at": one.at,
            "taps": len(one.taps),
            "lines": int(lines.sum()),
            "band_hz": one.frequency_hz[lines][[0, -1]].tolist(),
        }
        for one, lines in zip(fit.responses, fit.used, strict=True)
    ]
    rows = [
        (one["of"], one["at"], f"{one['taps']}", f"{one['lines']}", *map(number_text, one["band_hz"])) for one in read
    ]
    compliances = table(["motion of", "taps on", ">taps", ">lines", ">from [Hz]", ">to [Hz]"], rows)
    joints, modes = Captioned("Joints", _parameters_table(fit)), Captioned("Modes", _modes_table(fit))
    return Account(
        title=f"Tap test: {fit.after.name}",
        sentences=tuple(_sentences(fit)),
        front=tuple(pictures),
        sections=sections(
            section("fit", "What was fitted", joints, modes),
            section("findings", "All findings", remarks_of(findings)) if findings else None,
            section("read", "What was read", Captioned("Compliances", compliances, on_screen=False)),
        ),
        brief=("fit",),
        data={
            "schema": "selector.taps/1",
            "model": fit.after.name,
            **fields_of(fit, "left_before", "left_after", "noise"),
            "parameters": [dict(vars(one)) for one in fit.parameters],
            "modes": [
                {key: one and dict(vars(one)) for key, one in zip(("measured", "before", "after"), modes, strict=True)}
                for modes in fit.modes
            ],
            "responses": read,
            "findings": [one.as_dict() for one in findings],
        },
    )


def fit_head(fit: TapFit) -> str:
    """What the fitted model file says of itself in its first lines."""
    unseen = [one.name for one in fit.parameters if one.unseen]
    said = f"Fitted to taps by `selector taps`: {', '.join(one.name for one in fit.parameters)}."
    return said + (f"\nNot told by the taps: {', '.join(unseen)}." if unseen else "")


def _sentences(fit: TapFit) -> list[str]:
    counts = [(len(fit.parameters), "number"), (len(fit.responses), "compliance")]
    counts.append((min(len(one.taps) for one in fit.responses), "tap"))
    numbers, compliances, taps = (f"{count} {what}{'s' * (count != 1)}" for count, what in counts)
    said = [
        f"{numbers} {'was' if counts[0][0] == 1 else 'were'} fitted to {compliances} of {taps} or more: {_left(fit)}."
    ]
    known = [one for one in fit.parameters if not one.unseen and min(one.before, one.value) > 0]
    if known:
        most = max(known, key=lambda one: abs(math.log(one.value / one.before)))
        unit, told = _told(most, most.before, most.value)
        before, after = map(number_text, told)
        said.append(f"Most changed is the {_name(fit, most)}, from {before} to {after} {unit}".rstrip() + ".")
    unseen = [f"the {_name(fit, one)}" for one in fit.parameters if one.unseen]
    if unseen:
        said.append(f"The taps do not tell {listed(unseen)}.")
    if not any(one.name.startswith("members.") for one in fit.parameters):
        said.append("Masses are those of the model file: stiffnesses are as many percent wrong as they are.")
    return said


def _left(fit: TapFit) -> str:
    before, after, noise = (f"{number_text(100 * one, 2)} %" for one in (fit.left_before, fit.left_after, fit.noise))
    return f"the model file is {before} off them, the fitted model {after}, their own errors are {noise}"


def _curves(fit: TapFit, k: int) -> dict[str, tuple[Vector, Vector]]:
    """Curve → frequency and amplitude [µm/N] of a response at the lines that count."""
    one, lines = fit.responses[k], fit.used[k]
    named = {"measured": one.mean[lines], "by the file": fit.computed[k][0], "fitted": fit.computed[k][1]}
    return {name: (one.frequency_hz[lines], 1e6 * np.abs(values)) for name, values in named.items()}


def _name(fit: TapFit, one: TapParameter) -> str:
    """A parameter as a person calls it."""
    kind, _, rest = one.name.partition(".")
    place, _, key = rest.rpartition(".")
    if kind == "members":
        return f"mass of {place}"
    between = " – ".join(fit.after.structure.joints[int(place) - 1].between)
    return f"{'ψ' if key == 'dissipation' else 'stiffness'} of {between}"


def _told(one: TapParameter, *values: float | None) -> tuple[str, list[float]]:
    """The unit in which a parameter is told, and those of these values that there are."""
    times, unit = (1e-6, "N/µm") if one.unit == "N/m" else (1.0, one.unit.removeprefix("1"))
    return unit, [times * value for value in values if value is not None]


def _parameters_table(fit: TapFit) -> Table:
    rows = []
    for one in fit.parameters:
        unit, told = _told(one, one.before, one.value, one.low, one.high)
        half = (told[3] - told[2]) / 2.0 if len(told) == 4 else 0.0
        # an interval shows its width
        digits = 4 if half <= 0 else min(max(4, math.ceil(math.log10(abs(told[1]) / half + 1.0)) + 1), 9)
        before, value, *ends = (number_text(number, digits if k else 4) for k, number in enumerate(told))
        rows.append((_name(fit, one), unit, before, value, " to ".join(ends) or NONE, one.unseen))
    return table(["", "unit", ">file", ">fitted", ">95 % interval", "why none"], rows, legend("taps.joints"))


def _modes_table(fit: TapFit) -> Table:
    rows = [[*_cells(measured)[:2], *_cells(before), *_cells(after)] for measured, before, after in fit.modes]
    note = "MAC: likeness of the shape to the measured one, at the members that were measured."
    by = [f">{what} {whose}" for whose in ("by file", "fitted") for what in ("Hz", "ψ", "MAC")]
    return table([">measured Hz", ">ψ", *by], rows, note)


def _cells(one: TapMode | None) -> list[str]:
    if one is None:
        return [NONE] * 3
    return [f"{one.frequency_hz:.4g}", number_text(2.0 * math.pi * one.loss_factor), share_text(one.mac or math.nan)]
