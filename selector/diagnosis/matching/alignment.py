"""How recording and simulation are brought together: runs, one clock, rows to be compared, positions that are none."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison, read_only
from selector.diagnosis.finding_table import FINDINGS
from selector.diagnosis.matching.usable import (
    at_readings,
    exchanged_runs,
    rms,
    rounding,
    without_codes,
    without_extremes,
    without_useless,
)
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.shapes.signals import by_run, rate
from selector.errors import InputError, OptionError
from selector.findings import Finding, Where
from selector.number_text import natural_key
from selector.recording import Recording, of_axis
from selector.types import Mask, Matrix, Vector
from selector.units import CANONICAL_UNITS

_SMALL, _UNLIKE = 0.2, 0.5  #: Of the spread of the command; correlation with it: a position has 1 of both.
_BY_MOTION = 0.3  #: Part of its variance that the motion of the command explains: more than an axis that stands has.
_ROLE, _UM = "displacement", 1e6


def with_following_errors(comparison: Comparison) -> Comparison:
    """The comparison with positions that are errors behind a command as displacements [µm], each told as a finding."""
    names = {
        channel.name
        for channel, one in itertools.product(comparison.channels, comparison.channels)
        if (channel.role, one.role) == ("position", "position_command")
        and channel.axis in (None, one.axis)
        and _goes_with_motion(comparison, channel.name, one.name)
    }
    if not names:
        return comparison
    said = (
        "{} is taken for what the axis is behind its command, and not for a position: its standard deviation is {:.3g} "
        "µm, and it goes with its speed."
    )
    spread_um = {name: _UM * float(np.nanstd(comparison.recorded[name])) for name in sorted(names)}
    told = (
        FINDINGS.finding("following-error", said.format(name, size), Where(channel=name), {})
        for name, size in spread_um.items()
    )

    def in_um(of: Mapping[str, Vector]) -> dict[str, Vector]:
        return {name: read_only(_UM * values) if name in names else values for name, values in of.items()}

    return replace(
        comparison,
        channels=tuple(
            replace(channel, role=_ROLE, unit=CANONICAL_UNITS[_ROLE]) if channel.name in names else channel
            for channel in comparison.channels
        ),
        recorded=in_um(comparison.recorded),
        simulated=in_um(comparison.simulated),
        findings=(*comparison.findings, *told),
    )


def _goes_with_motion(comparison: Comparison, name: str, command: str) -> bool:
    """Whether a channel goes with the motion of a command and not with the command."""
    place, asked = (
        by_run(comparison, lambda part: part - part.mean(), comparison.filled(comparison.recorded[one]))
        for one in (name, command)
    )
    spread, way = float(np.std(place)), float(np.std(asked))
    if not 0.0 < spread < _SMALL * way or abs(float(np.mean(place * asked))) > _UNLIKE * spread * way:
        return False
    speed = rate(comparison, asked)
    motion = np.column_stack([speed, rate(comparison, speed), np.sign(speed)])
    return rms(place - motion @ least_squares(motion, place)) < np.sqrt(1.0 - _BY_MOTION) * spread


Rows = NDArray[np.intp]
_SEEN = 0.1  #: Of the usual change from reading to reading: lines that cut off less do not matter.
#: Recorded steps in a simulated one from which a line between two simulated values may be no longer the simulation.
_COARSE = 1.6


def comparable_rows(at_s: Vector, stamps_s: Vector, recorded: Sequence[Vector], simulated: Sequence[Vector]) -> Rows:
    """Recorded rows at which a run can be compared: all, or those at which the simulation has a value of its own.

    Between two stamps a line stands for what the simulation did; what it cuts off looks like a lag of the machine. That
    is an eighth of h²·y'' at most, a fourth of what a line over two steps is off in the middle.

    `at_s` are the recorded times on the simulation's clock, shape (n_rows,), `stamps_s` the stamps of the simulation,
    shape (n_stamps,) [s]; `recorded` and `simulated` the responses at them.
    """
    everything = np.arange(len(at_s))
    if len(at_s) < 3 or len(stamps_s) < 3:
        return everything
    step_s = float(np.median(np.diff(at_s)))
    if float(np.median(np.diff(stamps_s))) < _COARSE * step_s:
        return everything
    pairs = zip(recorded, simulated, strict=True)
    if not any(_cut_off(stamps_s, course) > _SEEN * _noise(values) for values, course in pairs):
        return everything
    inside = stamps_s[(stamps_s >= at_s[0] - 0.5 * step_s) & (stamps_s <= at_s[-1] + 0.5 * step_s)]
    after = np.clip(np.searchsorted(at_s, inside), 1, len(at_s) - 1)
    nearest = np.where(inside - at_s[after - 1] <= at_s[after] - inside, after - 1, after)
    return np.unique(nearest)


def _cut_off(stamps_s: Vector, course: Vector) -> float:
    """Root mean square of what lines between the samples of a course cut off, at most."""
    share = (stamps_s[1:-1] - stamps_s[:-2]) / (stamps_s[2:] - stamps_s[:-2])
    bend = course[1:-1] - (1.0 - share) * course[:-2] - share * course[2:]
    bend = bend[np.isfinite(bend)]
    return 0.25 * float(np.sqrt(np.mean(bend**2))) if len(bend) else 0.0


def _noise(values: Vector) -> float:
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    return float(np.median(steps)) if len(steps) else 0.0


def told(run: str, rows: Rows, at_s: Vector, stamps_s: Vector) -> Finding:
    """That only some readings of a run are compared."""
    recorded, simulated = float(np.median(np.diff(at_s))), float(np.median(np.diff(stamps_s)))
    said = (
        f"Run {run}: the simulation has a value every {simulated:.6g} s, the recording every {recorded:.6g} s; "
        f"compared are the {len(rows)} of {len(at_s)} readings at which the simulation has a value."
    )
    evidence = {"simulated_step_s": simulated, "recorded_step_s": recorded, "rows": len(rows), "of": len(at_s)}
    return FINDINGS.finding("coarse-simulation", said, Where(run=run), evidence)


_PART = 0.8  #: Share of a run below which it is said that the rest of it is not compared.
_LEAST = 0.1  #: Share below which a simulation is not of this run: another unit of time or another programme.

_TIME_UNITS = (60.0, 1e3, 3600.0, 6e4, 3.6e6)  #: How many times longer a run is in another unit of time.
_SAME = 0.03  #: Part by which runs may differ that are the same in another unit.


def require_same_time_unit(durations_s: Mapping[str, tuple[float, float]]) -> None:
    """Ends with an error when every simulated run is the recorded one in a smaller unit of time.

    `durations_s` is run → duration of what was recorded and of what was simulated [s]. Raises InputError if so.
    """
    ratios = {run: simulated / recorded for run, (recorded, simulated) in durations_s.items() if recorded > 0.0}
    for factor in _TIME_UNITS:
        if ratios and all(abs(ratio / factor - 1.0) < _SAME for ratio in ratios.values()):
            run = next(iter(ratios))
            recorded_s, simulated_s = durations_s[run]
            raise InputError(
                f"run {run} was recorded for {recorded_s:.6g} s and simulated for {simulated_s:.6g} s, "
                f"{factor:g} times as long, and so was every other",
                expected="the same unit of time in both",
                where="simulation",
                advice="check the unit of time in both (--time-unit, --simulation-time-unit, the headers)",
            )


def partly_simulated(covered: Mapping[str, Mask]) -> list[Finding]:
    """Findings ``partly-simulated``; `covered` is run → rows where the simulation has a value, of shape (n_rows,).

    Raises InputError: it covers less than a tenth of every run.
    """
    counts = {run: (int(rows.sum()), len(rows)) for run, rows in covered.items()}
    if counts and all(there < _LEAST * of for there, of in counts.values()):
        run, (there, of) = max(counts.items(), key=lambda item: item[1][0] / item[1][1])
        others = ", fewer in the others" if len(counts) > 1 else ""
        raise InputError(
            f"{there} of {of} recorded rows of run {run} ({100 * there / of:.1f} %) lie within the simulation{others}",
            expected=f"a simulation of at least {100 * _LEAST:.0f} % of a run",
            where="simulation",
            advice="check the unit of time in both (--time-unit, --simulation-time-unit), or give only the part of the "
            "recording that was simulated",
        )
    return [
        FINDINGS.finding(
            "partly-simulated",
            f"Run {run}: the simulation has a value at {there} of {of} recorded rows ({100 * there / of:.0f} %); only "
            "these are compared.",
            Where(run=run),
            {"rows": there, "of": of, "share": there / of},
        )
        for run, (there, of) in counts.items()
        if there < _PART * of
    ]


LAST_PART = 0.3  #: Share of a single run that is held out.
#: Roles whose values hold until the next sample; all others are read between samples along a line.
_HELD_ROLES = ("state",)
_STEPPED_ROLES = ("state", "spindle_speed", "feed_rate")  #: What a programme says, in steps.
_A_SAMPLE = 1.0 + 1e-6  #: By how many samples steps of the same channel are apart in two files, and rounding.
#: Steps of the simulation beyond which missing values are a hole, not a channel that is written more rarely.
_HOLE = 4.0
_ON_GRID = 0.95  #: Share of the readings that stand on a common grid, when they have a resolution.
_FEWEST, _NEXT = 4, 3.5  #: Neighbouring levels that are compared, and how many steps they are apart at most.
_ROUNDED_OFF = 0.2  #: Of a step: by how much rounding of what is written may move a level.
#: Part of a run by which clocks that cover the same span may differ before they are taken to have other zeros.
_OTHER_ZERO = 0.05


def comparison_of(
    recording: Recording, simulation: Recording, *, responses: Sequence[str] | None = None, holdout: str = "last"
) -> Comparison:
    """Recording and simulation as one comparison, at the times of the recording, or of a simulation that is coarser.

    Runs are matched by name. The simulation may be sampled otherwise, start later and end earlier. `responses` are the
    channels to be compared; default: all that both have, but those that the simulation was merely given. `holdout` is
    ``"last"`` (the last run; of a single run its last 30 %), the name of a run, or the share of every run, at its end,
    that nothing is fitted to.

    Raises InputError: there is nothing to compare: no common run or channel, no overlap in time, another quantity, too
    few samples. Raises OptionError: `responses` or `holdout` name something that is not there.
    """
    recording, codes = without_codes(recording)
    runs, findings = _common_runs(recording, simulation)
    findings += codes
    shared = _common_channels(recording, simulation, responses)
    at: dict[str, Vector] = {}
    read: dict[str, Matrix] = {}
    for run in runs:
        at[run], tolerance_s, said = _simulated_times(recording, simulation, run)
        read[run] = _read_at(simulation, run, simulation.names, at[run], tolerance_s)
        findings += said
    compared = [simulation.names.index(name) for name in shared]
    covered = {run: np.any(np.isfinite(read[run][:, compared]), axis=1) for run in runs}
    reached = [run for run in runs if covered[run].any()]
    if not reached:
        raise InputError(
            f"no value of {_listed(shared)} in the simulation at any recorded time (run {runs[0]}: "
            f"{at[runs[0]][0]:.6g} to {at[runs[0]][-1]:.6g} s on its clock)",
            expected="recording and simulation that overlap in time, with values where they do",
            where="simulation",
            advice="check the time column and its unit in both, and whether the simulated columns hold numbers",
        )
    findings += [
        _left_out(run, "the simulation has no value at any of its times") for run in runs if run not in reached
    ]
    if holdout == "last" and "last" not in reached and len(reached) > 1:
        holdout = reached[-1]
    # the answer is the same in whatever order the runs are given, of r1 and r01 or B and b as well
    reached.sort(key=lambda run: (natural_key(run), run))
    require_same_time_unit(
        {run: (float(np.ptp(recording.time_s(run))), float(np.ptp(simulation.time_s(run)))) for run in reached}
    )
    findings += partly_simulated({run: covered[run] for run in reached})
    rows: dict[str, Rows] = {}
    for run in reached:
        at_s, stamps_s = at[run], simulation.time_s(run)
        moving = [name for name in shared if simulation.channel(name).role not in _HELD_ROLES]
        both = [list(part.values(run, moving).T) for part in (recording, simulation)]
        rows[run] = comparable_rows(at_s, stamps_s, *both)
        if len(rows[run]) < len(at_s):
            findings.append(told(run, rows[run], at_s, stamps_s))
    time = [recording.time_s(run)[rows[run]] for run in reached]
    starts = (0, *np.cumsum([len(part) for part in time]).tolist())
    recorded = np.concatenate([recording.values(run, recording.names)[rows[run]] for run in reached])
    simulated = np.concatenate([read[run][rows[run]] for run in reached])
    comparison = Comparison(
        runs=tuple(reached),
        starts=starts,
        time_s=read_only(np.concatenate(time)),
        channels=recording.channels,
        recorded={name: read_only(recorded[:, k]) for k, name in enumerate(recording.names)},
        simulated={name: read_only(simulated[:, k]) for k, name in enumerate(simulation.names)},
        responses=tuple(shared),
        held_out=_held_out(reached, time, holdout, findings),
        findings=tuple(findings),
    )
    comparison = with_following_errors(without_extremes(comparison))
    steps = {name: resolution(values) for name, values in comparison.recorded.items()}
    comparison = at_readings(replace(comparison, resolution=steps))
    usable = without_useless(comparison, _handed_back(recording, simulation, at, shared), asked=responses is not None)
    return replace(usable, findings=(*usable.findings, *exchanged_runs(usable)))


def _handed_back(
    recording: Recording, simulation: Recording, at: Mapping[str, Vector], names: Sequence[str]
) -> frozenset[str]:
    """Channels whose simulated values are readings, or on a line between two, wherever the simulation has one.

    At the recorded times such a channel is off by the noise of the readings, like one that was computed well; what a
    programme says in steps may step a sample of the slower clock sooner or later. `at` is run → recorded times on the
    simulation's clock, shape (n_rows,) [s].
    """
    found = set()
    own = {run: simulation.time_s(run) for run in at}
    clocks = {run: own[run] - at_s[0] + recording.time_s(run)[0] for run, at_s in at.items()}
    slower = {run: np.maximum(_steps_s(recording.time_s(run), clocks[run]), _steps_s(own[run], own[run])) for run in at}

    def read(samples: float, held: Sequence[str]) -> Vector:
        parts = [_read_at(recording, run, [name], clocks[run] + samples * slower[run], 0.0, held) for run in at]
        return np.concatenate(parts)[:, 0]

    for name in names:
        both = [np.concatenate([of.values(run, [name])[:, 0] for run in at]) for of in (recording, simulation)]
        recorded, simulated = both
        step = max(resolution(recorded), min(resolution(simulated), _SEEN * _noise(recorded)))
        near = [read(0.0, ())]
        if recording.channel(name).role in _STEPPED_ROLES:
            # whoever resamples a file draws lines between switchings, too
            near = [read(samples, _STEPPED_ROLES) for samples in (0.0, -_A_SAMPLE, _A_SAMPLE)]
        beyond = np.fmax(np.fmin.reduce(near) - simulated, simulated - np.fmax.reduce(near))
        off = beyond[np.isfinite(near[0] - simulated)]
        if len(off) and off.max() <= rounding(recorded, step):
            found.add(name)
    return frozenset(found)


def _steps_s(time_s: Vector, at_s: Vector) -> Vector:
    """Step of a clock round some times [s], a hole counted as the longest step that is none; shape (n_times,)."""
    steps = np.diff(time_s) if len(time_s) > 1 else np.zeros(1)
    row = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, len(steps) - 1)
    return np.minimum(steps, _HOLE * np.median(steps))[row]


def resolution(values: Vector) -> float:
    """Step of the grid on which readings stand [their unit]; 0 if they stand on none."""
    seen = np.unique(values[np.isfinite(values)])
    if len(seen) < 2:
        return 0.0
    steps = np.diff(seen)
    steps = np.sort(steps[steps > 1e-9 * float(np.abs(seen).max())])
    # the smallest step may come from a single value off the grid, a large one may be a multiple
    for nth in (len(steps) // 10, len(steps) // 100, 0):
        if nth >= len(steps):
            return 0.0
        step = float(steps[nth])
        counts = (seen - seen[0]) / step
        if np.mean(np.abs(counts - np.rint(counts)) < 0.05) >= _ON_GRID:
            # many steps give the grid more sharply than one
            return float((seen[-1] - seen[0]) / np.rint(counts[-1]))
    return _rounded_step(steps)


def _rounded_step(steps: Vector) -> float:
    """Step of a grid whose levels were rounded when they were written, from the spacing of neighbouring ones; 0: none.

    Steps of 0.3226 K written to two decimals are 0.32 and 0.33 K: no level stands on a common grid of either.
    """
    usual = float(np.median(steps))
    near = steps[steps < _NEXT * usual]
    counts = np.rint(near / usual)
    on_grid = (counts > 0.0) & (np.abs(near - counts * usual) < _ROUNDED_OFF * usual)
    if len(near) < max(_FEWEST, 0.5 * len(steps)) or np.mean(on_grid) < _ON_GRID:
        return 0.0
    return float(near.sum() / counts.sum())


def _common_runs(recording: Recording, simulation: Recording) -> tuple[list[str], list[Finding]]:
    runs = [run for run in recording.runs if run in simulation.runs]
    if not runs:
        raise InputError(
            f"recorded runs {_listed(recording.runs)}; simulated runs {_listed(simulation.runs)}",
            expected="at least one run of the same name (the file's name without its ending) in both",
            where="simulation",
            advice="name the simulated file like the recorded one, in a folder of its own; runs of a workbook are "
            "called after the file and the sheet",
        )
    findings = [_left_out(run, "the simulation has no such run") for run in recording.runs if run not in runs]
    spare = [run for run in simulation.runs if run not in runs]
    if spare:
        statement = f"Simulated but not recorded, and not used: {_listed(spare)}."
        findings.append(FINDINGS.finding("simulated-only", statement, Where(), {"runs": spare}))
    return runs, findings


def _common_channels(recording: Recording, simulation: Recording, responses: Sequence[str] | None) -> list[str]:
    both = [name for name in recording.names if name in simulation.names]
    chosen = list(dict.fromkeys(of_axis(name, recording.channels) for name in responses or ())) or both
    for name in chosen:
        lacking = "recording" if name not in recording.names else "simulation" if name not in simulation.names else None
        if lacking is not None:
            raise OptionError(
                f"{name!r} is not in the {lacking}",
                expected=f"one of {_listed(both)}" if both else "a channel that recording and simulation both have",
                where="--response",
                advice="correct the name, or write the simulated channel under the name that the recorded one has",
            )
    if not both:
        raise InputError(
            f"recorded channels {_listed(recording.names)}; simulated channels {_listed(simulation.names)}",
            expected="at least one channel of the same name in both",
            where="simulation",
            advice="name the simulated channels as the recorded ones, or say their columns in the machine file",
        )
    for name in chosen:
        one, other = recording.channel(name).role, simulation.channel(name).role
        if one != other:
            raise InputError(
                f"{name} is recorded as {one}, simulated as {other}",
                expected="the same quantity in both",
                where=f"channel {name!r}",
                advice="correct the role, or rename one of the two",
            )
    return chosen


def _simulated_times(recording: Recording, simulation: Recording, run: str) -> tuple[Vector, float, list[Finding]]:
    """Recorded times of a run on the simulation's clock with the tolerance at its ends [s], and what is to be said."""
    time, simulated = recording.time_s(run), simulation.time_s(run)
    tolerance_s = 0.5 * float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    shift_s, from_zero = _shift_s(recording, simulation, run)
    span_s, span_simulated_s = float(time[-1]), float(simulated[-1])
    overlap_s = min(span_s + shift_s, span_simulated_s) - max(shift_s, 0.0)
    same_span = abs(span_s - span_simulated_s) <= 0.01 * span_s and abs(shift_s) > _OTHER_ZERO * span_s
    # a logger may count from when it was switched on, a simulation from the start of the run
    if not from_zero or shift_s == 0.0 or (overlap_s >= 0.5 * min(span_s, span_simulated_s) and not same_span):
        return time + shift_s, tolerance_s, []
    statement = (
        f"Run {run}: the recorded clock starts at {shift_s:.6g} s and the simulated one at 0, and they cover the same "
        "span or hardly meet; both are counted from their first sample."
    )
    told = FINDINGS.finding("clocks-with-other-zeros", statement, Where(run=run), {"shift_s": shift_s})
    return time, tolerance_s, [told]


