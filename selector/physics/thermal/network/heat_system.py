"""A machine as heat conduction in matrices, and the laws by which it is heated and cooled: networks, reduction."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from scipy import linalg, sparse

from selector.errors import InputError
from selector.physics.checks import keep_arrays
from selector.types import Array, Matrix, Vector


@dataclass(frozen=True)
class Conditions:
    """What is done to the machine: values at `time_s`, each held until the next time (C: stepwise load).

    What is given as one number stays the same for all times.
    """

    time_s: Vector  #: (n_samples,): Increasing [s]; the last is the end
    #: spindle_speed, torque, ambient_degc, coolant_on, coolant_degc and machine_on: (n_samples,): [r/min], [N·m], [°C],
    #: 0 or 1, [°C], 0 or 1
    spindle_speed: Vector = field(default_factory=lambda: np.array(0.0))
    torque: Vector = field(default_factory=lambda: np.array(0.0))
    ambient_degc: Vector = field(default_factory=lambda: np.array(20.0))
    coolant_on: Vector = field(default_factory=lambda: np.array(0.0))
    coolant_degc: Vector = field(default_factory=lambda: np.array(20.0))
    machine_on: Vector = field(default_factory=lambda: np.array(1.0))

    def __post_init__(self) -> None:
        for name, given in vars(self).items():
            object.__setattr__(self, name, np.broadcast_to(given, np.shape(self.time_s)))
        keep_arrays(self, *vars(self))


@dataclass(frozen=True)
class HeatLaw:
    """Heat of a source [W]; several laws of one source add up.

    q = on_w·on + turning_w·[n > 0] + coolant_w·coolant + speed_w·(n / reference_rpm)^exponent·s
        + torque_share·M·2πn/60,   s = exp(−softening_per_k·(T_at − softening_degc))

    The factor s is the lubricant that grows thinner as it warms; `at` names the probe whose temperature T_at it has.
    """

    source: str
    on_w: float = 0.0
    turning_w: float = 0.0
    coolant_w: float = 0.0
    speed_w: float = 0.0
    reference_rpm: float = 1000.0
    exponent: float = 1.0
    torque_share: float = 0.0
    softening_per_k: float = 0.0
    softening_degc: float = 20.0
    at: str = ""


@dataclass(frozen=True)
class FilmLaw:
    """Film coefficient of a surface [W/(m²·K)] and the fluid that it meets; several laws of one surface add up.

    h = still_w_per_m2_k + speed_w_per_m2_k·(n / reference_rpm)^exponent, times the coolant's state if `while_coolant`.
    `fluid` is ``"ambient"``, ``"coolant"`` or ``"fixed"`` (then `fixed_degc`).
    """

    film: str
    still_w_per_m2_k: float
    speed_w_per_m2_k: float = 0.0
    reference_rpm: float = 1000.0
    exponent: float = 1.0
    while_coolant: bool = False
    fluid: str = "ambient"
    fixed_degc: float = 20.0


@dataclass(frozen=True)
class Laws:
    """The laws of all sources and films of a machine; a source or film without a law gives no heat."""

    heat: tuple[HeatLaw, ...]
    films: tuple[FilmLaw, ...]


def summed(names: Iterable[str], amounts: Iterable[float]) -> dict[str, float]:
    """Name → sum of the amounts of all laws that have it."""
    total: dict[str, float] = {}
    for name, amount in zip(names, amounts, strict=True):
        total[name] = total.get(name, 0.0) + float(amount)
    return total


def film_coefficients(laws: Laws, conditions: Conditions) -> Matrix:
    """Film coefficients [W/(m²·K)], shape (n_samples, n_film_laws), in the order of `laws.films`."""
    columns = [
        (law.still_w_per_m2_k + law.speed_w_per_m2_k * _power_of_speed(conditions, law))
        * (conditions.coolant_on if law.while_coolant else 1.0)
        for law in laws.films
    ]
    return _table(columns, len(conditions.time_s))


def fluid_degc(laws: Laws, conditions: Conditions) -> Matrix:
    """Temperatures [°C] of the fluids, shape (n_samples, n_film_laws), in the order of `laws.films`."""
    fluids = {"ambient": conditions.ambient_degc, "coolant": conditions.coolant_degc}
    columns = [fluids.get(law.fluid, np.full(len(conditions.time_s), law.fixed_degc)) for law in laws.films]
    return _table(columns, len(conditions.time_s))


def heat_parts(laws: Laws, conditions: Conditions) -> tuple[Matrix, Matrix]:
    """Heat [W] that does not depend on temperature, and the lubricant's at its reference temperature.

    Both of shape (n_samples, n_heat_laws), in the order of `laws.heat`.
    """
    turns_per_s = np.abs(conditions.spindle_speed) / 60.0
    firm = [
        law.on_w * conditions.machine_on
        + law.turning_w * (turns_per_s > 0)
        + law.coolant_w * conditions.coolant_on
        + law.torque_share * np.abs(conditions.torque) * 2.0 * np.pi * turns_per_s
        for law in laws.heat
    ]
    lubricant = [law.speed_w * _power_of_speed(conditions, law) for law in laws.heat]
    return _table(firm, len(turns_per_s)), _table(lubricant, len(turns_per_s))


def _power_of_speed(conditions: Conditions, law: HeatLaw | FilmLaw) -> Vector:
    """(n / reference)^exponent, 0 at standstill whatever the exponent."""
    speed = np.abs(conditions.spindle_speed)
    return np.where(speed > 0, (speed / law.reference_rpm) ** law.exponent, 0.0)


def _table(columns: list[Vector], rows: int) -> Matrix:
    return np.column_stack(columns) if columns else np.zeros((rows, 0))


@dataclass(frozen=True)
class Lubricants:
    """Where the lubricants of some sources are, and how they soften."""

    rows: Array  #: (n_soft, n): Row times state = temperature of the lubricant
    per_k: Vector  #: (n_soft,): Softening [1/K]
    zero_rise: Vector  #: (n_soft,): Rise [K] at which a lubricant makes its nominal heat

    def heat_w(self, nominal_w: Vector, rise: Vector) -> Vector:
        """Heat [W] of the lubricants at these rises [K]."""
        return np.asarray(nominal_w * np.exp(-self.per_k * (rise - self.zero_rise)))

    def settled_heat_w(self, nominal_w: Vector, without: Vector, per_watt: Array) -> Vector:
        """Heat q [W] that agrees with the rises without + per_watt·q [K] that it brings about itself.

        Newton's method on the rises, its step halved until the disagreement shrinks. One lubricant alone is reached
        from the cold side without overshooting, because heat falls convexly with temperature.

        Raises InputError if it finds no agreement.
        """
        rise = without
        heat = self.heat_w(nominal_w, rise)
        gap = without + per_watt @ heat - rise
        own, size = np.eye(len(rise)), math.sqrt(gap @ gap)
        with np.errstate(over="ignore", invalid="ignore"):
            for _ in range(200):
                change = np.linalg.solve(own + per_watt * (self.per_k * heat), gap)
                before, share = size, 1.0
                while share > 1e-9:
                    ahead = rise + share * change
                    heat = self.heat_w(nominal_w, ahead)
                    gap = without + per_watt @ heat - ahead
                    size = math.sqrt(gap @ gap)
                    # once rounding is all that is left, it need not shrink
                    if size <= max(before, 1e-12 * (1.0 + float(np.abs(ahead).max()))):
                        break
                    share *= 0.5
                rise = ahead
                # far below what a sensor tells; the error of the heat is the square of the last change
                if share == 1.0 and np.abs(change).max() <= 1e-7 * (1.0 + np.abs(rise).max()):
                    return heat
        raise InputError(
            "lubricants whose heat and temperature do not settle",
            expected="heat that falls as a lubricant warms",
            where="simulation",
            advice="check softening_per_k, softening_degc and the heat of the sources",
        )


#: Dense for small systems (networks, reduced models), sparse for finite elements.
SystemMatrix = Array | sparse.csr_array


@dataclass(frozen=True)
class HeatSystem:
    """C·dT/dt = −K·T − Σ_f h_f·(A_f·T − θ_f·a_f) + Σ_s q_s·b_s, with readings and displacements linear in T.

    h_f [W/(m²·K)] and θ_f [°C] are the film coefficient and the fluid temperature of surface f; q_s [W] is the heat of
    source s. They change with time and belong to the laws of the machine (`laws`), not to this value.
    """

    capacity: SystemMatrix  #: (n, n): C [J/K]
    conduction: SystemMatrix  #: (n, n): K [W/K], symmetric; its rows sum to zero
    films: Mapping[str, SystemMatrix]  #: (n, n): A_f [m²] of every surface that meets a fluid
    film_loads: Mapping[str, Vector]  #: (n,): a_f = A_f·1 [m²]
    sources: Mapping[str, Vector]  #: (n,): b_s, the share of every state in the heat of the source
    probes: Mapping[str, Vector]  #: (n,): Row p: the temperature [°C] at the probe is p·T
    displacements: Mapping[str, Vector]  #: (n,): Row d [µm/K]: the displacement [µm] is d·(T − T_reference·uniform)
    uniform: Vector  #: (n,): States of a body at 1 °C everywhere (ones, unless the system was reduced)
    #: Names of the states where they have names (the nodes of a network), else empty
    states: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        for name in ("films", "film_loads", "sources", "probes", "displacements"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    @property
    def size(self) -> int:
        """Number of states."""
        return int(self.capacity.shape[0])


def joined(body: HeatSystem, parts: HeatSystem, contacts: Sequence[tuple[str, str, float]]) -> HeatSystem:
    """One system of both: first the states of `body`, then those of `parts`; sparse.

    A contact is (surface of `body`, node of `parts`, conductance G [W/K]); the surface is called as the heat source
    that acts on it. Every point of it conducts to the node: K gains G·diag(b), −G·b and G, where b is the source's
    share at the states (never negative). A film or a displacement that both have is the sum of both; sources and probes
    have names of their own.
    """
    n, m = body.size, parts.size
    diagonal, between, ends = np.zeros(n), np.zeros((n, m)), np.zeros(m)
    for source, name, conductance in contacts:
        share, node = body.sources[source], parts.states.index(name)
        diagonal += conductance * share
        between[:, node] -= conductance * share
        ends[node] += conductance * share.sum()
    link = sparse.csr_array(between)
    joints = sparse.block_array(
        [[sparse.diags_array(diagonal), link], [link.T, sparse.diags_array(ends)]], format="csr"
    )
    empty, bare = sparse.csr_array((n, n)), sparse.csr_array((m, m))

    def rows(one: Mapping[str, Vector], other: Mapping[str, Vector]) -> dict[str, Vector]:
        names = dict.fromkeys([*one, *other])
        return {name: np.r_[one.get(name, np.zeros(n)), other.get(name, np.zeros(m))] for name in names}

    films = {name: (body.films.get(name, empty), parts.films.get(name, bare)) for name in {**body.films, **parts.films}}
    return HeatSystem(
        capacity=_beside(body.capacity, parts.capacity),
        conduction=_beside(body.conduction, parts.conduction) + joints,
        films={name: _beside(*both) for name, both in films.items()},
        film_loads=rows(body.film_loads, parts.film_loads),
        sources=rows(body.sources, parts.sources),
        probes=rows(body.probes, parts.probes),
        displacements=rows(body.displacements, parts.displacements),
        uniform=np.r_[body.uniform, parts.uniform],
    )


def _beside(one: SystemMatrix, other: SystemMatrix) -> sparse.csr_array:
    return sparse.csr_array(sparse.block_diag([one, other]))


def time_constants_s(system: HeatSystem, film_w_per_m2_k: Mapping[str, float]) -> Vector:
    """Time constants [s] at given film coefficients, longest first; infinite for a part that no fluid reaches.

    All n of the dense symmetric problem (K + Σ h_f·A_f)·v = λ·C·v, 1/λ: meant for networks and reduced systems, up to
    some thousand states. A film that is not named has none.
    """
    rate = linalg.eigh(dense(conductance(system, film_w_per_m2_k)), dense(system.capacity))[0]
    # what rounding leaves of a rate of zero, relative to the fastest
    rate[rate < 4 * np.finfo(float).eps * len(rate) * rate[-1]] = 0.0
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / rate)


def conductance(system: HeatSystem, film_w_per_m2_k: Mapping[str, float], tau_s: float | None = None) -> SystemMatrix:
    """K + Σ h_f·A_f [W/K], with `tau_s` [s] C/τ besides; dense or sparse as the system is."""
    total = system.conduction if tau_s is None else system.conduction + system.capacity * (1.0 / tau_s)
    for name, value in film_w_per_m2_k.items():
        if value != 0.0:
            total = total + value * system.films[name]
    return total


def dense(matrix: SystemMatrix) -> Matrix:
    """The same matrix as an array."""
    return matrix.toarray() if sparse.issparse(matrix) else np.asarray(matrix, dtype=np.float64)


Solve = Callable[[Vector], Vector]


@dataclass(frozen=True)
class Solver:
    """A factorised system of equations."""

    solve: Solve  #: Right-hand side → solution
    n_bytes: int  #: Memory that the factors take


def solver_of(matrix: SystemMatrix) -> Solver:
    """Solver of a symmetric, positive definite system of equations, dense or sparse."""
    if sparse.issparse(matrix):
        from scipy.sparse.linalg import splu

        options = {"SymmetricMode": True}
        lu = splu(sparse.csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        return Solver(lu.solve, 12 * int(lu.nnz))
    factor = linalg.cho_factor(matrix)
    return Solver(lambda load: linalg.cho_solve(factor, load, check_finite=False), matrix.nbytes)


@dataclass(frozen=True)
class Network:
    """Bodies of even temperature, the nodes, with what links, wets and heats them, all by the names of the nodes."""

    heat_capacity_j_per_k: Mapping[str, float]  #: Node → mass times specific heat [J/K], above 0
    links: Sequence[tuple[str, str, float]] = ()  #: Two nodes, conductance between them [W/K]; those of the same add up
    #: Film → node → area with which it takes part in the film [m²]. For a convection that is known as W/K, write 1 m²
    #: and the value as the film coefficient of the law.
    area_m2: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    shares: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  #: Source → node → share of its heat
    #: Node → displacement → what 1 K of the node adds to it [µm/K]
    expansion_um_per_k: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def heat_system(self) -> HeatSystem:
        """The network as matrices: one state and one probe a node, named like it."""
        row = {name: k for k, name in enumerate(self.heat_capacity_j_per_k)}
        n = len(row)

        def column(values: Mapping[str, float]) -> Vector:
            return np.array([values.get(name, 0.0) for name in row], dtype=np.float64)

        conduction = np.zeros((n, n))
        for first, second, conductance in self.links:
            pair = np.array([row[first], row[second]])
            conduction[np.ix_(pair, pair)] += conductance * np.array([[1.0, -1.0], [-1.0, 1.0]])
        areas = {film: column(values) for film, values in self.area_m2.items()}
        moved = dict.fromkeys(name for values in self.expansion_um_per_k.values() for name in values)
        return HeatSystem(
            capacity=np.diag(column(self.heat_capacity_j_per_k)),
            conduction=conduction,
            films={film: np.diag(area) for film, area in areas.items()},
            film_loads=areas,
            sources={source: column(values) for source, values in self.shares.items()},
            probes={name: np.eye(n)[k] for name, k in row.items()},
            displacements={
                name: column({node: values.get(name, 0.0) for node, values in self.expansion_um_per_k.items()})
                for name in moved
            },
            uniform=np.ones(n),
            states=tuple(row),
        )


#: Reciprocal shifts of the moments: from the first warming of a bearing to the steady state of a bed.
TIME_SCALES_S = (20.0, 90.0, 400.0, 2000.0, 10000.0, np.inf)
TOLERANCE = 3e-4  #: Fields are left out that change none of the responses by more than this share of its norm.


def reduced_basis(
    system: HeatSystem,
    film_coefficients: Sequence[Mapping[str, float]],
    *,
    time_scales_s: Sequence[float] = TIME_SCALES_S,
    tolerance: float = TOLERANCE,
    max_states: int | None = None,
) -> Array:
    """Fields that span the responses to every input, shape (n, n_reduced), orthonormal in the heat capacity C.

    A block rational Krylov space of order one, see docs/explanation/thermal-reduction.md; the uniform field is the
    first and exact. One factorisation per set of film coefficients and time scale.

    `film_coefficients` are the sets [W/(m²·K)] that the machine works with, by film; a film that is not named has 0.
    `time_scales_s` are τ [s], infinite for the steady state. `tolerance` is the relative norm of what is left out.

    Raises InputError if a steady state is asked for where no film takes heat away.
    """
    if np.isinf(max(time_scales_s)) and not all(any(one.values()) for one in film_coefficients):
        raise InputError(
            "no film that takes heat away, but a steady state",
            expected="a film coefficient above 0 in every set",
            where="model reduction",
            advice="give a film a coefficient, or leave the infinite time scale out",
        )
    loads = np.column_stack([*system.sources.values(), *system.film_loads.values(), *system.displacements.values()])
    loads = loads[:, np.any(loads != 0, axis=0)]
    unit = system.uniform / np.sqrt(system.uniform @ (system.capacity @ system.uniform))
    blocks = []
    for coefficients in film_coefficients:
        for tau_s in time_scales_s:
            fields = factorised(system, coefficients, tau_s)(loads)
            rest = _without(fields, unit[:, None], system.capacity)
            norms = _norms(rest, system.capacity)
            uneven = norms > 1e-9 * _norms(fields, system.capacity)  # what is less is round-off of a uniform field
            blocks.append(rest[:, uneven] / norms[uneven])
    snapshots = np.hstack(blocks)
    if not snapshots.shape[1]:
        return unit[:, None]
    weights, directions = linalg.eigh(snapshots.T @ (system.capacity @ snapshots))
    room = system.size - 1 if max_states is None else min(system.size, max_states) - 1
    # below 1e-7 a singular value of the Gram matrix is round-off
    kept = np.flatnonzero(weights > max(tolerance, 1e-7) ** 2)[::-1][: max(room, 0)]
    fields = snapshots @ (directions[:, kept] / np.sqrt(weights[kept]))
    for _ in range(2):  # twice is enough for orthogonality to round-off
        fields = _without(fields, unit[:, None], system.capacity)
        factor = linalg.cholesky(fields.T @ (system.capacity @ fields), lower=False)
        fields = linalg.solve_triangular(factor, fields.T, trans="T").T
    return np.column_stack([unit, fields])


def projected(system: HeatSystem, basis: Array) -> HeatSystem:
    """The system for fields T = basis·x only (Galerkin): symmetric and passive like the system itself.

    `basis` has shape (n, n_reduced), is orthonormal in the heat capacity and contains the uniform field.
    """
    conduction = _congruent(system.conduction, basis)
    uniform = basis.T @ (system.capacity @ system.uniform)
    # no heat flows in a uniform field: round-off of the projection is taken out of the rows
    conduction -= np.outer(conduction @ uniform, uniform) / (uniform @ uniform)
    conduction -= np.outer(uniform, uniform @ conduction) / (uniform @ uniform)
    return HeatSystem(
        capacity=np.eye(basis.shape[1]),
        conduction=(conduction + conduction.T) / 2,
        films={name: _congruent(matrix, basis) for name, matrix in system.films.items()},
        film_loads={name: basis.T @ load for name, load in system.film_loads.items()},
        sources={name: basis.T @ share for name, share in system.sources.items()},
        probes={name: basis.T @ row for name, row in system.probes.items()},
        displacements={name: basis.T @ row for name, row in system.displacements.items()},
        uniform=uniform,
    )


def factorised(system: HeatSystem, coefficients: Mapping[str, float], tau_s: float) -> Callable[[Array], Array]:
    """Solves (C/τ + K + Σ h_f·A_f)·x = g for columns g; infinite τ: the steady state."""
    solver = solver_of(conductance(system, coefficients, tau_s))
    return lambda loads: np.asarray(solver.solve(np.ascontiguousarray(loads)))


def _norms(fields: Array, capacity: SystemMatrix) -> Array:
    return np.asarray(np.sqrt(np.einsum("ij,ij->j", fields, capacity @ fields)))


def _without(fields: Array, basis: Array, capacity: SystemMatrix) -> Array:
    """Fields less their parts in an orthonormal basis."""
    return fields - basis @ (basis.T @ (capacity @ fields))


def _congruent(matrix: SystemMatrix, basis: Array) -> Array:
    small = np.asarray(basis.T @ (matrix @ basis))
    return (small + small.T) / 2
