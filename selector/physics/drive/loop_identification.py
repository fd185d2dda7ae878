"""Which parameters make the simulated loop move as the recorded one: output errors, and the fit that lessens them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize

from selector.errors import InputError
from selector.physics.drive.axis import Axis
from selector.physics.drive.mechanics import RigidMechanics
from selector.physics.drive.motion import Motion
from selector.physics.drive.reference import Reference
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.state import AxisState

Vector = NDArray[np.float64]

OF_MECHANICS = ("mass_kg", "guide_damping_ns_per_m")
OF_FRICTION = ("coulomb_n", "coulomb_negative_n", "offset_n")
FITTED = ("mass_kg", "guide_damping_ns_per_m", "coulomb_n", "offset_n")
LEAST_STEP = 1e-3
"""Relative step of the finite differences: large beside the moments at which friction changes its sign."""


@dataclass(frozen=True)
class LoopErrors:
    """How a simulated motion differs from a recorded one.

    Attributes
    ----------
    position_rms_m, position_max_m, relative_position_error : float
        Of the position that the control sees [m]; ‖difference‖ / ‖recorded position‖.
    command_rms, command_max, relative_command_error : float
        The same of the control's output [actuator unit].
    """

    position_rms_m: float
    position_max_m: float
    relative_position_error: float
    command_rms: float
    command_max: float
    relative_command_error: float


@dataclass(frozen=True)
class LoopFit:
    """What the fit found.

    Attributes
    ----------
    axis : Axis
        With the parameters that were found.
    names : tuple of str
        Of the fitted parameters.
    values, standard_errors : ndarrays of shape (n_parameters,)
        Estimates; standard errors for residuals that are independent of each other, so too small where they are not.
    before, after : LoopErrors
        With the parameters at the start, and with those found.
    """

    axis: Axis
    names: tuple[str, ...]
    values: Vector
    standard_errors: Vector
    before: LoopErrors
    after: LoopErrors

    def __getitem__(self, name: str) -> float:
        """The estimate of a parameter."""
        return float(self.values[self.names.index(name)])


def loop_errors(motion: Motion, measured_m: ArrayLike, command: ArrayLike, *, skip: int = 0) -> LoopErrors:
    """Differences between a simulated motion and a recorded one, the first `skip` samples left out.

    Parameters
    ----------
    measured_m, command : array-likes of shape (n_samples,)
        Recorded position [m] and output of the control [actuator unit].

    Raises
    ------
    InputError
        Lengths that differ from that of the motion.
    """
    position, output = _recorded(motion.time_s, measured_m, command)
    return LoopErrors(*_sizes(motion.measured_m[skip:], position[skip:]), *_sizes(motion.command[skip:], output[skip:]))


def fitted_in_loop(
    axis: Axis,
    reference: Reference,
    measured_m: ArrayLike,
    command: ArrayLike,
    *,
    step_s: float,
    names: Sequence[str] = FITTED,
    start: AxisState | None = None,
    skip: int = 0,
) -> LoopFit:
    """Parameters of a rigid axis with which the simulated loop leaves the least of position and command unexplained.

    Residuals of both are divided by what the first simulation leaves of each, so that both count alike; resolutions
    and noise of `axis.sensing` are left out of the search. The loop hides what it can: an error in the law of the
    control comes out as an error of the mass.

    Parameters
    ----------
    axis
        Rigid, with its servo; its parameters are where the search starts.
    reference
        What the axis was asked to do; known forces from outside in `force_n`.
    measured_m, command : array-likes of shape (n_samples,)
        Recorded position [m] and output of the control [actuator unit].
    step_s, start
        As `simulate_axis` has them.
    names
        Which of `mass_kg`, `guide_damping_ns_per_m`, `coulomb_n`, `coulomb_negative_n`, `offset_n` are fitted.
    skip
        Samples at the beginning that do not count: what happened before the record still shows there.

    Raises
    ------
    InputError
        An axis that is not rigid or has no servo, another parameter, or lengths that differ.
    """
    _check(axis, names)
    position, output = _recorded(reference.time_s, measured_m, command)

    def simulated(one: Axis) -> Motion:
        return simulate_axis(one, reference, step_s=step_s, start=start)

    before = loop_errors(simulated(axis), position, output, skip=skip)
    # steps of an encoder would hide what a small change of a parameter does
    exact = replace(axis.sensing, motor_resolution=0.0, scale_resolution_m=0.0, current_noise=0.0)
    smooth = replace(axis, sensing=exact)
    begin = np.array([_value(axis, name) for name in names])
    # a parameter that starts at 0 has no size of its own: a newton
    size = np.where(begin == 0.0, 1.0, np.abs(begin))
    position_size, command_size = before.position_rms_m or 1.0, before.command_rms or 1.0

    def residuals(scaled: Vector) -> Vector:
        motion = simulated(_with(smooth, names, scaled * size))
        return np.concatenate(
            [
                (motion.measured_m - position)[skip:] / position_size,
                (motion.command - output)[skip:] / command_size,
            ]
        )

    low = [0.0 if name == "guide_damping_ns_per_m" or name.startswith("coulomb") else -np.inf for name in names]
    low = [1e-3 if name == "mass_kg" else bound for name, bound in zip(names, low, strict=True)]
    found = optimize.least_squares(
        residuals,
        begin / size,
        bounds=(low, np.inf),
        diff_step=np.full(len(names), LEAST_STEP),
        xtol=1e-6,
        ftol=1e-8,
    )
    best = _with(axis, names, found.x * size)
    spread = 2.0 * found.cost / (len(found.fun) - len(names))
    jacobian = np.asarray(found.jac, dtype=np.float64)
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * spread
    return LoopFit(
        best,
        tuple(names),
        found.x * size,
        np.sqrt(np.diag(covariance)) * size,
        before,
        loop_errors(simulated(best), position, output, skip=skip),
    )


def _sizes(found: Vector, recorded: Vector) -> tuple[float, float, float]:
    error = found - recorded
    size = float(np.linalg.norm(error))
    whole = float(np.linalg.norm(recorded))
    return size / len(error) ** 0.5, float(np.abs(error).max()), size / whole if whole > 0 else np.inf


def _value(axis: Axis, name: str) -> float:
    value = getattr(axis.mechanics if name in OF_MECHANICS else axis.friction, name)
    return axis.friction.coulomb_n if value is None else float(value)


def _with(axis: Axis, names: Sequence[str], values: Vector) -> Axis:
    mechanics, friction = axis.mechanics, axis.friction
    for name, value in zip(names, values.tolist(), strict=True):
        if name in OF_MECHANICS:
            mechanics = replace(mechanics, **{name: value})
        else:
            friction = replace(friction, **{name: value})
    return replace(axis, mechanics=mechanics, friction=friction)


def _recorded(time_s: Vector, measured_m: ArrayLike, command: ArrayLike) -> tuple[Vector, Vector]:
    position, output = np.array(measured_m, dtype=np.float64), np.array(command, dtype=np.float64)
    if position.shape != time_s.shape or output.shape != time_s.shape:
        raise InputError(
            f"{position.shape} positions and {output.shape} commands beside {len(time_s)} simulated samples",
            expected="as many of each",
            where="recorded motion",
            advice="give the recording at the samples of the reference",
        )
    return position, output


def _check(axis: Axis, names: Sequence[str]) -> None:
    if not isinstance(axis.mechanics, RigidMechanics) or axis.servo is None:
        raise InputError(
            "an axis of several masses" if axis.servo is not None else "an axis without a servo",
            expected="a rigid axis with a servo",
            where="identification in the loop",
            advice="describe the axis as one mass under its control",
        )
    strange = [name for name in names if name not in OF_MECHANICS + OF_FRICTION]
    if strange or not names or len(set(names)) < len(names):
        raise InputError(
            ", ".join(strange) or "no parameter, or one twice",
            expected=f"some of {', '.join(OF_MECHANICS + OF_FRICTION)}, each once",
            where="names of the parameters to fit",
            advice="leave out what is not in this list",
        )
