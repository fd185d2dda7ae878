"""What vibrates: the sources that shake a structure, how the whole of it answers, and in which modes it rings."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg
from scipy.sparse.csgraph import connected_components

from selector.errors import InputError, Misfit
from selector.physics.checks import Above0, Checked, Finite, From0, keep_arrays
from selector.types import Array, Complex, Indices, Matrix, Vector


@dataclass(frozen=True)
class Line(Checked):
    """One line of a spectrum: amplitude·sin(ωt + phase)."""

    frequency_hz: Above0 | None = None  #: Where the frequency is fixed [Hz]
    order: Above0 | None = None  #: Where it follows a shaft: periods per revolution
    force_n: From0 = 0.0  #: Amplitude of the force, the same at every speed [N]
    #: Mass times eccentricity of what turns [kg·m]: a force of unbalance·ω² beside `force_n`
    unbalance_kg_m: From0 = 0.0
    phase_rad: Finite = 0.0  #: Phase against the other lines of its source [rad]

    def _misfits(self) -> Iterator[Misfit]:
        if (self.frequency_hz is None) == (self.order is None):
            found = "both frequency_hz and order" if self.order is not None else "neither frequency_hz nor order"
            advice = "give the frequency where it is fixed, the order where it follows a shaft"
            yield found, "one of them", "frequency_hz", advice
        if self.force_n == 0 and self.unbalance_kg_m == 0:
            expected, advice = "force_n or unbalance_kg_m above 0", "give its size, or leave the line out"
            yield "a line without force", expected, "force_n", advice


@dataclass(frozen=True)
class Source(Checked):
    """A source of vibration: it pushes a member, and with the same force the other way what it pushes against."""

    name: str  #: IK1 cutting, IK2 spindle unit, IK3 main motor, IK4 cross-feed motor, IK5 longitudinal-feed motor in V
    member: str  #: Member on which the force acts
    lines: tuple[Line, ...]  #: Its spectrum
    against: str | None = None  #: Member on which the opposite force acts; None: the ground
    shaft: str | None = None  #: Shaft whose speed the orders belong to

    def _misfits(self) -> Iterator[Misfit]:
        expected = "lines of a spectrum, a shaft for those that follow one, and two sides of the force"
        advice = f"correct the source {self.name!r}"
        if not self.lines:
            yield "no lines", expected, "lines", advice
        if self.shaft is None and any(line.order is not None for line in self.lines):
            yield "orders without a shaft", expected, "shaft", advice
        if self.against == self.member:
            yield f"{self.member!r} pushing against itself", expected, "against", advice


@dataclass(frozen=True, eq=False)
class Excitation:
    """The lines of all sources, one row a line; lines of different sources at one frequency stay apart.

    A force is Im(F·e^{iωt}): amplitude·sin(ωt + phase).
    """

    sources: tuple[str, ...]  #: Names of all sources, also of those without a row
    frequency_hz: Vector  #: (n_lines,): Above 0 [Hz]
    force_n: Complex  #: (n_lines,): F, what the source does to its member [N]
    #: source and line: (n_lines,): Position of the source, and of the line among the lines of its source
    source: Indices
    line: Indices
    #: order and shaft: Periods per revolution and the shaft that the line follows; None where the frequency is fixed
    order: tuple[float | None, ...]
    shaft: tuple[str | None, ...]

    def __post_init__(self) -> None:
        for values in (self.frequency_hz, self.force_n, self.source, self.line):
            values.setflags(write=False)

    def only(self, rows: Indices) -> "Excitation":
        """The excitation by these rows alone."""
        order, shaft = tuple(self.order[row] for row in rows), tuple(self.shaft[row] for row in rows)
        picked = self.frequency_hz[rows], self.force_n[rows], self.source[rows], self.line[rows]
        return Excitation(self.sources, *picked, order, shaft)


def excitation(sources: Sequence[Source], shaft_rpm: Mapping[str, float]) -> Excitation:
    """Lines of all sources while the shafts turn at constant speeds.

    A line that follows a shaft that stands still is a force that does not change: it has no row.

    `shaft_rpm` is shaft → speed [r/min], 0 or more, of every shaft that a source follows.
    """
    rows: list[tuple[int, int, Line, str | None, float]] = []
    for position, source in enumerate(sources):
        for number, line in enumerate(source.lines):
            if line.order is None:
                rows.append((position, number, line, None, line.frequency_hz or 0.0))
                continue
            speed = shaft_rpm[source.shaft or ""]
            if speed > 0:
                rows.append((position, number, line, source.shaft, line.order * speed / 60.0))
    frequency = np.array([row[4] for row in rows], dtype=np.float64)
    made = [line_force_n(row[2], frequency[place : place + 1])[0] for place, row in enumerate(rows)]
    force = np.array(made, dtype=np.complex128)
    return Excitation(
        sources=tuple(source.name for source in sources),
        frequency_hz=frequency,
        force_n=force,
        source=np.array([row[0] for row in rows], dtype=np.int64),
        line=np.array([row[1] for row in rows], dtype=np.int64),
        order=tuple(row[2].order for row in rows),
        shaft=tuple(row[3] for row in rows),
    )


def line_force_n(line: Line, frequency_hz: Vector) -> Complex:
    """F = (force + unbalance·ω²)·e^{i·phase} [N] of one line at frequencies of shape (n,)."""
    amplitude = line.force_n + line.unbalance_kg_m * (2.0 * np.pi * frequency_hz) ** 2
    return np.asarray(amplitude * np.exp(1j * line.phase_rad))


@dataclass(frozen=True, eq=False)
class ShaftCourse(Checked):
    """Speed of a shaft over time: straight between corners, level before the first and after the last.

    InputError: no corner, times that do not increase, or a speed that is missing or below 0.
    """

    #: time_s and rpm: (n_corners,): Corners: increasing times [s], and speeds of 0 or more [r/min]
    time_s: Vector
    rpm: Vector

    def __post_init__(self) -> None:
        keep_arrays(self, "time_s", "rpm")
        super().__post_init__()

    def _misfits(self) -> Iterator[Misfit]:
        time, rpm = self.time_s, self.rpm
        expected = "one speed a time, each time after the one before"
        advice = "give the corners in the order of their times; make a jump a short slope"
        if time.ndim != 1 or time.shape != rpm.shape or len(time) == 0:
            yield f"times of shape {time.shape} and speeds of shape {rpm.shape}", expected, "shaft_rpm", advice
        if not np.isfinite(time).all() or (np.diff(time) <= 0).any():
            yield "times that do not increase", expected, "shaft_rpm", advice
        if not (np.isfinite(rpm) & (rpm >= 0)).all():
            first = int(np.flatnonzero(~(np.isfinite(rpm) & (rpm >= 0)))[0])
            expected = "speeds of 0 or more; orders are the same in both directions"
            advice = "fill what is missing; split a run where the shaft turns back"
            yield f"{rpm[first]:g} r/min at {time[first]:g} s", expected, "shaft_rpm", advice

    @property
    def is_level(self) -> bool:
        """Whether the speed never changes."""
        return bool((self.rpm == self.rpm[0]).all())

    def rpm_at(self, time_s: ArrayLike) -> Vector:
        """Speed at these times [r/min], shape (n_times,)."""
        return np.asarray(np.interp(np.asarray(time_s, dtype=np.float64), self.time_s, self.rpm))

    def turns_at(self, time_s: ArrayLike) -> Vector:
        """Turns since time 0, the exact integral of the speed, shape (n_times,)."""
        time = np.asarray(time_s, dtype=np.float64)
        return self._turns(time) - self._turns(np.zeros(1))

    def range_rpm(self, from_s: float, to_s: float) -> tuple[float, float]:
        """Lowest and highest speed from one time to another [r/min]."""
        inside = self.rpm[(self.time_s > from_s) & (self.time_s < to_s)]
        speeds = np.concatenate((inside, self.rpm_at([from_s, to_s])))
        return float(speeds.min()), float(speeds.max())

    def _turns(self, time: Vector) -> Vector:
        """Turns since the first corner."""
        whole = np.concatenate(([0.0], np.cumsum(np.diff(self.time_s) * (self.rpm[1:] + self.rpm[:-1]) / 2.0)))
        corner = np.clip(np.searchsorted(self.time_s, time, side="right") - 1, 0, len(self.time_s) - 1)
        since = time - self.time_s[corner]
        return (whole[corner] + since * (self.rpm[corner] + self.rpm_at(time)) / 2.0) / 60.0


GROUND = "ground"  #: What does not move: the foundation.


@dataclass(frozen=True)
class Member(Checked):
    """A part of the machine that moves as one mass."""

    name: str
    mass_kg: Above0  #: m [kg]

    def _misfits(self) -> Iterator[Misfit]:
        if self.name == GROUND or not self.name:
            expected = f"another name: {GROUND!r} is what does not move"
            yield f"a member called {self.name!r}", expected, "name", "call the part what it is"


@dataclass(frozen=True)
class Joint(Checked):
    """Spring and damping between two members, or between a member and `GROUND`."""

    between: tuple[str, str]  #: Names of what it joins
    stiffness_n_per_m: Above0  #: j [N/m]
    #: ψ, energy lost in a cycle over the largest energy stored in it; 0: none
    dissipation: From0 = 0.0

    def _misfits(self) -> Iterator[Misfit]:
        if self.between[0] == self.between[1]:
            found, advice = f"a joint of {self.between[0]!r} with itself", "name the other side of the joint"
            yield found, "two different members", "between", advice

    @property
    def loss_factor(self) -> float:
        """η = ψ/2π."""
        return self.dissipation / (2.0 * math.pi)

    @property
    def complex_stiffness_n_per_m(self) -> complex:
        """j·(1 + iη) [N/m]."""
        return self.stiffness_n_per_m * complex(1.0, self.loss_factor)


@dataclass(frozen=True)
class Structure(Checked):
    """Members and the joints between them.

    InputError: a name stands twice, a joint names an unknown member, or a member has no way to the ground.
    """

    members: tuple[Member, ...]
    joints: tuple[Joint, ...]

    def _misfits(self) -> Iterator[Misfit]:
        names = self.names
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None or not names:
            found = f"two members called {twice!r}" if names else "no member"
            yield found, "members, each with its own name", "members", "name every part once"
        for number, joint in enumerate(self.joints):
            for name in joint.between:
                if name != GROUND and name not in names:
                    expected, where = f"one of {', '.join(names)}, or {GROUND}", f"joints[{number + 1}].between"
                    yield f"a joint with {name!r}", expected, where, "correct the name, or add the member"
        at = {name: place for place, name in enumerate((*names, GROUND))}
        linked = np.zeros((len(at), len(at)))
        for joint in self.joints:
            linked[at[joint.between[0]], at[joint.between[1]]] = 1.0
        _, group = connected_components(linked, directed=False)
        loose = [name for name in names if group[at[name]] != group[at[GROUND]]]
        if loose:
            advice = f'add the joint that is missing; what stands on the foundation is joined with "{GROUND}"'
            yield f"no way from {', '.join(loose)} to the ground", "joints that hold every member", "joints", advice

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the members."""
        return tuple(member.name for member in self.members)

    def position(self, name: str) -> int:
        """Place of a member among the members; ValueError where there is none."""
        return self.names.index(name)


