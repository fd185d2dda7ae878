"""How a small body warms, exactly: eigenmodes for held film coefficients.

In modal coordinates z = Vᵀ·C·r every mode obeys z' = −λ·z + g by itself. For a heat that changes linearly in time,
g + g'·t, the solution and its integral are (with x = λ·t and the φ-functions of exponential integrators)

    z(t)     = e^(−x)·z0 + t·φ1(x)·g + t²·φ2(x)·g'
    ∫z dt    = t·φ1(x)·z0 + t²·φ2(x)·g + t³·φ3(x)·g'.

Held heat makes g' = 0: an interval of any length is one step without error. Heat that depends on temperature is
taken linear over steps of `step_s`, between its values at the start and at the end, which is found together with the
state there: second order, and stable for any step.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from selector.physics.thermal.eigenmodes import dense
from selector.physics.thermal.stepping import Advance, Body, Interval

Vector = NDArray[np.float64]
Array = NDArray[np.float64]

_CACHE_BYTES = 64e6
_CHUNK = 4096
_LENGTHS = 32


@dataclass(frozen=True)
class _Modal:
    """A body in the modal coordinates of one set of film coefficients."""

    rate: Vector
    shapes: Array
    to_modal: Array
    rows: Array
    lubricants: Array
    heat_loads: Array
    film_loads: Array
    film_rows: Array
    _factors: dict[float, _Factors] = field(default_factory=dict)

    def factors(self, step_s: float) -> _Factors:
        """The φ-functions of a step; the last few lengths are kept."""
        if step_s not in self._factors:
            if len(self._factors) >= _LENGTHS:
                self._factors.clear()
            self._factors[step_s] = _Factors(self.rate, step_s)
        return self._factors[step_s]


class ExactStepper:
    """Exact in held intervals; steps of `step_s` [s] only where heat depends on temperature."""

    def __init__(self, body: Body, step_s: float) -> None:
        self._body = body
        self._step_s = step_s
        self._capacity = dense(body.system.capacity)
        self._modal: OrderedDict[bytes, _Modal] = OrderedDict()
        self._room = max(2, int(_CACHE_BYTES / (16 * body.system.size**2)))

    def advance(self, rise: Vector, held: Interval, read_s: Vector, keep_s: Vector) -> Advance:
        """See `Stepper.advance`."""
        modal = self._modal_of(held)
        z = modal.to_modal @ rise
        lubricants, soft = self._body.lubricants, self._body.soft
        nominal = held.lubricant_w[soft]
        depends = bool(np.any(nominal))
        steps = max(1, int(np.ceil(held.duration_s / self._step_s * (1 - 1e-12)))) if depends else 1
        ends = held.duration_s * np.arange(1, steps + 1) / steps
        read_until, keep_until = np.searchsorted(read_s, ends, "right"), np.searchsorted(keep_s, ends, "right")
        read_until[-1], keep_until[-1] = len(read_s), len(keep_s)
        fluid = modal.film_loads @ (held.film_w_per_m2_k * held.fluid_rise)
        step = held.duration_s / steps
        factors = modal.factors(step)
        steady = self._body.steady_heat_w(held)
        steady_load = fluid + modal.heat_loads @ steady
        per_watt = (factors.slope_end / step)[:, None] * modal.heat_loads[:, soft]
        lubricant_per_watt = modal.lubricants @ per_watt
        integral, heat = np.zeros(len(z)), held.duration_s * steady
        read, kept = [np.zeros((0, len(modal.rows)))], [np.zeros((0, len(z)))]
        first_read = first_keep = 0
        for k in range(steps):
            load, slope = steady_load, None
            if depends:
                before = lubricants.heat_w(nominal, modal.lubricants @ z)
                load = steady_load + modal.heat_loads[:, soft] @ before
            ahead, area = factors.step(z, load)
            if depends:
                without = modal.lubricants @ ahead - lubricant_per_watt @ before
                after = lubricants.settled_heat_w(nominal, without, lubricant_per_watt)
                slope = modal.heat_loads[:, soft] @ ((after - before) / step)
                ahead, area = ahead + factors.slope_end * slope, area + factors.slope_area * slope
                heat[soft] += 0.5 * step * (before + after)
            if read_until[k] > first_read:
                at = read_s[first_read : read_until[k]] - step * k
                at_end = len(at) == 1 and at[0] == step
                read.append((modal.rows @ ahead)[None] if at_end else _at(modal.rate, z, load, slope, at, modal.rows))
                first_read = read_until[k]
            if keep_until[k] > first_keep:
                at = keep_s[first_keep : keep_until[k]] - step * k
                kept.append(_at(modal.rate, z, load, slope, at, modal.shapes))
                first_keep = keep_until[k]
            integral += area
            z = ahead
        return Advance(modal.shapes @ z, np.concatenate(read), np.concatenate(kept), modal.film_rows @ integral, heat)

    def _modal_of(self, held: Interval) -> _Modal:
        key = held.film_w_per_m2_k.tobytes()
        if key in self._modal:
            self._modal.move_to_end(key)
            return self._modal[key]
        body = self._body
        rate, shapes = linalg.eigh(dense(body.conductance(held)), self._capacity)
        modal = _Modal(
            # a body's temperatures never grow by themselves: what is below 0 is rounding
            rate=np.maximum(rate, 0.0),
            shapes=shapes,
            to_modal=shapes.T @ self._capacity,
            rows=body.rows @ shapes,
            lubricants=body.lubricants.rows @ shapes,
            heat_loads=shapes.T @ body.heat_loads,
            film_loads=shapes.T @ body.film_loads,
            film_rows=body.film_rows @ shapes,
        )
        self._modal[key] = modal
        if len(self._modal) > self._room:
            self._modal.popitem(last=False)
        return modal


class _Factors:
    """The φ-functions of one step, computed once."""

    def __init__(self, rate: Vector, step_s: float) -> None:
        x = rate * step_s
        phi1, phi2, phi3 = phi_functions(x)
        self._decay, self._load = np.exp(-x), step_s * phi1
        self.slope_end, self.slope_area = step_s**2 * phi2, step_s**3 * phi3

    def step(self, z: Vector, load: Vector) -> tuple[Vector, Vector]:
        """State after the step, and its integral over it, with a held load."""
        return self._decay * z + self._load * load, self._load * z + self.slope_end * load


def phi_functions(x: Vector) -> tuple[Vector, Vector, Vector]:
    """φ1, φ2, φ3 of −x for x ≥ 0: (1 − e^(−x))/x, (1 − φ1)/x, (1/2 − φ2)/x, accurate down to x = 0."""
    x = np.asarray(x, dtype=np.float64)
    low, high = np.minimum(x, 1.0), np.maximum(x, 1.0)
    phi1 = -np.expm1(-high) / high
    phi2 = (1.0 - phi1) / high
    phi3 = (0.5 - phi2) / high
    # near 0 the differences cancel; the last coefficient is 1/20!, below rounding
    small = np.polynomial.polynomial.polyval(low, _PHI3)
    small2 = 0.5 - low * small
    small1 = 1.0 - low * small2
    return np.where(x < 1, small1, phi1), np.where(x < 1, small2, phi2), np.where(x < 1, small, phi3)


_PHI3 = np.cumprod(np.r_[1.0 / 6.0, -1.0 / np.arange(4, 21)])


def _at(rate: Vector, z: Vector, load: Vector, slope: Vector | None, at_s: Vector, rows: Array) -> Array:
    """Rows times the states at times within a step, shape (n_times, n_rows)."""
    found = np.empty((len(at_s), len(rows)))
    for first in range(0, len(at_s), _CHUNK):
        t = at_s[first : first + _CHUNK, None]
        phi1, phi2, _ = phi_functions(rate * t)
        states = np.exp(-rate * t) * z + t * phi1 * load
        if slope is not None:
            states += t**2 * phi2 * slope
        found[first : first + _CHUNK] = states @ rows.T
    return found
