"""How the temperatures and displacements of a machine follow what it does."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg, sparse

from selector.errors import InputError
from selector.physics.thermal.network import heat_system
from selector.types import Array, Vector

Method = Literal["auto", "exact", "implicit"]

REFERENCE_DEGC = 20.0  #: Temperature at which a part has its length (ISO 1).
_EXACT_STATES = 300
_EIGEN_SECONDS = 3.0


@dataclass(frozen=True)
class EnergyBalance:
    """Where the heat of a run came from and went to [J]."""

    stored_j: float  #: Growth of the heat stored in the body
    sources_j: Mapping[str, float]  #: Heat put in by every source
    films_j: Mapping[str, float]  #: Heat given to the fluid at every surface; negative where the fluid warms the body

    @property
    def turnover_j(self) -> float:
        """Sum of all amounts without their signs [J]."""
        return abs(self.stored_j) + sum(map(abs, self.sources_j.values())) + sum(map(abs, self.films_j.values()))

    @property
    def missing_j(self) -> float:
        """What was put in less what was given away and stored [J]; 0 up to rounding."""
        return sum(self.sources_j.values()) - sum(self.films_j.values()) - self.stored_j

    @property
    def missing_share(self) -> float:
        """`missing_j` relative to the turnover; 0 for a body that exchanges no heat."""
        return abs(self.missing_j) / self.turnover_j if self.turnover_j > 0 else 0.0


@dataclass(frozen=True)
class HeatHistory:
    """Result of a thermal simulation."""

    time_s: Vector  #: (n_times,): Times [s], as asked for
    probes: tuple[str, ...]  #: Names of the columns of `probe_degc`
    probe_degc: Array  #: (n_times, n_probes): Temperatures [°C]
    displacements: tuple[str, ...]  #: Names of the columns of `displacement_um`
    #: (n_times, n_displacements): Displacements [µm], zero for a body that is at the reference temperature everywhere
    displacement_um: Array
    states: Array  #: (n_kept, n): Temperatures [°C] of all states at the chosen times
    end_state: Vector  #: (n,): State at the end of the conditions [°C]: where a next run can start
    balance: EnergyBalance  #: Heat from the start to the end of the conditions
    method: Literal["exact", "implicit"]  #: {"exact", "implicit"}: The stepper that was used


def simulate_heat(
    system: heat_system.HeatSystem,
    laws: heat_system.Laws,
    conditions: heat_system.Conditions,
    *,
    time_s: ArrayLike,
    step_s: float,
    start_degc: float | None = None,
    start_state: ArrayLike | None = None,
    keep_states_at_s: ArrayLike = (),
    reference_degc: float = REFERENCE_DEGC,
    method: Method = "auto",
) -> HeatHistory:
    """Temperatures and displacements of a machine under given conditions.

    It starts with `start_degc` [°C] everywhere or with `start_state`. Readings are at `time_s` [s], states are kept at
    `keep_states_at_s` [s]; both increase, within the conditions. Displacements are zero where the body has
    `reference_degc` everywhere. `step_s` is the longest internal step [s]; the exact stepper needs steps only where
    heat depends on temperature, and is taken by "auto" where the eigenmodes of all film coefficients cost little.

    Raises InputError if a time is outside the conditions.
    """
    start = np.array(start_state, dtype=np.float64) if start_degc is None else start_degc * system.uniform
    read, keep = _times(time_s, conditions, "time_s"), _times(keep_states_at_s, conditions, "keep_states_at_s")
    weights = system.capacity @ system.uniform
    datum = float(weights @ start / (weights @ system.uniform))
    body = _Body(system, laws, datum)
    starts, intervals = _intervals(laws, conditions, datum)
    chosen = _method(body, intervals) if method == "auto" else method
    stepper = _ExactStepper(body, step_s) if chosen == "exact" else _ImplicitStepper(body, step_s)

    rise = start - datum * system.uniform
    readings, states = np.empty((len(read), len(body.rows))), np.empty((len(keep), system.size))
    heat_j, film_j = np.zeros(len(laws.heat)), np.zeros(len(laws.films))
    first_read, first_keep = (
        int(np.searchsorted(read, starts[0], "right")),
        int(np.searchsorted(keep, starts[0], "right")),
    )
    readings[:first_read], states[:first_keep] = body.rows @ rise, rise
    areas = body.film_loads.T @ system.uniform
    ends = starts + np.array([held.duration_s for held in intervals])
    to_reads, to_keeps = (np.searchsorted(asked, ends, "right") for asked in (read, keep))
    to_reads[-1], to_keeps[-1] = len(read), len(keep)
    for begin, held, to_read, to_keep in zip(starts, intervals, to_reads.tolist(), to_keeps.tolist(), strict=True):
        done = stepper.advance(rise, held, read[first_read:to_read] - begin, keep[first_keep:to_keep] - begin)
        readings[first_read:to_read], states[first_keep:to_keep] = done.read, done.kept
        heat_j += done.heat_j
        film_j += held.film_w_per_m2_k * (done.film_k_m2_s - held.fluid_rise * areas * held.duration_s)
        rise, first_read, first_keep = done.rise, to_read, to_keep

    n_probes, n_displacements = len(system.probes), len(system.displacements)
    uniform = body.rows @ system.uniform
    offset = np.r_[np.full(n_probes, datum), np.full(n_displacements, datum - reference_degc)]
    shown = readings + offset * uniform
    stored = float(weights @ (rise - (start - datum * system.uniform)))
    return HeatHistory(
        time_s=read,
        probes=tuple(system.probes),
        probe_degc=shown[:, :n_probes],
        displacements=tuple(system.displacements),
        displacement_um=shown[:, n_probes:],
        states=states + datum * system.uniform,
        end_state=rise + datum * system.uniform,
        balance=EnergyBalance(
            stored,
            heat_system.summed([law.source for law in laws.heat], heat_j),
            heat_system.summed([law.film for law in laws.films], film_j),
        ),
        method=chosen,
    )


def _intervals(
    laws: heat_system.Laws, conditions: heat_system.Conditions, datum_degc: float
) -> tuple[Vector, list[_Interval]]:
    """Starts [s] and held values of the stretches in which nothing changes; equal neighbours are one."""
    films, fluids = heat_system.film_coefficients(laws, conditions), heat_system.fluid_degc(laws, conditions)
    firm, lubricant = heat_system.heat_parts(laws, conditions)
    table = np.hstack([films, fluids, firm, lubricant])[:-1]
    first = np.flatnonzero(np.r_[True, (table[1:] != table[:-1]).any(axis=1)])
    starts = conditions.time_s[first]
    lengths = np.diff(np.r_[starts, conditions.time_s[-1]])
    return starts, [
        _Interval(float(length), films[k], fluids[k] - datum_degc, firm[k], lubricant[k])
        for k, length in zip(first, lengths, strict=True)
    ]


def _method(body: _Body, intervals: Sequence[_Interval]) -> Literal["exact", "implicit"]:
    """The exact stepper, unless the body is large or its films take so many values that eigenmodes cost seconds."""
    size = body.system.size
    if sparse.issparse(body.system.capacity) and size > _EXACT_STATES:
        return "implicit"
    sets = len({held.film_w_per_m2_k.tobytes() for held in intervals})
    return "exact" if sets * (2e-4 + 4e-9 * size**3) <= _EIGEN_SECONDS or sets == 1 else "implicit"


def _times(asked: ArrayLike, conditions: heat_system.Conditions, name: str) -> Vector:
    times = np.array(asked, dtype=np.float64)
    begin, end = float(conditions.time_s[0]), float(conditions.time_s[-1])
    if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) < 0).any():
        raise InputError(
            f"{name} that is missing or runs backwards", expected="times that increase", where="simulation",
            advice="sort the times",
        )  # fmt: skip
    # sums of steps miss the end by rounding
    slack = 1e-9 * (end - begin)
    if len(times) and (times[0] < begin - slack or times[-1] > end + slack):
        wrong = times[0] if times[0] < begin - slack else times[-1]
        raise InputError(
            f"{name} reaches {wrong:g} s",
            expected=f"times within the conditions, {begin:g} to {end:g} s",
            where="simulation",
            advice="let the conditions last as long as the simulation",
        )
    return np.clip(times, begin, end)


# how a body warms from instant to instant: exactly by eigenmodes, or by an implicit method of second order


@dataclass(frozen=True)
class _Body:
    """A heat system with its laws, as the arrays that steppers work on."""

    #: system and laws: What is stepped
    system: heat_system.HeatSystem
    laws: heat_system.Laws
    datum_degc: float  #: Temperature [°C] that rises are counted from

    def __post_init__(self) -> None:
        system = self.system
        matrices = {"capacity": system.capacity, "conduction": system.conduction, **system.films}
        for name, matrix in matrices.items():
            if _largest(matrix - matrix.T) > 1e-9 * _largest(matrix):
                raise ValueError(f"the matrix {name!r} is not symmetric: heat would be made or lost on its way")

    @cached_property
    def rows(self) -> Array:
        """Probes, then displacements, shape (n_rows, n)."""
        return self._table([*self.system.probes.values(), *self.system.displacements.values()])

    @cached_property
    def soft(self) -> NDArray[np.intp]:
        """Positions of the heat laws whose heat depends on temperature, shape (n_soft,)."""
        laws = self.laws.heat
        return np.array(
            [k for k, law in enumerate(laws) if law.softening_per_k > 0 and law.speed_w != 0], dtype=np.intp
        )

    @cached_property
    def lubricants(self) -> heat_system.Lubricants:
        """What the soft laws' heat follows."""
        laws = [self.laws.heat[k] for k in self.soft]
        at = self._table([self.system.probes[law.at] for law in laws])
        zero = np.array([law.softening_degc for law in laws], dtype=np.float64)
        return heat_system.Lubricants(
            rows=at,
            per_k=np.array([law.softening_per_k for law in laws], dtype=np.float64),
            zero_rise=zero - at @ self.system.uniform * self.datum_degc,
        )

    @cached_property
    def heat_loads(self) -> Array:
        """Share of every state in the heat of a law, shape (n, n_heat_laws)."""
        return self._table([self.system.sources[law.source] for law in self.laws.heat]).T

    @cached_property
    def film_loads(self) -> Array:
        """a_f of the surface of every film law, shape (n, n_film_laws)."""
        return self._table([self.system.film_loads[law.film] for law in self.laws.films]).T

    @cached_property
    def film_rows(self) -> Array:
        """uniformᵀ·A_f of the surface of every film law: what integrates a temperature over it."""
        return self._table([np.asarray(self.system.films[law.film].T @ self.system.uniform) for law in self.laws.films])

    def _table(self, rows: list[Vector]) -> Array:
        return np.array(rows, dtype=np.float64).reshape(len(rows), self.system.size)

    def steady_heat_w(self, held: _Interval) -> Vector:
        """Heat of every law [W] without that which depends on temperature."""
        heat = held.firm_w + held.lubricant_w
        if len(self.soft):
            heat[self.soft] = held.firm_w[self.soft]
        return heat

    def conductance(self, held: _Interval) -> heat_system.SystemMatrix:
        """K + Σ h_f·A_f [W/K] with the film coefficients of an interval."""
        films = [law.film for law in self.laws.films]
        return heat_system.conductance(self.system, heat_system.summed(films, held.film_w_per_m2_k))


