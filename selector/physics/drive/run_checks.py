"""Which runs are too long to be calculated."""

from __future__ import annotations

from selector.errors import InputError
from selector.physics.drive.axis import Axis
from selector.physics.drive.model_schema import MOST_STEPS
from selector.physics.drive.simulation import steps_per_period


def require_few_steps(
    name: str, axis: Axis, duration_s: float, step_s: float, *, period_s: float | None = None, because: str = ""
) -> None:
    """Refuses a run of an axis with too many steps, as they are laid: control and samples make them shorter.

    Parameters
    ----------
    name, axis
        The axis and what it is called in the model file.
    duration_s, step_s
        Length of its motion, and the largest step [s].
    period_s
        Distance of the samples [s]; None: not known yet, but no shorter than the steps.
    because
        Why the motion takes long, see `model_motion.slow_feed_words`.

    Raises
    ------
    InputError
        There are more than `MOST_STEPS`; or the periods of samples and control do not fit together.
    """
    sample_s = axis.servo.sample_s if axis.servo is not None else 0.0
    count = duration_s / (min(step_s, sample_s) if sample_s > 0 else step_s)
    if count <= MOST_STEPS and period_s is not None:
        count = duration_s / period_s * steps_per_period(axis, period_s, step_s)
    if count <= MOST_STEPS:
        return
    by_step = duration_s / step_s > 0.5 * count
    raise InputError(
        f"{count:.3g} steps of {duration_s / count:.3g} s in a motion of {duration_s:.6g} s of axis {name}{because}",
        expected=f"at most {MOST_STEPS}",
        where="key run.step_s" if by_step else f"key axes.{name}.servo.sample_s",
        advice="simulate a shorter motion or a faster feed, or give a larger "
        + ("run.step_s" if by_step else "sample_s, and a run.period_s that is a multiple of it"),
    )