NUMBERS_AT_ONCE = 2_000_000  #: Complex numbers of dynamic stiffness that are held at a time (32 MB).
#: An eigenvalue this near to ω², as a share, is an undamped resonance: it amplifies a thousand million times.
UNDAMPED = 1e-9
#: Share of the largest eigenvalue below which rounding decides what a smaller one is.
RESOLVED = 1e3 * np.finfo(float).eps


def masses_kg(structure: Structure) -> Vector:
    """Diagonal of M [kg], shape (n_members,), in the order of the members."""
    return np.array([member.mass_kg for member in structure.members], dtype=np.float64)


def stiffness_matrix(structure: Structure) -> Complex:
    """K [N/m], complex symmetric, shape (n_members, n_members): joints j·(1 + iη), in the order of the members."""
    ends, held = joint_ends(structure), [joint.complex_stiffness_n_per_m for joint in structure.joints]
    return np.asarray(ends.T @ (np.array(held)[:, None] * ends))


def joint_ends(structure: Structure) -> Matrix:
    """1 and −1 at the members that a joint holds, shape (n_joints, n_members); the ground has no column."""
    sides = [[one == name for name in structure.names] for joint in structure.joints for one in joint.between]
    ends = np.array(sides, dtype=np.float64)
    return ends[::2] - ends[1::2]


