"""What driven modes say of a duty cycle: its course, what each mode gives to it, how sure it is, and of the tests."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from selector.physics.thermal.modes import driven
from selector.physics.thermal.modes.choice import hall_drives
from selector.physics.thermal.modes.heldout import AT_MOST, few_factor
from selector.physics.thermal.modes.modes import AmbientCourse, Cyclogram, SpeedLaw, require_tested
from selector.physics.thermal.modes.thermal_test import ModeData, ThermalTest, mode_data, since_first
from selector.types import Mask, Vector

Entry = tuple[Vector, Vector]  #: The states (n_modes, n_inputs), and what is left of a start (n_modes,).
LEAST_HALL_K = 0.1  #: A hall that moves by less drives nothing that could be seen.
#: Logarithms of likelihoods count as so much less: rows of a model that is not quite right are not independent.
TEMPERED = 20.0
#: Way, by ratio, to the larger of two errors; ratio from which a claim is loose; left-out tests that say how much.
TO_LARGER, LOOSE, ENOUGH = 2.0 / 3.0, 1.8, 3
COURSE_POINTS = 200
#: What a start moves in its run, in standard deviations and as a share of the movement, from where on it began warm.
WARM, WARM_SHARE = 2.5, 0.05


@dataclass(frozen=True)
class DrivenModel:
    """Modes that speed and hall drive, with the tests that taught them."""

    #: tests, responses, data, parts and fit: The runs; what is predicted; blocks; tests in the runs; the fit
    tests: tuple[ThermalTest, ...]
    responses: tuple[str, ...]
    data: ModeData
    parts: tuple[driven.Part, ...]
    fit: driven.DrivenFit
    tau_low_s: Vector  #: tau_low_s and tau_high_s: (n_modes,): 95 % intervals [s]; NaN where there is no bound
    tau_high_s: Vector
    unseen: driven.LeftOut  #: Errors of tests that were left out
    others: tuple[driven.DrivenFit, ...] = ()  #: What else might be true: how far it is from this is part of the error

    @property
    def ambients(self) -> tuple[str, ...]:
        """Names of the hall temperatures that drive the modes."""
        return self.tests[0].ambients if self.fit.spec.with_hall else ()

    @property
    def part_names(self) -> tuple[str, ...]:
        """A name for every test: that of its run, with a number where a run has several."""
        counts = [sum(one.run == part.run for one in self.parts) for part in self.parts]
        numbers = [sum(one.run == part.run for one in self.parts[: k + 1]) for k, part in enumerate(self.parts)]
        return tuple(
            self.tests[part.run].run + (f" test {number}" if count > 1 else "")
            for part, count, number in zip(self.parts, counts, numbers, strict=True)
        )

    @property
    def heldout_um(self) -> Vector | None:
        """(n_responses,): RMS error of left-out tests from their start [µm]; None if none can be judged."""
        error = self.unseen.error_um
        return np.sqrt(np.nanmean(error**2, axis=0)) if np.isfinite(error).any() else None

    @property
    def residual_um(self) -> Vector:
        """(n_responses,): What modes and walk leave of the blocks [µm], root mean square."""
        phi, _ = driven.design(self.fit.spec, self.data, self.fit.theta)
        off = self.data.displacement_um - phi @ self.fit.coefficients
        squares, count = np.zeros(off.shape[1]), np.zeros(off.shape[1])
        for part in self.parts:
            at = slice(part.begin, part.end)
            weight = self.data.counts[at]
            mean = (weight * off[at]).sum(axis=0) / np.maximum(weight.sum(axis=0), 1.0)
            squares += (weight * (off[at] - mean) ** 2).sum(axis=0)
            count += weight.sum(axis=0)
        return np.asarray(np.sqrt(squares / np.maximum(count, 1.0)))

    def moved(self, cyclogram: Cyclogram, time_s: Vector, hall: AmbientCourse | None, *, follows: bool) -> Vector:
        """Columns (n_times, n_columns) of the fit in a duty cycle, less those at its beginning.

        It begins in equilibrium with the hall, or `follows` the last run. Without a course the hall stays as it is.

        Raises InputError if a speed is outside the tests.
        """
        require_tested(cyclogram.speed_rpm, self.data.fastest_rpm)
        run, entry = None, None
        if follows:
            run = len(self.tests) - 1
            course, before = self._hall(run), self.cyclogram_of(run)
            _, entry = self._courses(before, np.zeros(0), course, run, None)
            if hall is None and course is not None:
                hall = AmbientCourse.constant(course.ambient_degc[-1])
        columns, _ = self._courses(cyclogram, np.r_[0.0, np.asarray(time_s, dtype=np.float64)], hall, run, entry)
        return np.asarray(columns[1:] - columns[0])

    @property
    def law(self) -> SpeedLaw:
        """How heat depends on the speed."""
        return self.fit.spec.speed_law(self.fit.theta, self.data)

    def _courses(
        self, cyclogram: Cyclogram, time_s: Vector, hall: AmbientCourse | None, run: int | None, entry: Entry | None
    ) -> tuple[Vector, Entry]:
        """Columns (n_times, n_columns) at times [s], and the state at the end of the duty cycle.

        From rest, or from the `entry` that was left before; of a `run` with what is left of its start. The hall counts
        from its temperature at the start of the run, without a run from its first one. Exact between changes of the
        speed and knots of the hall: x' = −A(n)·x + b·u(t), with u straight there and A symmetric.
        """
        spec, theta, modes = self.fit.spec, self.fit.theta, self.fit.spec.n_modes
        film, drive, exponent = spec.films(theta)
        rate = np.exp(-theta[:modes])
        known = self.data.ambient_start_degc
        knots, halls = np.zeros(1), np.zeros((1, len(self.ambients)))
        if self.ambients and hall is not None:
            rest = hall.ambient_degc[0] if run is None or known is None else known[run]
            knots, halls = hall.time_s, hall.ambient_degc - rest
        edges = np.unique(np.r_[cyclogram.start_s, knots[knots < cyclogram.end_s], cyclogram.end_s])
        terms = self.law.terms(cyclogram.speed_at(edges))
        degrees = np.array([np.interp(edges, knots, one) for one in halls.T]).reshape(-1, len(edges)).T
        share = (cyclogram.speed_at(edges) / self.data.fastest_rpm) ** exponent
        state, left = entry or (np.zeros((modes, terms.shape[1] + degrees.shape[1])), np.ones(modes))
        at = np.clip(np.searchsorted(edges, time_s, side="right") - 1, 0, len(edges) - 2)
        states, starts = np.empty((len(time_s), *state.shape)), np.empty((len(time_s), modes))
        inputs, lengths = np.hstack([terms, degrees]), np.diff(edges)
        slopes = np.diff(np.hstack([np.zeros(terms.shape), degrees]), axis=0) / lengths[:, None]
        order = np.argsort(at, kind="stable")
        parts = np.split(order, np.searchsorted(at[order], np.arange(1, len(lengths))))
        for i, (slope, length, rows) in enumerate(zip(slopes, lengths, parts, strict=True)):
            if i == 0 or share[i] != share[i - 1]:
                of_film, vector = np.linalg.eigh(np.diag(rate) + share[i] * film)
                value, push = of_film[:, None], (vector.T @ (drive * rate) / of_film)[:, None]
            since = np.append(time_s[rows] - edges[i], length)[:, None, None]
            lag = push * (inputs[i] + slope * since - slope / value)
            inward = vector.T @ state - lag[0] + push * slope * since[0]
            course = vector @ (lag + inward * np.exp(-since * value))
            faded = left * np.exp(-since[:, :, 0] * (rate + share[i] * np.diag(film)))
            states[rows], state = course[:-1], course[-1]
            starts[rows], left = faded[:-1], faded[-1]
        of_runs = np.zeros((len(time_s), len(self.tests), modes))
        if run is not None:
            of_runs[:, run] = starts
        size = terms.shape[1]
        columns = (states[:, :, :size], states[:, :, size:], of_runs)
        return np.hstack([part.reshape(len(time_s), int(np.prod(part.shape[1:]))) for part in columns]), (state, left)

    def cyclogram_of(self, run: int) -> Cyclogram:
        """The speeds of a run."""
        return self.data.cyclogram(run).within(self.data.fastest_rpm)

    def _hall(self, run: int) -> AmbientCourse | None:
        """The recorded hall, block by block."""
        if not self.ambients or self.data.ambient_k is None or self.data.ambient_start_degc is None:
            return None
        blocks = slice(*self.data.bounds[run])
        degc = self.data.ambient_k[blocks] + self.data.ambient_start_degc[run]
        return AmbientCourse(np.r_[0.0, self.data.middle_s[blocks][1:]], degc)

    def displacement_um(
        self, cyclogram: Cyclogram, time_s: Vector, hall: AmbientCourse | None, *, follows: bool
    ) -> Vector:
        """Displacements from the start of the duty cycle [µm], (n_times, n_responses)."""
        return np.asarray(self.moved(cyclogram, time_s, hall, follows=follows) @ self.fit.coefficients)

    @property
    def is_separate(self) -> bool:
        """Whether every test is a run of its own."""
        return len(self.parts) == len(self.tests)

    @property
    def begins_warm(self) -> Mask:
        """(n_tests,): Runs that did not begin cold: what their start moves is no chance, and no trifle."""
        phi, kinds = driven.design(self.fit.spec, self.data, self.fit.theta)
        found = []
        for begin, end in self.data.bounds:
            starts = (phi[begin:end] - phi[begin]) * (kinds == 2)
            squares = ((starts @ self.fit.coefficients) ** 2).mean(axis=0)
            known = np.array([np.einsum("ij,jk,ik->i", starts, one, starts).mean() for one in self.fit.covariance])
            moves = ((self.data.displacement_um[begin:end] - self.data.displacement_um[begin]) ** 2).mean(axis=0)
            found.append((squares > np.maximum(WARM**2 * known, WARM_SHARE**2 * moves)).any())
        return np.array(found)

    def error_um(
        self, cyclogram: Cyclogram, time_s: Vector, hall: AmbientCourse | None, *, follows: bool, told: bool = True
    ) -> Vector:
        """Standard deviation of the error [µm], (n_times, n_responses).

        Where nobody `told` how the duty cycle begins and separate tests began warm, it may begin as these end, as
        likely as a test began warm: how far that course is from this one is part of the error. So is, where nobody
        says how a hall moves, what it did in the tests.

        The rest of it: docs/explanation/thermal-modes.md, *The claimed error*.
        """
        squares = self._expected_um(cyclogram, np.asarray(time_s, dtype=np.float64), hall, follows=follows) ** 2
        if self.is_separate and self.heldout_um is not None:
            times = self.times_expected(cyclogram, hall, follows=follows)
            # no test began as the duty cycle does: the larger
            way = 1.0 if self.begins_warm.all() and not follows else TO_LARGER
            times = np.maximum(times**way, times ** (1.0 - way))
            squares = squares * (times * few_factor(self.judged) / AT_MOST) ** 2
            if not told:
                # in a hall that stays: its step from the day of the tests to that of the duty cycle is no warm start
                here, there = (
                    self.displacement_um(cyclogram, time_s, None, follows=one) for one in (follows, not follows)
                )
                squares = squares + self.begins_warm.mean() * (there - here) ** 2
        unsaid = np.array([hall is None or name not in hall.names for name in self.ambients])
        by_hall = self._by_hall(cyclogram, time_s, unsaid, follows=follows) if unsaid.any() else 0.0
        return np.asarray(np.sqrt(squares + by_hall))

    def _by_hall(self, cyclogram: Cyclogram, time_s: Vector, unsaid: Vector, *, follows: bool) -> Vector:
        """Mean square of what `unsaid` halls that move as in a test do beside still ones, (n_times, n_responses)."""
        here = self.displacement_um(cyclogram, time_s, None, follows=follows)
        known, middle_s, squares = self.data.ambient_k, self.data.middle_s, np.zeros_like(here)
        if known is None:
            return squares
        for part in self.parts:
            at, moved = slice(part.begin, part.end), (known - known[part.begin]) * unsaid
            hall = AmbientCourse(middle_s[at] - middle_s[part.begin], moved[at] + self.last_ambient_degc())
            squares += (self.displacement_um(cyclogram, time_s, hall, follows=follows) - here) ** 2 / len(self.parts)
        return squares

    def times_expected(self, cyclogram: Cyclogram, hall: AmbientCourse | None, *, follows: bool) -> Vector:
        """(n_responses,): What left-out tests were off ÷ what the fit expects of itself in a duty cycle, or NaN."""
        time_s = np.linspace(0.0, cyclogram.end_s, COURSE_POINTS)
        expected = self._expected_um(cyclogram, time_s, hall, follows=follows)
        off = np.nan if self.heldout_um is None else self.heldout_um
        return np.asarray(off / np.sqrt((expected**2).mean(axis=0)))

    def _expected_um(
        self, cyclogram: Cyclogram, time_s: Vector, hall: AmbientCourse | None, *, follows: bool
    ) -> Vector:
        """What is expected of the error before left-out tests tell its size [µm], (n_times, n_responses)."""
        moved = self.moved(cyclogram, time_s, hall, follows=follows)
        squares = (driven.expected_um(self.fit, moved, time_s) * (1.0 if self.is_separate else self.unseen.factor)) ** 2
        here = moved @ self.fit.coefficients
        worse = np.array([driven.worth(other) - driven.worth(self.fit) for other in self.others])
        # of separate tests this was measured; in one long record other fits count alike, as was settled on a real one
        likely = np.exp(-worse / TEMPERED) if self.is_separate else np.ones(len(worse))
        for other, share in zip(self.others, likely / (1.0 + likely.sum()), strict=True):
            there = replace(self, fit=other, others=()).displacement_um(cyclogram, time_s, hall, follows=follows)
            squares += share * (there - here) ** 2
        return np.asarray(np.sqrt(squares))

    @property
    def judged(self) -> int:
        """Tests that were left out and predicted by the others."""
        return int(np.isfinite(self.unseen.error_um).any(axis=1).sum())

    @property
    def claim_factor(self) -> float:
        """How many times the claimed error it is at most, 19 times in 20."""
        return AT_MOST if self.is_separate else few_factor(self.judged)

    def course_of(self, part: driven.Part, time_s: Vector) -> Vector:
        """What the modes make of a test [µm] at times [s] of its run, (n_times, n_responses); its zero is unknown."""
        cyclogram = self.cyclogram_of(part.run)
        inside = np.minimum(time_s, cyclogram.end_s)
        columns, _ = self._courses(cyclogram, inside, self._hall(part.run), part.run, None)
        return np.asarray(columns @ self.fit.coefficients)

    def last_ambient_degc(self) -> Vector:
        """(n_halls,): Temperatures around the machine at the end of the tests [°C]; NaN where nothing drives."""
        course = self._hall(len(self.tests) - 1)
        return np.full(len(self.ambients), np.nan) if course is None else np.asarray(course.ambient_degc[-1])

    def walk_um(self, time_s: float) -> Vector:
        """(n_responses,): Standard deviation of the drift that nobody measured, after so long [µm]."""
        return np.asarray(np.exp(self.fit.spreads[:, 3]) * np.sqrt(time_s))


def driven_model(
    tests: Sequence[ThermalTest], responses: Sequence[str], *, whatever: bool = False
) -> DrivenModel | None:
    """The model of recordings in which the hall moves the machine, or a run is several tests; `whatever`: of any.

    None where the hall is constant and every run one test: `choose_modes` is for them.

    Raises InputError if the tests cannot be used: none, none that turns, too few samples.
    """
    data = mode_data([replace(test, displacement_um=since_first(test.displacement_um)) for test in tests])
    parts = driven.parts_of(data)
    moves = data.ambient_k is not None and float(np.ptp(data.ambient_k, axis=0).max()) > LEAST_HALL_K
    if not whatever and len(parts) == len(tests) and not (moves and hall_drives(data)):
        return None
    with threadpool_limits(1, "blas"):
        fit, *others = driven.chosen(data, with_hall=moves)
        order = np.argsort(fit.tau_s)
        low, high = (bound[order] for bound in driven.tau_intervals(fit, data))
        unseen = driven.left_out(fit, data, parts)
    return DrivenModel(tuple(tests), tuple(responses), data, parts, fit, low, high, unseen, tuple(others))
