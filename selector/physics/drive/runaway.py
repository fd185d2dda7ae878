"""Why did a simulated motion leave all bounds: the step, the loop, or what acts on the axis."""

from __future__ import annotations

import numpy as np

from selector.errors import InputError
from selector.physics.drive.axis import Axis
from selector.physics.drive.axis_system import largest_stable_step_s
from selector.physics.drive.reference import Reference
from selector.physics.drive.stability import stability_findings

_LARGE_SHARE = 2.0
"""Shares of feed-forward above which it is worth a word: 1 is complete."""


def runaway(
    axis: Axis, reference: Reference, *, commanded: bool, time_s: float, state: str, step_s: float
) -> InputError:
    """The error that says so.

    Parameters
    ----------
    axis, reference
        What moved, and what it was asked to do.
    commanded
        Whether given commands drove it in the place of its servo.
    time_s, state
        When [s], and what left the bounds, in words.
    step_s
        Step of the calculation [s].
    """
    found, advice = f"the {state} left all bounds before {time_s:.6g} s", ""
    stable_step_s = largest_stable_step_s(axis)
    if step_s > stable_step_s:
        advice = f"the step of {step_s:.3g} s is too long for the fastest vibration: take at most {stable_step_s:.3g} s"
    elif axis.servo is None or commanded:
        advice = "nothing holds the axis: check the commands and forces that act on it"
    else:
        unstable = [one for one in stability_findings(axis, "the axis") if one.id == "unstable-loop"]
        if unstable:
            found = f"{found}. {unstable[0].statement}".removesuffix(".")
            advice = unstable[0].suggestion
        else:
            advice = "the loop is stable: check what acts on it from outside" + _named(axis, reference)
    return InputError(
        found, expected="a motion that stays near its reference", where="simulation of the axis", advice=advice
    )


def _named(axis: Axis, reference: Reference) -> str:
    """What may be too large."""
    acting = []
    if reference.force_n is not None and (largest := float(np.abs(reference.force_n).max())) > 0:
        acting.append(f"forces of up to {largest:.3g} N")
    if axis.servo is not None:
        for name in ("velocity_feedforward", "acceleration_feedforward"):
            if (share := getattr(axis.servo, name)) > _LARGE_SHARE:
                acting.append(f"{name} of {share:.3g}")
    if axis.sensing.current_noise > 0:
        acting.append(f"current_noise of {axis.sensing.current_noise:.3g}")
    return f" ({', '.join(acting)})" if acting else ", such as forces, and where and how fast it starts"