def _shift_s(recording: Recording, simulation: Recording, run: str) -> tuple[float, bool]:
    """What the recorded clock showed at the first sample, less what the simulated one did [s]; 0 if not comparable.

    And whether the simulation counts from 0.
    """
    entries = [part.provenance.get("runs", {}).get(run, {}) for part in (recording, simulation)]
    dates = [None if entry.get("start") is None else datetime.fromisoformat(entry["start"]) for entry in entries]
    if dates[0] is None and dates[1] is None:
        first_s, simulated_s = (float(entry.get("first_stamp_s", 0.0)) for entry in entries)
        return first_s - simulated_s, simulated_s == 0.0
    if dates[0] is None or dates[1] is None or (dates[0].tzinfo is None) != (dates[1].tzinfo is None):
        return 0.0, False
    return (dates[0] - dates[1]).total_seconds(), False


def _read_at(
    of: Recording, run: str, names: Sequence[str], at_s: Vector, tolerance_s: float, held: Sequence[str] = _HELD_ROLES
) -> NDArray[np.float64]:
    """Channels at some times, shape (n_times, n_names); NaN where the file does not reach."""
    time, values = of.time_s(run), of.values(run, names)
    result = np.full((len(at_s), len(names)), np.nan)
    for k, name in enumerate(names):
        present = np.isfinite(values[:, k])
        if not present.any():
            continue
        stamps, x = time[present], values[present, k]
        inside = (at_s >= stamps[0] - tolerance_s) & (at_s <= stamps[-1] + tolerance_s)
        if of.channel(name).role in held:
            read = x[np.clip(np.searchsorted(stamps, at_s, side="right") - 1, 0, len(x) - 1)]
        else:
            read = np.interp(at_s, stamps, x)
        if not present.all() and len(stamps) > 1:
            gaps = np.diff(stamps)
            rows = np.flatnonzero(present)
            hole = (gaps > _HOLE * np.median(gaps)) & (np.diff(rows) > 1)
            before = np.clip(np.searchsorted(stamps, at_s, side="right") - 1, 0, len(gaps) - 1)
            inside &= ~(hole[before] & (at_s > stamps[before]) & (at_s < stamps[before + 1]))
        result[inside, k] = read[inside]
    return result