@dataclass(frozen=True)
class _Interval:
    """A stretch of time in which nothing changes that the machine does."""

    duration_s: float  #: Its length [s]
    #: film_w_per_m2_k and fluid_rise: (n_film_laws,): Film coefficients [W/(m²·K)]; fluid temperatures over the datum
    #: [K]
    film_w_per_m2_k: Vector
    fluid_rise: Vector
    #: firm_w and lubricant_w: (n_heat_laws,): Heat [W] that does not depend on temperature; heat of the lubricant at
    #: its reference temperature
    firm_w: Vector
    lubricant_w: Vector


@dataclass(frozen=True)
class _Advance:
    """What became of a body in one interval."""

    rise: Vector  #: (n,): States at its end
    read: Array  #: (n_read, n_rows): `_Body.rows` times the states, at the times asked for
    kept: Array  #: (n_kept, n): States at the times asked for
    film_k_m2_s: Vector  #: (n_film_laws,): ∫ uniformᵀ·A_f·r dt over the interval, in the sense of the stepper
    heat_j: Vector  #: (n_heat_laws,): Heat put in by every law [J], in the same sense


def _largest(matrix: Any) -> float:
    """Largest entry without its sign."""
    entries: Array = matrix.data if sparse.issparse(matrix) else matrix  # type: ignore[attr-defined]
    return float(np.max(np.abs(entries), initial=0.0))