def scaled_stiffness_matrix(structure: Structure) -> Complex:
    """M^−½·K·M^−½ [1/s²]: its eigenvalues are those of the pencil (K, M)."""
    root = np.sqrt(masses_kg(structure))
    return np.asarray(stiffness_matrix(structure) / root / root[:, None])


def receptances(structure: Structure, frequency_hz: ArrayLike, force_n: ArrayLike) -> Complex:
    """Motions [m] in several cases of force at once, complex, shape (n_cases, n_freq, n_members).

    `force_n` has the shape (n_cases, n_members) and is the same at every frequency; at 0 Hz it is the static limit.

    InputError at a resonance that nothing damps.
    """
    frequency = np.asarray(frequency_hz, dtype=np.float64)
    force = np.asarray(force_n, dtype=np.complex128).T
    scaled, root = scaled_stiffness_matrix(structure), np.sqrt(masses_kg(structure))
    refuse_unresolved(structure, frequency)
    motion = np.empty((len(frequency), *force.shape), dtype=np.complex128)
    at_once = max(1, NUMBERS_AT_ONCE // (len(root) * (len(root) + force.shape[1])))
    diagonal = np.arange(len(root))
    for begin in range(0, len(frequency), at_once):
        part = frequency[begin : begin + at_once]
        dynamic = np.repeat(scaled[None], len(part), axis=0)
        dynamic[:, diagonal, diagonal] -= (2.0 * math.pi * part[:, None]) ** 2
        motion[begin : begin + at_once] = np.linalg.solve(dynamic, force / root[:, None]) / root[:, None]
    return np.ascontiguousarray(np.moveaxis(motion, 2, 0))


def receptance(
    structure: Structure, frequency_hz: ArrayLike, *, of: str, at: str, against: str | None = None
) -> Complex:
    """Motion of the member `of` per unit force on the member `at` [m/N], complex, shape (n_freq,).

    The opposite force acts on `against`, by default on the ground. Errors: as `receptances`, and for unknown members.
    """
    force = unit_force(structure, at, against)
    return receptances(structure, frequency_hz, force[None])[0][:, known_place(structure, of, "of")]


def unit_force(structure: Structure, at: str, against: str | None = None) -> Vector:
    """Forces on the members [N], shape (n_members,): 1 on `at`, −1 on `against` unless that is the ground."""
    force = np.zeros(len(structure.members))
    force[known_place(structure, at, "at")] += 1.0
    if against is not None and against != GROUND:
        force[known_place(structure, against, "against")] -= 1.0
    return force


def known_place(structure: Structure, name: str, where: str) -> int:
    """Place of a member among the members; InputError where there is none, saying `where` it was named."""
    if name not in structure.names:
        raise InputError(
            f"a member {name!r}",
            expected=f"one of {', '.join(structure.names)}",
            where=where,
            advice="correct the name, or add the member",
        )
    return structure.position(name)


def refuse_unresolved(structure: Structure, frequency_hz: Vector) -> None:
    """Raises InputError for the first frequency [Hz] at which the dynamic stiffness is singular or lost in rounding."""
    scaled = scaled_stiffness_matrix(structure)
    eigenvalues = np.linalg.eigvals(scaled)
    square = (2.0 * math.pi * frequency_hz) ** 2
    largest = float(np.abs(eigenvalues).max())
    distance = np.full(len(square), math.inf)
    for eigenvalue in eigenvalues:
        np.minimum(distance, np.abs(square - eigenvalue), out=distance)
    wrong = np.flatnonzero(distance <= np.maximum(UNDAMPED * square, RESOLVED * largest))
    if not len(wrong):
        return
    first = int(wrong[0])
    frequency = f"{frequency_hz[first]:.6g} Hz"
    # what moves most in the nearest mode, and the joint that it strains most
    near, vectors = np.linalg.eig(scaled)
    shape = vectors[:, np.argmin(np.abs(near - square[first]))].astype(np.complex128) / np.sqrt(masses_kg(structure))
    member, between = structure.names[int(np.argmax(np.abs(shape)))], strained_joint(structure, shape).between
    if distance[first] < UNDAMPED * square[first]:
        raise InputError(
            f"a resonance at {frequency} that nothing damps; {member!r} moves most in it",
            expected="frequencies off the undamped resonances, or joints that take energy",
            where="joints",
            advice=f"give the joint {between[0]} – {between[1]} its dissipation (ψ above 0), or move the frequency",
        )
    raise InputError(
        f"stiffnesses over masses that lie so far apart that rounding decides the motion at {frequency}",
        expected="natural frequencies of single members within six powers of ten",
        where="joints",
        advice=f"correct the mass of {member!r} or its joints, or merge what is practically rigid",
    )


def strained_joint(structure: Structure, shape: Complex) -> Joint:
    """The joint that holds most of the energy of a motion of the members, shape (n_members,)."""
    motion = {**dict(zip(structure.names, shape, strict=True)), GROUND: 0.0}
    return max(
        structure.joints,
        key=lambda joint: joint.stiffness_n_per_m * abs(motion[joint.between[0]] - motion[joint.between[1]]) ** 2,
    )


#: Modes whose product φᵀ·M·φ is above this share of their lengths are not told apart by their eigenvalues.
ORTHOGONAL = 1e-10
COMPLETE = 1e-10  #: How exactly the shapes of all modes must give back every motion to be used as coordinates.


@dataclass(frozen=True)
class StructureModes:
    """Modes of a structure, lowest frequency first."""

    frequency_hz: Array  #: (n,): Damped eigenfrequencies Re √λ / 2π [Hz]
    loss_factor: Array  #: (n,): η = Im λ / Re λ; ψ of the mode is 2π·η
    #: (n_members, n): One mode a column, φᵀ·M·φ = 1 (no conjugation), the largest motion with a positive real part
    #: [kg^−½]. If not `complete`: modes for which that is impossible have φᴴ·M·φ = 1.
    shapes: Complex
    eigenvalues_per_s2: Complex  #: (n,): λ [1/s²]
    members: tuple[str, ...]  #: Names of the rows of `shapes`
    complete: bool  #: Whether the shapes span all motions, to rounding

    def __post_init__(self) -> None:
        for values in (self.frequency_hz, self.loss_factor, self.shapes, self.eigenvalues_per_s2):
            values.setflags(write=False)


def structure_modes(structure: Structure) -> StructureModes:
    """All modes of a structure.

    InputError if stiffnesses over masses lie so far apart that rounding decides the lowest modes.
    """
    refuse_unresolved(structure, np.zeros(1))
    eigenvalues, vectors = _eigenpairs(structure)
    order = np.argsort(np.sqrt(eigenvalues).real, kind="stable")
    eigenvalues, vectors = eigenvalues[order], vectors[:, order]
    vectors = _normalised(vectors)
    largest = vectors[np.argmax(np.abs(vectors), axis=0), np.arange(len(eigenvalues))]
    vectors = vectors * np.where(largest.real < 0.0, -1.0, 1.0)
    lost = np.abs(vectors @ vectors.T - np.eye(len(eigenvalues))).max()
    return StructureModes(
        frequency_hz=np.sqrt(eigenvalues).real / (2.0 * math.pi),
        loss_factor=eigenvalues.imag / eigenvalues.real,
        shapes=vectors / np.sqrt(masses_kg(structure))[:, None],
        eigenvalues_per_s2=eigenvalues,
        members=structure.names,
        complete=bool(lost <= COMPLETE),
    )


def _eigenpairs(structure: Structure) -> tuple[Complex, Complex]:
    """Eigenvalues and vectors of length 1; real shapes where every joint takes the same share of energy.

    Those of the inverse, a compliance: so the low modes, which move most, have the most digits.
    """
    scaled = scaled_stiffness_matrix(structure)
    losses = {joint.loss_factor for joint in structure.joints}
    if len(losses) == 1:
        inverses, vectors = linalg.eigh(linalg.inv(scaled.real))
        return np.asarray(complex(1.0, losses.pop()) / inverses, np.complex128), vectors.astype(np.complex128)
    inverses, vectors = linalg.eig(linalg.inv(scaled))
    return np.asarray(1.0 / inverses, dtype=np.complex128), np.asarray(vectors, dtype=np.complex128)


def _normalised(vectors: Complex) -> Complex:
    """The vectors with vᵀ·v = 1 and 0 between different ones; as they are where vᵀ·v vanishes."""
    normalised = vectors.copy()
    products = vectors.T @ vectors
    # eigenvalues that are equal, or nearly so, leave it open which of their vectors are found
    _, group = connected_components(np.abs(products) > ORTHOGONAL, directed=False)
    for number in range(group.max() + 1):
        together = np.flatnonzero(group == number)
        block = products[np.ix_(together, together)]
        if np.linalg.svd(block, compute_uv=False).min() > 1e-6:
            # the root of a symmetric matrix is a polynomial of it, hence symmetric too
            root = linalg.sqrtm(block)
            normalised[:, together] = vectors[:, together] @ np.linalg.inv(root)
    return normalised


@dataclass(frozen=True)
class CarryingMode:
    """The mode that has the largest part in the motion of the tool against the workpiece by one line."""

    frequency_hz: float  #: Of the mode [Hz]
    member: str  #: Member that moves most in it
    amplification: float  #: |λ/(λ − ω²)|: its motion at the line over that by a force that does not change


def carrying_mode(
    structure: Structure, modes: StructureModes, source: Source, frequency_hz: float, *, tool: str, workpiece: str
) -> CarryingMode | None:
    """The mode whose part in X_tool − X_workpiece is the largest; None where modes do not span all motions."""
    if not modes.complete:
        return None
    parts = np.abs(relative_parts(structure, modes, source, frequency_hz, tool=tool, workpiece=workpiece))
    k = int(np.argmax(parts))
    square, eigenvalue = (2.0 * math.pi * frequency_hz) ** 2, complex(modes.eigenvalues_per_s2[k])
    return CarryingMode(
        frequency_hz=float(modes.frequency_hz[k]),
        member=modes.members[int(np.argmax(np.abs(modes.shapes[:, k])))],
        amplification=abs(eigenvalue / (eigenvalue - square)),
    )


def relative_parts(
    structure: Structure, modes: StructureModes, source: Source, frequency_hz: float, *, tool: str, workpiece: str
) -> Complex:
    """Part of every mode in (X_tool − X_workpiece)/F of one source [m/N], shape (n_modes,); their sum is all of it."""
    force = unit_force(structure, source.member, source.against)
    relative = modes.shapes[structure.position(tool)] - modes.shapes[structure.position(workpiece)]
    square = (2.0 * math.pi * frequency_hz) ** 2
    return np.asarray(relative * (modes.shapes.T @ force) / (modes.eigenvalues_per_s2 - square))