def _held_out(runs: Sequence[str], time: Sequence[Vector], holdout: str, findings: Iterable[Finding]) -> Mask:
    """Rows that nothing is fitted to, shape (n_rows,)."""
    share = LAST_PART
    if holdout in runs:
        if len(runs) == 1:
            raise OptionError(
                f"{holdout!r}, the only run that is compared",
                expected="something that is left to be fitted to",
                where="--holdout",
                advice="leave it out: of a single run the last 30 % are kept for the proof; or give more runs",
            )
        return np.repeat([run == holdout for run in runs], [len(part) for part in time])
    if holdout != "last":
        try:
            share = float(holdout)
        except ValueError:
            share = 0.0
        if not 0.0 < share <= 0.8:
            gone = [one for one in findings if one.where.run == holdout and one.action == "leave-out-run"]
            raise OptionError(
                " ".join([repr(holdout), *(f"({one.statement.rstrip('.')})" for one in gone)]),
                expected=f"last, a run ({_listed(runs)}), or a share above 0 and up to 0.8",
                where="--holdout",
                advice="e.g. --holdout 0.3 keeps the last 30 % of every run for the proof",
            )
    return np.concatenate([part > part[0] + (1.0 - share) * (part[-1] - part[0]) for part in time])


def _left_out(run: str, reason: str) -> Finding:
    said = f"Run {run} is not compared: {reason}."
    return FINDINGS.finding("run-not-compared", said, Where(run=run), {}, action="leave-out-run")


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
