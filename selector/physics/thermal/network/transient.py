"""How the temperatures and displacements of a machine follow what it does."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from selector.errors import InputError
from selector.physics.thermal.network.heat_system import HeatSystem
from selector.physics.thermal.network.laws import Conditions, Laws, film_coefficients, fluid_degc, heat_parts, summed
from selector.physics.thermal.network.stepping import Body, ExactStepper, ImplicitStepper, Interval
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
    system: HeatSystem,
    laws: Laws,
    conditions: Conditions,
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
    body = Body(system, laws, datum)
    starts, intervals = _intervals(laws, conditions, datum)
    chosen = _method(body, intervals) if method == "auto" else method
    stepper = ExactStepper(body, step_s) if chosen == "exact" else ImplicitStepper(body, step_s)

    rise = start - datum * system.uniform
    readings, states = np.empty((len(read), len(body.rows))), np.empty((len(keep), system.size))
    heat_j, film_j = np.zeros(len(laws.heat)), np.zeros(len(laws.films))
    first_read, first_keep = (
        int(np.searchsorted(read, starts[0], "right")),
        int(np.searchsorted(keep, starts[0], "right")),
    )
    readings[:first_read], states[:first_keep] = body.rows @ rise, rise
    areas = body.film_loads.T @ system.uniform
    for begin, held in zip(starts, intervals, strict=True):
        last = held is intervals[-1]
        end = begin + held.duration_s
        to_read = len(read) if last else int(np.searchsorted(read, end, "right"))
        to_keep = len(keep) if last else int(np.searchsorted(keep, end, "right"))
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
            stored, summed([law.source for law in laws.heat], heat_j), summed([law.film for law in laws.films], film_j)
        ),
        method=chosen,
    )


def _intervals(laws: Laws, conditions: Conditions, datum_degc: float) -> tuple[Vector, list[Interval]]:
    """Starts [s] and held values of the stretches in which nothing changes; equal neighbours are one."""
    films, fluids = film_coefficients(laws, conditions), fluid_degc(laws, conditions)
    firm, lubricant = heat_parts(laws, conditions)
    table = np.hstack([films, fluids, firm, lubricant])[:-1]
    first = np.flatnonzero(np.r_[True, (table[1:] != table[:-1]).any(axis=1)])
    starts = conditions.time_s[first]
    lengths = np.diff(np.r_[starts, conditions.time_s[-1]])
    return starts, [
        Interval(float(length), films[k], fluids[k] - datum_degc, firm[k], lubricant[k])
        for k, length in zip(first, lengths, strict=True)
    ]


def _method(body: Body, intervals: Sequence[Interval]) -> Literal["exact", "implicit"]:
    """The exact stepper, unless the body is large or its films take so many values that eigenmodes cost seconds."""
    size = body.system.size
    if sparse.issparse(body.system.capacity) and size > _EXACT_STATES:
        return "implicit"
    sets = len({held.film_w_per_m2_k.tobytes() for held in intervals})
    return "exact" if sets * (2e-4 + 4e-9 * size**3) <= _EIGEN_SECONDS or sets == 1 else "implicit"


def _times(asked: ArrayLike, conditions: Conditions, name: str) -> Vector:
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