def _by_step(times_s: Vector, ends_s: Vector) -> list[Vector]:
    """Increasing times by the step that they are in; what rounding puts behind the last end is in the last step."""
    if len(ends_s) == 1:
        return [times_s]
    return np.split(times_s, np.searchsorted(times_s, ends_s[:-1], "right"))


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


class _ExactStepper:
    """Exact in held intervals; steps of `step_s` [s] only where heat depends on temperature."""

    def __init__(self, body: _Body, step_s: float) -> None:
        self._body = body
        self._step_s = step_s
        self._capacity = heat_system.dense(body.system.capacity)
        self._modal: OrderedDict[bytes, _Modal] = OrderedDict()
        self._room = max(2, int(_CACHE_BYTES / (16 * body.system.size**2)))

    def advance(self, rise: Vector, held: _Interval, read_s: Vector, keep_s: Vector) -> _Advance:
        """From the start of an interval to its end; `read_s`, `keep_s` [s] count from its start and increase."""
        modal = self._modal_of(held)
        z = modal.to_modal @ rise
        fluid = modal.film_loads @ (held.film_w_per_m2_k * held.fluid_rise)
        steady = self._body.steady_heat_w(held)
        steady_load = fluid + modal.heat_loads @ steady
        nominal = held.lubricant_w[self._body.soft]
        if nominal.any():
            return self._in_steps(modal, z, held, steady, steady_load, nominal, read_s, keep_s)
        step = held.duration_s
        ahead, area = modal.factors(step).step(z, steady_load)
        if len(read_s) == 1 and read_s[0] == step:
            read = (modal.rows @ ahead)[None]
        else:
            read = _at(modal.rate, z, steady_load, None, read_s, modal.rows)
        kept = _at(modal.rate, z, steady_load, None, keep_s, modal.shapes)
        # 0.0 + x: no sum is a negative zero, whatever the number of steps
        return _Advance(modal.shapes @ ahead, read, kept, modal.film_rows @ (0.0 + area), step * steady)

    def _in_steps(
        self,
        modal: _Modal,
        z: Vector,
        held: _Interval,
        steady: Vector,
        steady_load: Vector,
        nominal: Vector,
        read_s: Vector,
        keep_s: Vector,
    ) -> _Advance:
        """The same where heat depends on temperature: `nominal` is that of the lubricants, `steady` all the other."""
        lubricants, soft = self._body.lubricants, self._body.soft
        steps = max(1, int(np.ceil(held.duration_s / self._step_s * (1 - 1e-12))))
        ends = held.duration_s * np.arange(1, steps + 1) / steps
        reads, keeps = _by_step(read_s, ends), _by_step(keep_s, ends)
        step = held.duration_s / steps
        factors = modal.factors(step)
        soft_loads = modal.heat_loads[:, soft]
        per_watt = (factors.slope_end / step)[:, None] * soft_loads
        lubricant_per_watt = modal.lubricants @ per_watt
        integral, heat = np.zeros(len(z)), held.duration_s * steady
        read, kept = [np.zeros((0, len(modal.rows)))], [np.zeros((0, len(z)))]
        for k in range(steps):
            before = lubricants.heat_w(nominal, modal.lubricants @ z)
            load = steady_load + soft_loads @ before
            ahead, area = factors.step(z, load)
            without = modal.lubricants @ ahead - lubricant_per_watt @ before
            after = lubricants.settled_heat_w(nominal, without, lubricant_per_watt)
            slope = soft_loads @ ((after - before) / step)
            ahead, area = ahead + factors.slope_end * slope, area + factors.slope_area * slope
            heat[soft] += 0.5 * step * (before + after)
            if len(reads[k]):
                at = reads[k] - step * k
                at_end = len(at) == 1 and at[0] == step
                read.append((modal.rows @ ahead)[None] if at_end else _at(modal.rate, z, load, slope, at, modal.rows))
            if len(keeps[k]):
                kept.append(_at(modal.rate, z, load, slope, keeps[k] - step * k, modal.shapes))
            integral += area
            z = ahead
        return _Advance(modal.shapes @ z, np.concatenate(read), np.concatenate(kept), modal.film_rows @ integral, heat)

    def _modal_of(self, held: _Interval) -> _Modal:
        key = held.film_w_per_m2_k.tobytes()
        if key in self._modal:
            self._modal.move_to_end(key)
            return self._modal[key]
        body = self._body
        rate, shapes = linalg.eigh(heat_system.dense(body.conductance(held)), self._capacity)
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
        phi1, phi2, phi3 = _phi_functions(x)
        self._decay, self._load = np.exp(-x), step_s * phi1
        self.slope_end, self.slope_area = step_s**2 * phi2, step_s**3 * phi3

    def step(self, z: Vector, load: Vector) -> tuple[Vector, Vector]:
        """State after the step, and its integral over it, with a held load."""
        return self._decay * z + self._load * load, self._load * z + self.slope_end * load


