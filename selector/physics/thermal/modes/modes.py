"""Duty cycles (cyclograms), and thermal modes: the displacement of a machine that has run through such speeds."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.physics.checks import keep_arrays
from selector.types import Vector


@dataclass(frozen=True)
class Cyclogram:
    """A stepwise course of the spindle speed (C: cyclogram), beginning with a machine at rest and at zero."""

    start_s: Vector  #: (n_segments,): Start of every segment [s]; the first is 0, they increase strictly
    #: (n_segments,): Speed held from there to the start of the next segment [r/min]; 0 = the spindle stands
    speed_rpm: Vector
    end_s: float  #: End of the last segment [s]

    def __post_init__(self) -> None:
        keep_arrays(self, "start_s", "speed_rpm")

    def within(self, fastest_rpm: float) -> "Cyclogram":
        """The duty cycle with what is faster held there."""
        return Cyclogram(self.start_s, np.minimum(self.speed_rpm, fastest_rpm), self.end_s)

    def speed_at(self, time_s: Vector) -> Vector:
        """Speed [r/min] held at each time [s]; a time at which the speed changes has the new speed."""
        return self.speed_rpm[np.clip(np.searchsorted(self.start_s, time_s, side="right") - 1, 0, None)]


@dataclass(frozen=True)
class AmbientCourse:
    """Temperatures around the machine during a duty cycle: straight between these times, constant beyond them."""

    time_s: Vector  #: (n_times,): Increasing times [s]; the first is 0
    ambient_degc: Vector  #: (n_times, n_halls): Temperatures [°C]
    names: tuple[str, ...] = ()  #: The channels of which it is said; others stay

    @classmethod
    def constant(cls, ambient_degc: Vector) -> "AmbientCourse":
        """Temperatures (n_halls,) that do not move."""
        return cls(np.zeros(1), np.asarray(ambient_degc)[None])


Kind = Literal["idle", "continuous", "rising", "intermittent", "falling", "random"]


def cyclogram_kind(cyclogram: Cyclogram) -> Kind:
    """The kind of a duty cycle (C: three basic kinds, of which all others are combinations).

    ``continuous``: one speed; ``rising``, ``falling``: the speed only goes up, or only down, in steps;
    ``intermittent``: one speed and pauses; ``idle``: it never turns; ``random``: anything else.
    """
    speed = cyclogram.speed_rpm[np.r_[True, np.diff(cyclogram.speed_rpm) != 0]]
    turning = np.unique(speed[speed > 0])
    if not len(turning):
        return "idle"
    if len(speed) == 1:
        return "continuous"
    if len(turning) == 1 and (speed[1:] == 0).any():
        return "intermittent"
    if (np.diff(speed) > 0).all():
        return "rising"
    return "falling" if (np.diff(speed) < 0).all() else "random"


STANDING = 0.002  #: Up to this share of the reference speed a spindle stands: noise of its sensor.


@dataclass(frozen=True)
class SpeedLaw:
    """Functions of the speed that every gain is a linear combination of: none of them heats a spindle that stands.

    Without knots, term j is (n / reference_rpm)^exponents[j]; the exponent 0 is 1 while the spindle turns, for axes and
    pumps that run with it. With knots there is one exponent p, and term j is (n / reference_rpm)^p times the hat
    function of knot j: a power law whose factor is free at every tested speed, linear between them, constant beyond.
    """

    exponents: tuple[float, ...]  #: Exponents, 0 or above
    reference_rpm: float  #: The speed at which powers are 1 [r/min]: the fastest tested one
    knots_rpm: tuple[float, ...] = ()  #: Increasing speeds above 0 [r/min], or empty

    def terms(self, speed_rpm: Vector) -> Vector:
        """Values of the terms, shape (n_speeds, n_terms), at speeds [r/min] of shape (n_speeds,)."""
        speed = np.asarray(speed_rpm, dtype=np.float64)
        share = speed[:, None] / self.reference_rpm
        powers = np.where(share > STANDING, share ** np.array(self.exponents), 0.0)
        if not self.knots_rpm:
            return powers
        hats = [np.interp(speed, self.knots_rpm, row) for row in np.eye(len(self.knots_rpm))]
        return powers * np.column_stack(hats)

    @property
    def size(self) -> int:
        """Number of terms."""
        return len(self.knots_rpm) or len(self.exponents)


#: Speeds this fraction above the fastest tested one are still that speed: sensors of speed are no better.
BEYOND = 0.005


@dataclass(frozen=True)
class ModalModel:
    """Displacements as sums of first-order modes with common time constants, in state-space form.

    x_j' = (f_j(n)·1 − (I + s(n)·M)·x_j)/τ for every term f_j of the speed law, and δ_r = Σ_jk gains_jkr·x_jk. The
    states are carried through changes of the speed n; from rest at constant speed this is the heating law, standing
    the cooling law (C eq. 1–4), with the levels A_k = Σ_j gains_jk·f_j(n). s(n)·M is convection that grows with the
    speed, s = (n/reference)^cooling_exponent: it speeds modes up, lowers their levels and couples them, since films act
    on a part of the machine only. M is 0 unless the tests ask for more. The hall temperature is taken to be constant.
    """

    responses: tuple[str, ...]  #: Displacements that are predicted
    tau_s: Vector  #: (n_modes,): Time constants of the standing spindle [s], increasing, shared by all responses
    gains_um: Vector  #: (n_terms, n_modes, n_responses): Steady displacement [µm] per unit of each term, without film
    law: SpeedLaw  #: How gains depend on the speed
    fastest_rpm: float  #: Fastest tested speed [r/min]; faster ones are refused
    #: (n_modes, n_modes): M, for the speed at which the law's powers are 1; a vector is its diagonal (modes without
    #: coupling)
    cooling_growth: Vector
    cooling_exponent: float = 0.8  #: Exponent of its growth with the speed

    def __post_init__(self) -> None:
        for name in ("tau_s", "gains_um", "cooling_growth"):
            values = np.array(getattr(self, name), dtype=np.float64)
            if name == "cooling_growth" and values.ndim == 1:
                values = np.diag(values)
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def states_at(self, cyclogram: Cyclogram, time_s: Vector, start: Vector | None = None) -> Vector:
        """States x, shape (n_times, n_modes, n_terms), exact between changes of speed.

        `start` of shape (n_modes, n_terms) is the state at time 0 (e.g. the last one of another cyclogram); without it
        the machine begins at rest and cold.

        Raises InputError if a speed is outside the tests.
        """
        time = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        speed = require_tested(cyclogram.speed_rpm, self.fastest_rpm)
        share = (speed / self.law.reference_rpm) ** self.cooling_exponent
        terms, losses = self.law.terms(speed), np.eye(len(self.tau_s)) + share[:, None, None] * self.cooling_growth
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
        return np.asarray(np.einsum("nkj,jkr->nr", self.states_at(cyclogram, time_s, start), self.gains_um))


def require_tested(speed_rpm: ArrayLike, fastest_rpm: float, which: str = "the fastest tested one") -> Vector:
    """The speeds [r/min]. Raises InputError: one is negative or beyond the fastest; `which` says what that is."""
    speed = np.atleast_1d(np.asarray(speed_rpm, dtype=np.float64))
    inside = (speed >= 0.0) & (speed <= fastest_rpm * (1.0 + BEYOND))
    if not inside.all():
        raise InputError(
            f"{speed[~inside][0]:g} r/min",
            expected=f"speeds from 0 to {fastest_rpm:g} r/min, {which}",
            where="duty cycle",
            advice="test the machine at that speed, or keep the duty cycle within the tested speeds",
        )
    return speed
