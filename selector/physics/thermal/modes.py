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

ROUNDING = 1e-9
"""Times this share beyond the end of a duty cycle are its end."""


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

    x_j' = (f_j(n)·1 − (I + s(n)·M)·x_j)/τ for every term f_j of the speed law, and δ_r = Σ_jk gains_jkr·x_jk. The
    states are carried through changes of the speed n; from rest at constant speed this is the heating law, standing
    the cooling law (C eq. 1–4), with the levels A_k = Σ_j gains_jk·f_j(n). s(n)·M is convection that grows with the
    speed, s = (n/reference)^cooling_exponent: it speeds modes up, lowers their levels and couples them, since films act
    on a part of the machine only. M is 0 unless the tests ask for more. The hall temperature is taken to be constant.

    Attributes
    ----------
    responses : tuple of str
        Displacements that are predicted.
    tau_s : ndarray of shape (n_modes,)
        Time constants of the standing spindle [s], increasing, shared by all responses.
    gains_um : ndarray of shape (n_terms, n_modes, n_responses)
        Steady displacement [µm] per unit of each term, without film.
    law : SpeedLaw
        How gains depend on the speed.
    fastest_rpm : float
        Fastest tested speed [r/min]; faster ones are refused.
    cooling_growth : ndarray of shape (n_modes, n_modes) or (n_modes,)
        M, for the speed at which the law's powers are 1; a vector is its diagonal (modes without coupling).
    cooling_exponent : float
        Exponent of its growth with the speed.
    """

    responses: tuple[str, ...]
    tau_s: Vector
    gains_um: Vector
    law: SpeedLaw
    fastest_rpm: float
    cooling_growth: Vector
    cooling_exponent: float = 0.8

    def __post_init__(self) -> None:
        for name in ("tau_s", "gains_um", "cooling_growth"):
            values = np.array(getattr(self, name), dtype=np.float64)
            if name == "cooling_growth" and values.ndim == 1:
                values = np.diag(values)
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        modes = len(self.tau_s)
        if self.gains_um.shape != (self.law.size, modes, len(self.responses)):
            raise ValueError(f"gains of shape {self.gains_um.shape} do not fit the law, modes and responses")
        if self.cooling_growth.shape != (modes, modes):
            raise ValueError(f"cooling growth of shape {self.cooling_growth.shape} for {modes} modes")

    @property
    def speed_limits_rpm(self) -> tuple[float, float]:
        """Slowest and fastest speed [r/min] that may be predicted: standing, and the fastest tested one."""
        return 0.0, self.fastest_rpm

    def gain_um(self, speed_rpm: Vector) -> Vector:
        """Steady displacement that each mode contributes [µm], shape (n_speeds, n_modes, n_responses).

        Raises
        ------
        InputError
            If a speed is negative, missing or faster than the fastest tested one.
        """
        speed = self._checked(speed_rpm)
        terms = self.law.terms(speed)
        share = np.linalg.solve(self._losses(speed), np.ones((len(speed), len(self.tau_s), 1)))[:, :, 0]
        return np.asarray(np.einsum("nj,nk,jkr->nkr", terms, share, self.gains_um))

    def states_at(self, cyclogram: Cyclogram, time_s: Vector, start: Vector | None = None) -> Vector:
        """States x, shape (n_times, n_modes, n_terms), exact between changes of speed.

        `start` of shape (n_modes, n_terms) is the state at time 0 (e.g. the last one of another cyclogram); without it
        the machine begins at rest and cold.

        Raises
        ------
        InputError
            If a speed is outside the tests, or a time outside the cyclogram.
        """
        time = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        # sums of decimal minutes are off by roundings
        inside = (time >= 0.0) & (time <= cyclogram.end_s * (1.0 + ROUNDING))
        if not inside.all():
            raise InputError(
                f"a prediction at {time[~inside][0]:g} s",
                expected=f"times from 0 to {cyclogram.end_s:g} s, the end of the duty cycle",
                where="duty cycle",
                advice="ask for times inside the duty cycle, or give its last segment a later end",
            )
        speed = self._checked(cyclogram.speed_rpm)
        terms, losses = self.law.terms(speed), self._losses(speed)
        values, vectors = np.linalg.eig(losses / self.tau_s[:, None])
        at = np.searchsorted(cyclogram.start_s, time, side="right") - 1
        out = np.zeros((len(time), len(self.tau_s), self.law.size))
        entry = np.zeros(out.shape[1:]) if start is None else np.asarray(start, dtype=np.float64)
        ends = np.append(cyclogram.start_s[1:], cyclogram.end_s)
        for i, (begin_s, end_s) in enumerate(zip(cyclogram.start_s, ends, strict=True)):
            rows = np.flatnonzero(at == i)
            steady = np.linalg.solve(losses[i], np.ones((len(self.tau_s), 1))) * terms[i]
            inward = np.linalg.solve(vectors[i], entry - steady)
            since = np.append(time[rows], end_s) - begin_s
            course = np.real(vectors[i] @ (np.exp(-since[:, None] * values[i])[:, :, None] * inward)) + steady
            out[rows], entry = course[:-1], course[-1]
        return out

    def displacement_um(self, cyclogram: Cyclogram, time_s: Vector, start: Vector | None = None) -> Vector:
        """Displacements [µm], shape (n_times, n_responses), at times [s] of shape (n_times,); see `states_at`."""
        return self._displacement(self.states_at(cyclogram, time_s, start))

    def mode_displacement_um(self, cyclogram: Cyclogram, time_s: Vector) -> Vector:
        """What each mode contributes [µm], shape (n_times, n_modes, n_responses); the sum is the displacement."""
        return np.asarray(np.einsum("nkj,jkr->nkr", self.states_at(cyclogram, time_s), self.gains_um))

    def characteristic(self, speed_rpm: float, time_s: Vector) -> Vector:
        """δ(n, t) [µm], shape (n_times, n_responses): continuous running from rest; errors as in `states_at`."""
        end_s = float(max(np.max(time_s, initial=0.0), 1.0))
        return self.displacement_um(Cyclogram(np.zeros(1), np.array([speed_rpm]), end_s), time_s)

    def cooling(self, start: Vector, time_s: Vector) -> Vector:
        """δ(t) [µm] of a standing spindle, shape (n_times, n_responses), from a state of shape (n_modes, n_terms)."""
        end_s = float(max(np.max(time_s, initial=0.0), 1.0))
        return self.displacement_um(Cyclogram(np.zeros(1), np.zeros(1), end_s), time_s, start)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states: mode by mode, and within a mode term by term of the law."""
        return tuple(f"mode {k + 1}, term {j + 1}" for k in range(len(self.tau_s)) for j in range(self.law.size))

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
        """Rate of change x' [1/s] of shape (n_states,) at `t_s` [s], of states x at the speed u[0] [r/min]."""
        del t_s  # the equations do not change with time
        state = np.reshape(x, (len(self.tau_s), self.law.size))
        speed = self._checked(np.atleast_1d(np.asarray(u, dtype=np.float64))[:1])
        change = self.law.terms(speed) - self._losses(speed)[0] @ state
        return np.asarray((change / self.tau_s[:, None]).ravel())

    def output(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """Displacements [µm] of shape (n_responses,) in the states x; the speed u acts through the states only."""
        del t_s, u
        return self._displacement(np.reshape(x, (1, len(self.tau_s), self.law.size)))[0]

    def _displacement(self, states: Vector) -> Vector:
        return np.asarray(np.einsum("nkj,jkr->nr", states, self.gains_um))

    def _losses(self, speed: Vector) -> Vector:
        """I + s(n)·M, shape (n_speeds, n_modes, n_modes)."""
        share = (speed / self.law.reference_rpm) ** self.cooling_exponent
        return np.eye(len(self.tau_s)) + share[:, None, None] * self.cooling_growth

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