def _phi_functions(x: Vector) -> tuple[Vector, Vector, Vector]:
    """φ1, φ2, φ3 of −x for x ≥ 0: (1 − e^(−x))/x, (1 − φ1)/x, (1/2 − φ2)/x, accurate down to x = 0."""
    x = np.asarray(x, dtype=np.float64)
    low, high = np.minimum(x, 1.0), np.maximum(x, 1.0)
    phi1 = -np.expm1(-high) / high
    phi2 = (1.0 - phi1) / high
    phi3 = (0.5 - phi2) / high
    # near 0 the differences cancel; the last coefficient is 1/20!, below rounding
    small = np.full(low.shape, _PHI3[-1])
    for coefficient in _PHI3[-2::-1].tolist():
        small *= low
        small += coefficient
    small2 = 0.5 - low * small
    small1 = 1.0 - low * small2
    return np.where(x < 1, small1, phi1), np.where(x < 1, small2, phi2), np.where(x < 1, small, phi3)


_PHI3 = np.cumprod(np.r_[1.0 / 6.0, -1.0 / np.arange(4, 21)])


def _at(rate: Vector, z: Vector, load: Vector, slope: Vector | None, at_s: Vector, rows: Array) -> Array:
    """Rows times the states at times within a step, shape (n_times, n_rows)."""
    found = np.empty((len(at_s), len(rows)))
    for first in range(0, len(at_s), _CHUNK):
        t = at_s[first : first + _CHUNK, None]
        phi1, phi2, _ = _phi_functions(rate * t)
        states = np.exp(-rate * t) * z + t * phi1 * load
        if slope is not None:
            states += t**2 * phi2 * slope
        found[first : first + _CHUNK] = states @ rows.T
    return found


