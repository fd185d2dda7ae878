"""What makes a comparison no basis for an answer: too few samples, nothing that moves, other units, no difference."""

from __future__ import annotations

import dataclasses

import numpy as np

from selector.diagnosis.comparison import Comparison, Vector
from selector.diagnosis.entrance.readings import rows_in_stretches
from selector.errors import InputError
from selector.findings import Finding, Where

LEAST_SAMPLES = 40
"""Compared samples that are needed to fit offset, gain and delay and to tell noise from structure."""
_UNIT_FACTORS = {1e3: "mm and µm, or m and mm", 1e6: "m and µm", 60.0: "per second and per minute"}
"""How many times larger a number is in another unit, where no calibration error could explain it."""
_SMALLEST = 1e-30
"""Below this the square of a course may be no number."""
_ROUNDED = 0.51
"""Steps of the resolution by which rounding alone makes two equal courses differ."""


def without_useless(comparison: Comparison, *, asked: bool) -> Comparison:
    """The comparison without responses from which nothing can be learned, and why, as findings.

    Parameters
    ----------
    comparison : Comparison
    asked : bool
        Whether the user named the responses: then it is a warning that one is a mere input of the simulation.

    Raises
    ------
    InputError
        No response is left, or one is in another unit in the simulation.
    """
    findings, kept = list(comparison.findings), []
    copies = set(identical_responses(comparison))
    for name in comparison.responses:
        reason = _reason(comparison, name)
        if reason is None and name in copies and len(copies) < len(comparison.responses):
            # what the simulation was given, it hands back
            level = "warning" if asked else "info"
            findings.append(_told("input-of-simulation", level, name, "is in the simulation as it was recorded"))
        elif reason is None:
            _require_same_unit(comparison, name)
            kept.append(name)
        else:
            findings.append(_told("not-compared", "warning", name, reason))
    if not kept:
        ids = ("not-compared", "beyond-measure")
        reasons = " ".join(finding.statement for finding in findings if finding.id in ids)
        raise InputError(
            reasons.removesuffix("."),
            expected=f"a channel that moves and has at least {LEAST_SAMPLES} samples with a simulated value outside "
            "the part that is held out",
            where="recording and simulation",
            advice="give longer or more runs, or check the time columns and what the columns hold",
        )
    short = [run for run, rows in comparison.rows_of_runs() if rows.stop - rows.start < LEAST_SAMPLES]
    findings += [
        Finding(
            "short-run",
            "info",
            f"Run {run} has fewer than {LEAST_SAMPLES} samples: what happens in it alone cannot be told from noise.",
            Where(run=run),
            {},
            "record longer",
        )
        for run in short
    ]
    findings += [_still(comparison, name) for name in kept if np.ptp(_seen(comparison.simulated[name])) == 0.0]
    findings += [_same(comparison, name) for name in kept if name in copies]
    return dataclasses.replace(comparison, responses=tuple(kept), findings=tuple(findings))


def identical_responses(comparison: Comparison) -> tuple[str, ...]:
    """Responses in which recording and simulation differ by no more than the rounding of the readings."""
    same = []
    for name in comparison.responses:
        difference = _seen(comparison.difference(name))
        size = float(np.abs(_seen(comparison.recorded[name])).max(initial=0.0))
        rounding = max(_ROUNDED * comparison.resolution.get(name, 0.0), 1e-9 * size)
        # a noisy recording never lies within half a step of a smooth course throughout
        if len(difference) and np.abs(difference).max() <= rounding:
            same.append(name)
    return tuple(same)


def _reason(comparison: Comparison, name: str) -> str | None:
    """Why nothing can be learned from a response, as a clause; None if something can."""
    compared = np.isfinite(comparison.difference(name))
    fitted = int(np.sum(compared & ~comparison.held_out))
    if not compared.any():
        missing = "recorded" if not np.isfinite(comparison.recorded[name]).any() else "simulated"
        return f"has no {missing} value where it could be compared"
    if fitted < LEAST_SAMPLES:
        return f"has {fitted} samples that can be compared and are not held out"
    if np.ptp(comparison.recorded[name][compared]) == 0.0:
        return "never moves in the recording"
    moved = float(np.ptp(comparison.recorded[name][compared]))
    if moved < _SMALLEST:
        return f"moves by {moved:.3g} {comparison.channel(name).unit} at most in the recording, which is no reading"
    without_hole = rows_in_stretches(comparison, compared & ~comparison.held_out)
    if without_hole < LEAST_SAMPLES:
        return f"has {without_hole} samples that follow each other without a hole and are not held out"
    return None


def _require_same_unit(comparison: Comparison, name: str) -> None:
    """Ends with an error when one course is the other times a factor between units."""
    compared = np.isfinite(comparison.difference(name))
    recorded, simulated = comparison.recorded[name][compared], comparison.simulated[name][compared]
    x, y = simulated - simulated.mean(), recorded - recorded.mean()
    size = float(np.sqrt(x @ x) * np.sqrt(y @ y))
    if size == 0.0 or float(x @ y) < 0.9 * size:
        return
    gain = float(y @ y / (x @ y))
    for factor, units in _UNIT_FACTORS.items():
        for times in (factor, 1.0 / factor):
            if abs(gain / times - 1.0) < 0.15:
                raise InputError(
                    f"what was recorded of {name} is {gain:.4g} times what was simulated, as between {units}",
                    expected="the same unit in both",
                    where=f"channel {name!r} of the simulation",
                    advice="convert the simulated column to the unit that the machine file says, or correct that",
                )


def _told(id: str, level: str, name: str, clause: str) -> Finding:  # noqa: A002 - as in Finding
    return Finding(
        id,
        "warning" if level == "warning" else "info",
        f"{name} is not compared: it {clause}.",
        Where(channel=name),
        {},
        "" if level == "info" else "check the recording and the file",
    )


def _still(comparison: Comparison, name: str) -> Finding:
    return Finding(
        "simulation-stands-still",
        "warning",
        f"The simulated {name} never moves: all that was recorded counts as left out.",
        Where(channel=name),
        {"value": float(_seen(comparison.simulated[name])[0])},
        "check that the column holds what was simulated",
    )


def _same(comparison: Comparison, name: str) -> Finding:
    difference = _seen(comparison.difference(name))
    return Finding(
        "simulation-is-recording",
        "warning",
        f"The simulated {name} is the recorded one to within its rounding: there is no difference to explain.",
        Where(channel=name),
        {"largest_difference": float(np.abs(difference).max())},
        "check that the simulation is not a copy of the recording",
    )


def _seen(values: Vector) -> Vector:
    return values[np.isfinite(values)]
