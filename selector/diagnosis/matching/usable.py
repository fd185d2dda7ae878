"""Which readings, responses and runs can be compared; which runs repeat a programme or stand under other names."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from selector.diagnosis.answer import Diagnosis, Errors, Fit
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.finding_table import BEYOND_MEASURE, FINDINGS, NOT_COMPARED
from selector.errors import InputError
from selector.findings import Finding, Level, Where
from selector.quality.broken_sensors import broken_sensors, out_of_range
from selector.quality.finding_table import OUT_OF_RANGE, ROWS_IN_TWO_RUNS, SAME_FILE_TWICE, SENSOR_BREAK
from selector.quality.identity import shared_rows
from selector.quality.leave_out import blanked
from selector.quality.survey import Survey
from selector.quality.wrong_units import wrong_temperature_units
from selector.recording import Recording
from selector.text_file import shell_word
from selector.types import Mask, Vector

LARGEST = 1e30  #: Beyond this a number is no reading in any unit, and its fourth power may be no number at all.
#: Sampling periods between two readings of a response from which on it was read more rarely than the rest.
SELDOM = 3.5
#: Beyond this other responses lose too much when all are compared at the readings of the one that was read seldom.
_MOST_ROWS_BETWEEN = 12.0
_ROWS = 60  #: Readings to be fitted to that must be left then.


def without_extremes(comparison: Comparison) -> Comparison:
    """Numbers beyond 1e30 are missing readings, recorded or simulated; which, is said."""
    recorded, told = _measurable(comparison, comparison.recorded, "recorded")
    simulated, also = _measurable(comparison, comparison.simulated, "simulated")
    return replace(comparison, recorded=recorded, simulated=simulated, findings=(*comparison.findings, *told, *also))


def at_readings(comparison: Comparison) -> Comparison:
    """The rows at which responses were read, where some were read more rarely than the rows follow each other.

    A response that would make others lose too much by that is left out instead, as a finding says.
    """
    every = {name: _rows_between(comparison, name) for name in comparison.responses}
    seldom = {name: count for name, count in every.items() if count > SELDOM}
    if not seldom:
        return comparison
    read = np.any([np.isfinite(comparison.difference(name)) for name in seldom], axis=0)
    is_enough = max(seldom.values()) <= _MOST_ROWS_BETWEEN and int(np.sum(read & ~comparison.held_out)) >= _ROWS
    if len(seldom) < len(every) and (not is_enough or read.all()):
        clause = "has a value in one row of {:.0f} only, more rarely than other responses"
        by_itself = "diagnose it by itself: --response "
        told = [
            not_compared(name, clause.format(count), by_itself + shell_word(name), rows_between=count)
            for name, count in seldom.items()
        ]
        kept = tuple(name for name in every if name not in seldom)
        return replace(comparison, responses=kept, findings=(*comparison.findings, *told))
    if read.all():
        return comparison
    counts = ", ".join(f"{name} has a value in one row of {count:.0f}" for name, count in seldom.items())
    alone = len(seldom) == len(every)
    advice = "" if alone else "diagnose the other responses by themselves, with --response, to use all their rows"
    said = f"{counts}: responses are compared at {'its' if len(seldom) == 1 else 'their'} readings only."
    level: Level = "info" if alone else "warning"
    finding = FINDINGS.finding("read-seldom", said, None, {"rows_between": seldom}, advice, level=level)
    return at_readings(replace(comparison.only(read), findings=(*comparison.findings, finding)))


def rows_in_stretches(comparison: Comparison, seen: Mask) -> int:
    """Rows in stretches of more than 8 that are `seen` and follow each other without a hole."""
    total = 0
    for _, rows in comparison.rows_of_runs():
        here = comparison.time_s[rows][seen[rows]]
        cuts = np.flatnonzero(np.diff(here) > SELDOM * comparison.period_s) + 1
        total += sum(len(part) for part in np.split(here, cuts) if len(part) > 8)
    return total


def _measurable(
    comparison: Comparison, courses: Mapping[str, Vector], kind: str
) -> tuple[dict[str, Vector], list[Finding]]:
    result, findings = {}, []
    for name, values in courses.items():
        beyond = np.abs(values) > LARGEST
        result[name] = values
        if not beyond.any():
            continue
        result[name] = np.where(beyond, np.nan, values)
        first = int(np.flatnonzero(beyond)[0])
        run = comparison.runs[int(comparison.run_index[first])]
        findings.append(
            FINDINGS.finding(
                "beyond-measure",
                f"{int(beyond.sum())} {kind} value(s) of {name} are beyond {LARGEST:g}, the first {values[first]:.4g} "
                f"in run {run} at {comparison.time_s[first]:.6g} s: they count as missing.",
                Where(channel=name, run=run),
                {"count": int(beyond.sum()), "value": float(values[first]), "kind": kind},
            )
        )
    return result, findings


def _rows_between(comparison: Comparison, name: str) -> float:
    """Median number of sampling periods from one compared reading of a response to the next; 1 if there is one only."""
    compared = np.isfinite(comparison.difference(name))
    steps = [np.diff(comparison.time_s[rows][compared[rows]]) for _, rows in comparison.rows_of_runs()]
    known = np.concatenate(steps)
    return float(np.median(known)) / comparison.period_s if len(known) else 1.0


LEAST_SAMPLES = 40  #: Compared samples that are needed to fit offset, gain and delay and to tell noise from structure.
#: How many times larger a number is in another unit, where no calibration error could explain it.
_UNIT_FACTORS = {1e3: "mm and µm, or m and mm", 1e6: "m and µm", 60.0: "per second and per minute"}
_NOTHING_LEFT = "there is no difference to explain."
_SMALLEST = 1e-30  #: Below this the square of a course may be no number.
_ROUNDED = 0.51  #: Steps of the resolution by which rounding alone makes two equal courses differ.
#: Of the largest reading: files with a finite number of digits, read back between their rows, differ by less.
_SAME = 1e-8
_OF_SUMS = 1e-12  #: Of the largest reading: what is left of differences by sums in double precision.


def without_useless(comparison: Comparison, handed_back: frozenset[str], *, asked: bool) -> Comparison:
    """The comparison without responses from which nothing can be learned, and why, as findings.

    Mere inputs are the copies, and what the simulation has `handed_back` on a clock of its own. Where the user `asked`
    for the responses it is a warning that one is a mere input.

    Raises InputError: no response is left, or one is in another unit in the simulation.
    """
    findings, kept = list(comparison.findings), []
    copies = identical_responses(comparison)
    inputs = handed_back.union(copies)
    for name in comparison.responses:
        reason = _reason(comparison, name)
        if reason is None and name in inputs and not inputs.issuperset(comparison.responses):
            # what the simulation was given, it hands back
            level: Level = "warning" if asked else "info"
            clause = "is in the simulation as it was recorded"
            findings.append(not_compared(name, clause, "" if level == "info" else _LOOK, level, "input-of-simulation"))
        elif reason is None:
            _require_same_unit(comparison, name)
            kept.append(name)
        else:
            findings.append(not_compared(name, reason))
    if not kept:
        ids = (NOT_COMPARED, BEYOND_MEASURE)
        reasons = " ".join(finding.statement for finding in findings if finding.id in ids)
        raise _no_basis(reasons.removesuffix("."))
    short = [run for run, rows in comparison.rows_of_runs() if rows.stop - rows.start < LEAST_SAMPLES]
    said = f"has fewer than {LEAST_SAMPLES} samples: what happens in it alone cannot be told from noise."
    findings += [
        FINDINGS.finding("short-run", f"Run {run} {said}", Where(run=run), {}, "record longer", level="info")
        for run in short
    ]
    for name in kept:
        simulated = _seen(comparison.simulated[name])
        if np.ptp(simulated) == 0.0:
            said = f"The simulated {name} never moves: all that was recorded counts as left out."
            evidence = {"value": float(simulated[0])}
            findings.append(FINDINGS.finding("simulation-stands-still", said, Where(channel=name), evidence))
        if name in copies:
            said = f"The simulated {name} is the recorded one to within its rounding: {_NOTHING_LEFT}"
            evidence = {"largest_difference": float(np.abs(_seen(comparison.difference(name))).max())}
            findings.append(FINDINGS.finding("simulation-is-recording", said, Where(channel=name), evidence))
    return replace(comparison, responses=tuple(kept), findings=tuple(findings))


def _no_basis(found: str) -> InputError:
    return InputError(
        found,
        expected=f"a channel that moves and has at least {LEAST_SAMPLES} samples with a simulated value outside "
        "the part that is held out",
        where="recording and simulation",
        advice="give longer or more runs, or check the time columns and what the columns hold; join readings that "
        "come in bursts by --mean-s, e.g. --mean-s 60",
    )


def with_enough_samples(comparison: Comparison) -> Comparison:
    """A comparison that somebody put together, as it is. Raises InputError: it has too few samples to learn from."""
    for name in comparison.responses:
        fitted = _fitted_samples(comparison, name)
        if fitted < LEAST_SAMPLES:
            raise _no_basis(f"{name} has {fitted} samples that can be compared and are not held out")
    return comparison


def _fitted_samples(comparison: Comparison, name: str) -> int:
    return int(np.sum(np.isfinite(comparison.difference(name)) & ~comparison.held_out))


def identical_responses(comparison: Comparison) -> tuple[str, ...]:
    """Responses in which recording and simulation differ by no more than the rounding of the readings."""
    same = []
    for name in comparison.responses:
        difference = _seen(comparison.difference(name))
        largest = rounding(comparison.recorded[name], comparison.resolution.get(name, 0.0))
        # a noisy recording never lies within half a step of a smooth course throughout
        if len(difference) and np.abs(difference).max() <= largest:
            same.append(name)
    return tuple(same)


def rounding(readings: Vector, step: float = 0.0) -> float:
    """The most by which a reading and the same in another file are apart, by the `step` of them and finite digits."""
    return max(_ROUNDED * step, _SAME * float(np.abs(_seen(readings)).max(initial=0.0)))


def rounding_of(comparison: Comparison, response: str) -> float:
    """What sums of numbers as large as the readings cannot tell from nothing [unit of the response]."""
    return _OF_SUMS * float(np.abs(_seen(comparison.recorded[response])).max(initial=0.0))


def _reason(comparison: Comparison, name: str) -> str | None:
    """Why nothing can be learned from a response, as a clause; None if something can."""
    compared = np.isfinite(comparison.difference(name))
    fitted = _fitted_samples(comparison, name)
    if not compared.any():
        missing = "recorded" if not np.isfinite(comparison.recorded[name]).any() else "simulated"
        return f"has no {missing} value where it could be compared"
    if fitted < LEAST_SAMPLES:
        return f"has {fitted} samples that can be compared and are not held out"
    moved = float(np.ptp(comparison.recorded[name][compared]))
    if moved == 0.0:
        return "never moves in the recording"
    if moved < _SMALLEST:
        return f"moves by {moved:.3g} {comparison.channel(name).unit} at most in the recording, which is no reading"
    without_hole = rows_in_stretches(comparison, compared & ~comparison.held_out)
    if without_hole < LEAST_SAMPLES:
        return f"has {without_hole} samples that follow each other without a hole and are not held out"
    return None


def _require_same_unit(comparison: Comparison, name: str) -> None:
    """Ends with an error when one course is the other times a factor between units."""
    compared = np.isfinite(comparison.difference(name))
    recorded, simulated = comparison.recorded[name][compared], comparison.simulated[name][compared]
    x, y = simulated - simulated.mean(), recorded - recorded.mean()
    size = float(np.sqrt(x @ x) * np.sqrt(y @ y))
    if size == 0.0 or float(x @ y) < 0.9 * size:
        return
    gain = float(y @ y / (x @ y))
    for factor, units in _UNIT_FACTORS.items():
        if min(abs(gain / factor - 1.0), abs(gain * factor - 1.0)) < 0.15:
            raise InputError(
                f"what was recorded of {name} is {gain:.4g} times what was simulated, as between {units}",
                expected="the same unit in both",
                where=f"channel {name!r} of the simulation",
                advice="convert the simulated column to the unit that the machine file says, or correct that",
            )


_LOOK = "check the recording and the file"


def not_compared(
    name: str, clause: str, advice: str = _LOOK, level: Level = "warning", id_: str = NOT_COMPARED, **evidence: float
) -> Finding:
    """The finding that a response is not compared: it `clause`; `evidence` are numbers behind that."""
    statement = f"{name} is not compared: it {clause}."
    return FINDINGS.finding(id_, statement, Where(channel=name), evidence, advice, level=level)


def _seen(values: Vector) -> Vector:
    return values[np.isfinite(values)]


#: In the order of `selector.quality.inspect`: what one finds is blank for the next.
_CHECKS = (shared_rows, broken_sensors, wrong_temperature_units, out_of_range)
#: What is left out. A frozen or stepped reading is one, and a fault that a diagnosis can name.
_NO_READINGS = (SENSOR_BREAK, OUT_OF_RANGE, SAME_FILE_TWICE, ROWS_IN_TWO_RUNS)


def without_codes(recording: Recording) -> tuple[Recording, tuple[Finding, ...]]:
    """The recording with missing samples where no reading stands, without copies of runs; and what was left out.

    Every other run and every channel stays, if only as missing samples; the recording itself if there are no such
    samples. Findings ``sensor-break``, ``out-of-range``, ``same-file-twice``, and ``rows-in-two-runs``, which leaves
    nothing out; all of them warnings, for what is left out does no more harm to the answer. O(samples).
    """
    codes = (finding for finding in Survey(recording).found_by(_CHECKS) if finding.id in _NO_READINGS)
    found = [replace(finding, level="warning") for finding in codes]
    copies = [finding.where.run for finding in found if finding.id == SAME_FILE_TWICE]
    runs = [run for run in recording.runs if run not in copies]
    return (blanked(recording, found, runs, recording.channels) if found else recording), tuple(found)


def without_fitted_difference(comparison: Comparison) -> tuple[str, ...]:
    """Responses of which nothing can be fitted: copies, and those that differ from one on held-out rows only."""
    copies = identical_responses(comparison)
    fitted = {name: _seen(comparison.difference(name)[~comparison.held_out]) for name in comparison.responses}
    least = {name: np.inf if name in copies else rounding(comparison.recorded[name]) for name in fitted}
    return tuple(name for name, left in fitted.items() if np.abs(left).max(initial=0.0) <= least[name])


def diagnosis_of_copy(comparison: Comparison, *, seed: int = 0) -> Diagnosis:
    """The answer if every response was simulated as it was recorded, to within rounding, wherever it is fitted."""
    later = [name for name in comparison.responses if name not in identical_responses(comparison)]
    headline = f"The simulation is the recording to within its rounding: {_NOTHING_LEFT}"
    if later:
        headline = (
            "The simulation is the recording to within its rounding where it is fitted, and differs in "
            f"{', '.join(later)} on what is held out: nothing is left to fit an explanation to."
        )
    return Diagnosis(
        comparison=comparison,
        verdict="unexplained" if later else "nothing-missing",
        headline=headline,
        fit={name: fit_of_copy(comparison, name) for name in comparison.responses},
        findings=comparison.findings,
        seed=seed,
    )


def with_copies(answer: Diagnosis, *, comparison: Comparison, names: Sequence[str]) -> Diagnosis:
    """The answer to the rest of a comparison, with the errors of what was left out of it as well."""
    return replace(answer, fit={**answer.fit, **{name: fit_of_copy(comparison, name) for name in names}})


def told_of_copies(comparison: Comparison, names: Sequence[str]) -> Comparison:
    """The comparison with a finding for each of these responses that differs on held-out rows only."""
    findings, copies = list(comparison.findings), identical_responses(comparison)
    for name in (name for name in names if name not in copies):
        most = float(np.abs(_seen(comparison.difference(name)[comparison.held_out])).max())
        unit = comparison.channel(name).unit
        quantity = f"{most:.3g}" if unit == "1" else f"{most:.3g} {unit}"
        statement = (
            f"The simulated {name} is the recorded one where it is fitted, and differs by up to {quantity} on what is "
            "held out: nothing can be fitted that would explain it."
        )
        evidence = {"largest_difference": most}
        findings.append(FINDINGS.finding("differs-held-out", statement, Where(channel=name), evidence))
    return replace(comparison, findings=tuple(findings))


def fit_of_copy(comparison: Comparison, response: str) -> Fit:
    """Errors of a response that was simulated as it was recorded: nothing to gain."""
    course = comparison.simulated[response]
    difference = comparison.difference(response)
    train, held = (rms(difference[rows]) for rows in (~comparison.held_out, comparison.held_out))
    errors = Errors(train, train), Errors(held, held), held
    return Fit(comparison.channel(response).unit, *errors, None, None, course, course, course)


_MOST = 15
_SAME_LENGTH = 1.05
_ALIKE = 0.1  #: Of its root mean square: by how much a simulated course or an input differs between repeats at most.


def repeats(comparison: Comparison, response: str) -> tuple[tuple[slice, slice], ...]:
    """Rows, from the start of each, of pairs of runs that were asked the same; at most 15 pairs."""
    pairs: list[tuple[slice, slice]] = []
    inputs = [channel.name for channel in comparison.channels if channel.name not in comparison.simulated]
    for (_, one), (_, other) in combinations(comparison.rows_of_runs(), 2):
        lengths = one.stop - one.start, other.stop - other.start
        if max(lengths) > _SAME_LENGTH * min(lengths) or len(pairs) == _MOST:
            continue
        first, second = (slice(of.start, of.start + min(lengths)) for of in (one, other))
        courses = [comparison.simulated[response], *(comparison.recorded[name] for name in inputs)]
        if all(rms(of[first] - of[second]) <= _ALIKE * rms(of) for of in courses):
            pairs.append((first, second))
    return tuple(pairs)


def pure_error(comparison: Comparison, response: str) -> float | None:
    """Standard deviation of one reading between runs of one programme [unit]; None without any."""
    squares, n = 0.0, 0
    for first, second in repeats(comparison, response):
        apart = comparison.difference(response)[first] - comparison.difference(response)[second]
        apart = apart[np.isfinite(apart)]
        squares += 0.5 * float(np.sum(apart**2))
        n += len(apart)
    return float(np.sqrt(squares / n)) if n else None


def rms(values: Vector) -> float:
    """Root mean square of what is not missing; NaN where all is."""
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


_CERTAIN = 10.0  #: How many times smaller the residual variance of every exchanged run has to become to leave no doubt.
_LIKELY = 3.0  #: And to be worth a warning.
_LEAST = 40  #: Samples of a run to be compared.
_LOOKED_AT = 400  #: Samples of a run that are enough to tell one programme from another.
_COVERED = 0.9  #: Share of the samples that another run's simulation has to reach.
_NOT_THAT = 1e3  #: Logarithm of a residual that no assignment chooses.


def exchanged_runs(comparison: Comparison) -> tuple[Finding, ...]:
    """A finding ``runs-exchanged`` if the simulated runs fit far better under other names.

    Every recorded run is fitted by every simulated one, response by response, with offset and positive gain; the
    assignment of runs with the smallest sum of logarithms of the residual variances is compared with the names.

    Raises InputError: the residual variance of every run that changes its partner falls to less than a tenth.
    """
    parts = [rows for _, rows in comparison.rows_of_runs()]
    if len(parts) < 2 or not comparison.responses:
        return ()
    left = np.stack([_residuals(comparison, name, parts) for name in comparison.responses])
    own = np.einsum("rii->ri", left)
    # a response that was not compared in a run says nothing about that run
    known = np.isfinite(own)
    logs = np.where(known[:, :, None], np.where(np.isfinite(left), left, _NOT_THAT), 0.0)
    _, partner = linear_sum_assignment(logs.sum(axis=0))
    moved = np.flatnonzero(partner != np.arange(len(parts)))
    if not len(moved):
        return ()
    falls = np.where(known[:, moved], own[:, moved] - logs[:, moved, partner[moved]], 0.0)
    # the response that tells most; none may speak against it
    fall = float(np.exp(np.where(falls.min(axis=0) > -np.log(2.0), falls.max(axis=0), 0.0).min()))
    if fall < _LIKELY:
        return ()
    pairs = [(comparison.runs[k], comparison.runs[partner[k]]) for k in moved]
    said = "; ".join(f"run {other} of the simulation fits recording {run}" for run, other in pairs[:6])
    said += f"; and {len(pairs) - 6} more" if len(pairs) > 6 else ""
    advice = "name every simulated file like the recording that it was computed for"
    if fall > _CERTAIN:
        raise InputError(
            f"{said}: the residual variance is at least {fall:.3g} times smaller so",
            expected="every simulated run under the name of the recorded one",
            where="simulation",
            advice=advice,
        )
    said = f"Simulated runs may stand under each other's names: {said}; the residual variance is at least {fall:.2g} "
    evidence = {"fits": dict(pairs), "times_smaller": fall}
    return (FINDINGS.finding("runs-exchanged", f"{said}times smaller so.", None, evidence, advice),)


def _residuals(comparison: Comparison, name: str, parts: Sequence[slice]) -> NDArray[np.float64]:
    """Log residual variance of every recorded run (rows) with every simulated one; NaN where not comparable."""
    recorded, simulated, time = comparison.recorded[name], comparison.simulated[name], comparison.time_s
    floor = max(1e-12 * float(np.nanvar(recorded)), comparison.resolution.get(name, 0.0) ** 2 / 12.0, 1e-300)
    result = np.full((len(parts), len(parts)), np.nan)
    for i, rows in enumerate(parts):
        compared = np.flatnonzero(np.isfinite(comparison.difference(name)[rows])) + rows.start
        if len(compared) < _LEAST:
            continue
        looked = compared[np.unique(np.linspace(0, len(compared) - 1, _LOOKED_AT).astype(np.intp))]
        for j, other in enumerate(parts):
            there = np.isfinite(simulated[other])
            if there.sum() < 2:
                continue
            stamps = time[other][there]
            inside = (time[looked] >= stamps[0]) & (time[looked] <= stamps[-1])
            if i != j and inside.mean() < _COVERED:
                continue
            x = np.interp(time[looked][inside], stamps, simulated[other][there])
            result[i, j] = np.log(max(_left(recorded[looked][inside], x, either_sign=i == j), floor))
    return result


def _left(y: Vector, x: Vector, *, either_sign: bool) -> float:
    """Variance of what offset and gain leave; a run of another name has to go the same way, its own may be inverted."""
    x, y = x - x.mean(), y - y.mean()
    size, along = float(x @ x), float(x @ y)
    if size == 0.0 or (along <= 0.0 and not either_sign):
        return float(y @ y / len(y))
    return float((y @ y - along**2 / size) / len(y))