_GAMMA = 1.0 - np.sqrt(0.5)

#: Memory for factorisations. One of 20 000 finite-element nodes takes some 200 MB; at least two are kept.
_IMPLICIT_CACHE_BYTES = 1e9
_MOST = 64


class _ImplicitStepper:
    """Equal steps of at most `step_s` [s] in every interval."""

    def __init__(self, body: _Body, step_s: float) -> None:
        self._body = body
        self._step_s = step_s
        self._solvers: OrderedDict[tuple[float, bytes], tuple[heat_system.Solve, Array]] = OrderedDict()
        self._room = 2

    def advance(self, rise: Vector, held: _Interval, read_s: Vector, keep_s: Vector) -> _Advance:
        """See `_ExactStepper.advance`; between steps the parabola through start, first stage and end is read."""
        body, capacity = self._body, self._body.system.capacity
        steps = max(1, int(np.ceil(held.duration_s / self._step_s * (1 - 1e-12))))
        # steps that differ by rounding share a factorisation
        step = float(f"{held.duration_s / steps:.13g}")
        ends = np.asarray(step * np.arange(1, steps + 1), dtype=np.float64)
        reads, keeps = _by_step(read_s, ends), _by_step(keep_s, ends)
        solve, per_watt = self._solver(held, step)
        lubricants, soft = body.lubricants, body.soft
        lubricant_per_watt = lubricants.rows @ per_watt
        nominal = held.lubricant_w[soft]
        depends = bool(np.any(nominal))
        steady = body.steady_heat_w(held)
        load = _GAMMA * step * (body.film_loads @ (held.film_w_per_m2_k * held.fluid_rise) + body.heat_loads @ steady)
        film, heat = np.zeros(len(body.film_rows)), step * steps * steady
        read, kept = [np.zeros((0, len(body.rows)))], [np.zeros((0, len(rise)))]
        stored = capacity @ rise

        def stage(right: Vector, weight: float) -> Vector:
            state = solve(right)
            if depends:
                given = lubricants.settled_heat_w(nominal, lubricants.rows @ state, lubricant_per_watt)
                heat[soft] += weight * step * given
                state = state + per_watt @ given
            return state

        for k in range(steps):
            inner = stage(stored + load, 1.0 - _GAMMA)
            gained = capacity @ inner - stored
            ahead = stage(stored + (1.0 - _GAMMA) / _GAMMA * gained + load, _GAMMA)
            if len(reads[k]):
                at = (reads[k] - step * k) / step
                read.append(_parabola(at) @ (np.array([rise, inner, ahead]) @ body.rows.T))
            if len(keeps[k]):
                kept.append(_parabola((keeps[k] - step * k) / step) @ np.array([rise, inner, ahead]))
            film += body.film_rows @ (step * ((1.0 - _GAMMA) * inner + _GAMMA * ahead))
            rise, stored = ahead, capacity @ ahead
        return _Advance(rise, np.concatenate(read), np.concatenate(kept), film, heat)

    def _solver(self, held: _Interval, step: float) -> tuple[heat_system.Solve, Array]:
        """Solver of a stage, and the rise that 1 W of every lubricant adds to the stage's state."""
        key = (step, held.film_w_per_m2_k.tobytes())
        if key in self._solvers:
            self._solvers.move_to_end(key)
            return self._solvers[key]
        # room is made before the next one is built
        while len(self._solvers) >= self._room:
            self._solvers.popitem(last=False)
        solver = heat_system.solver_of(self._body.system.capacity + _GAMMA * step * self._body.conductance(held))
        self._room = int(np.clip(_IMPLICIT_CACHE_BYTES // solver.n_bytes, 2, _MOST))
        loads = _GAMMA * step * self._body.heat_loads[:, self._body.soft]
        per_watt = np.array([solver.solve(column) for column in loads.T]).reshape(loads.T.shape).T
        self._solvers[key] = solver.solve, per_watt
        return self._solvers[key]


def _parabola(at: Vector) -> Array:
    """Weights of the values at 0, γ and 1 at places between, shape (n_at, 3)."""
    return np.column_stack(
        [
            (at - _GAMMA) * (at - 1.0) / _GAMMA,
            at * (at - 1.0) / (_GAMMA * (_GAMMA - 1.0)),
            at * (at - _GAMMA) / (1.0 - _GAMMA),
        ]
    )
