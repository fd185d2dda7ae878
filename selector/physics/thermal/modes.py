"""Thermal modes: the displacement of a machine that has run through these speeds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.thermal.cyclogram import Cyclogram
from selector.physics.thermal.speed_law import SpeedLaw

Vector = NDArray[np.float64]
BEYOND = 0.005
"""Speeds this fraction above the fastest tested one are still that speed: sensors of speed are no better."""


def heating(time_s: Vector, tau_s: Vector, steady_um: Vector, initial_um: Vector) -> Vector:
    """Σ_k A_k (1 − e^(−t/τ_k)) + Σ_k B_k e^(−t/τ_k) [µm], shape (n_times,) (C eq. 1, 3).

    steady_um is A and initial_um is B, both of shape (n_modes,).
    """
    left = np.exp(-np.asarray(time_s, dtype=np.float64)[:, None] / tau_s)
    return (1.0 - left) @ steady_um + left @ initial_um


def cooling(time_s: Vector, tau_s: Vector, steady_um: Vector, initial_um: Vector) -> Vector:
    """The heating law with A and B exchanged [µm], shape (n_times,): back from where heating ends (C eq. 2, 4)."""
    return heating(time_s, tau_s, initial_um, steady_um)


@dataclass(frozen=True)
class ModalModel:
    """Displacements as sums of first-order modes with common time constants, in state-space form.

    x_k' = (G_k(n) − x_k)·c_k(n)/τ_k and δ = Σ_k x_k, for every response; n = spindle speed. Each mode carries its state
    through a change of speed; from rest at constant speed this is the heating law (C eq. 1, 3), at n = 0 the cooling
    law (C eq. 2, 4). c_k(n) = 1 + cooling_growth_k·(n / reference)^cooling_exponent is convection that grows with the
    speed; it is 1 unless the tests ask for more. The hall temperature is taken to be constant.

    Attributes
    ----------
    responses : tuple of str
        Displacements that are predicted.
    tau_s : ndarray of shape (n_modes,)
        Time constants of the standing spindle [s], increasing, shared by all responses.
    gains_um : ndarray of shape (n_terms, n_modes, n_responses)
        Coefficients [µm] of the terms of the law: G_k(n) = Σ_j gains_um[j, k]·term_j(n).
    law : SpeedLaw
        How gains depend on the speed.
    fastest_rpm : float
        Fastest tested speed [r/min]; faster ones are refused.
    cooling_growth : ndarray of shape (n_modes,)
        Growth of the rate of each mode from standing to the reference speed; 0 = constant time constants.
    cooling_exponent : float
        Exponent of that growth.
    """

    responses: tuple[str, ...]
    tau_s: Vector
    gains_um: Vector
    law: SpeedLaw
    fastest_rpm: float
    cooling_growth: Vector
    cooling_exponent: float = 1.0

    def __post_init__(self) -> None:
        for name in ("tau_s", "gains_um", "cooling_growth"):
            values = np.array(getattr(self, name), dtype=np.float64)
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        if self.gains_um.shape != (self.law.size, len(self.tau_s), len(self.responses)):
            raise ValueError(f"gains of shape {self.gains_um.shape} do not fit the law, modes and responses")

    @property
    def speed_limits_rpm(self) -> tuple[float, float]:
        """Slowest and fastest speed [r/min] that may be predicted: standing, and the fastest tested one."""
        return 0.0, self.fastest_rpm

    def gain_um(self, speed_rpm: Vector) -> Vector:
        """Steady displacement of every mode [µm], shape (n_speeds, n_modes, n_responses).

        Raises
        ------
        InputError
            If a speed is negative, missing or faster than the fastest tested one.
        """
        speed = self._checked(speed_rpm)
        return np.asarray(np.tensordot(self.law.terms(speed), self.gains_um, axes=1))

    def rate_per_s(self, speed_rpm: Vector) -> Vector:
        """c_k(n)/τ_k [1/s], shape (n_speeds, n_modes); errors as in `gain_um`."""
        share = (self._checked(speed_rpm) / self.law.reference_rpm) ** self.cooling_exponent
        return (1.0 + share[:, None] * self.cooling_growth) / self.tau_s

    def states_um(self, cyclogram: Cyclogram, time_s: Vector, start_um: Vector | None = None) -> Vector:
        """States x of the modes [µm], shape (n_times, n_modes, n_responses), exact between changes of speed.

        `start_um` of shape (n_modes, n_responses) is the state at time 0 (e.g. the last one of another cyclogram);
        without it the machine begins at rest and cold.

        Raises
        ------
        InputError
            If a speed is outside the tests, or a time outside the cyclogram.
        """
        time = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        if not ((time >= 0.0) & (time <= cyclogram.end_s)).all():
            wrong = time[~((time >= 0.0) & (time <= cyclogram.end_s))][0]
            raise InputError(
                f"a prediction at {wrong:g} s",
                expected=f"times from 0 to {cyclogram.end_s:g} s, the end of the duty cycle",
                where="duty cycle",
                advice="ask for times inside the duty cycle, or give its last segment a later end",
            )
        gains = self.gain_um(cyclogram.speed_rpm)
        rates = self.rate_per_s(cyclogram.speed_rpm)
        entry = np.zeros_like(gains)
        if start_um is not None:
            entry[0] = start_um
        for i, length_s in enumerate(np.diff(cyclogram.start_s)):
            left = np.exp(-length_s * rates[i])[:, None]
            entry[i + 1] = gains[i] + (entry[i] - gains[i]) * left
        at = np.searchsorted(cyclogram.start_s, time, side="right") - 1
        left = np.exp(-(time - cyclogram.start_s[at])[:, None] * rates[at])[:, :, None]
        return np.asarray(gains[at] + (entry[at] - gains[at]) * left)

    def displacement_um(self, cyclogram: Cyclogram, time_s: Vector, start_um: Vector | None = None) -> Vector:
        """Displacements [µm], shape (n_times, n_responses), at times [s] of shape (n_times,); see `states_um`."""
        return np.asarray(self.states_um(cyclogram, time_s, start_um).sum(axis=1))

    def characteristic(self, speed_rpm: float, time_s: Vector) -> Vector:
        """δ(n, t) [µm], shape (n_times, n_responses): continuous running from rest; errors as in `states_um`."""
        end_s = float(max(np.max(time_s, initial=0.0), 1.0))
        return self.displacement_um(Cyclogram(np.zeros(1), np.array([speed_rpm]), end_s), time_s)

    def cooling(self, start_um: Vector, time_s: Vector) -> Vector:
        """δ(t) [µm] of a standing spindle, shape (n_times, n_responses); the start has shape (n_modes, n_responses)."""
        end_s = float(max(np.max(time_s, initial=0.0), 1.0))
        return self.displacement_um(Cyclogram(np.zeros(1), np.zeros(1), end_s), time_s, start_um)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states: mode by mode, and within a mode response by response."""
        return tuple(f"mode {k + 1} of {response}" for k in range(len(self.tau_s)) for response in self.responses)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The only input."""
        return ("spindle_speed",)

    @property
    def outputs(self) -> tuple[str, ...]:
        """The responses."""
        return self.responses

    @property
    def places(self) -> tuple[str, ...]:
        """Where something may be added: at each response."""
        return self.responses

    def derivative(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """Rate of change x' [µm/s] of shape (n_states,) at `t_s` [s], of states x [µm] at the speed u[0] [r/min]."""
        del t_s  # the equations do not change with time
        state = np.reshape(x, (len(self.tau_s), len(self.responses)))
        speed = np.atleast_1d(np.asarray(u, dtype=np.float64))[:1]
        return np.asarray(((self.gain_um(speed)[0] - state) * self.rate_per_s(speed)[0][:, None]).ravel())

    def output(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """Displacements [µm] of shape (n_responses,) in the states x [µm]; the speed u acts through the states only."""
        del t_s, u
        return np.asarray(np.reshape(x, (len(self.tau_s), len(self.responses))).sum(axis=0))

    def _checked(self, speed_rpm: Vector) -> Vector:
        speed = np.atleast_1d(np.asarray(speed_rpm, dtype=np.float64))
        inside = (speed >= 0.0) & (speed <= self.fastest_rpm * (1.0 + BEYOND))
        if not inside.all():
            raise InputError(
                f"{speed[~inside][0]:g} r/min",
                expected=f"speeds from 0 to {self.fastest_rpm:g} r/min, the fastest tested one",
                where="duty cycle",
                advice="test the machine at that speed, or keep the duty cycle within the tested speeds",
            )
        return speed
