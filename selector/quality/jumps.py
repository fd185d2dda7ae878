"""Where a measured channel jumps: for a few samples (spike), or for good (step), and what else changes then."""

from collections.abc import Iterator
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from selector.findings import Finding, Where
from selector.quality.broken_sensors import told
from selector.quality.finding_table import FINDINGS
from selector.quality.survey import (
    COMMAND_ROLES,
    MEASURED_ROLES,
    Ints,
    Series,
    Survey,
    difference,
    moment,
    present_median,
    reading,
)
from selector.types import Array

_NEAR_PERIODS = 2.5  #: A cause and its effect are this close [sampling periods].
_KINK_PERIODS = 1.2  #: So close to a jump two lines must meet to be bent by the same event; kinks are frequent.
#: Samples on each side from which the slopes beside a kink are taken, and among which it is placed.
_COINCIDENCE_REACH, _SEARCHED = 20, 6
_BY_CHANCE = 1e-3  #: How often noise alone may look like a kink in any of the other channels.
#: A kink explains a jump when it amounts to this share of it after so many sampling periods.
_CARRIED, _OF_JUMP = 2.0, 1.0 / 3.0
_FOLLOWED = 0.2  #: Share of a command's changes that a channel must follow at once for the command to be a cause, ...
_MUCH = 0.35  #: ... by this share of the jump in question.


def commanded(survey: Survey, column: int, run: str, moment_s: tuple[float, float], height: float) -> str:
    """Which command or state of the machine causes a jump of this height, in words; empty if none does.

    One that changes at this moment, and either has changed so much at most twice in the recording, or is followed by
    the channel at once at a fifth of these changes at least: a change that is close by chance is no cause. A change of
    speed always is one for a displacement.
    """
    first, last = _rows_near(survey, run, moment_s, _NEAR_PERIODS)
    for other in survey.columns(*COMMAND_ROLES):
        if other == column or not _changes(survey.values[run][other], first, last):
            continue
        speeding = survey.channels[column].role == "displacement" and survey.channels[other].role == "spindle_speed"
        if speeding:
            return f"{survey.channels[other].name} changes at that moment"
        changes = followed = 0
        piece = survey.values[run][other][first:last]
        size = 0.7 * float(np.nanmax(np.abs(np.diff(piece))))
        for each in survey.runs:
            changed = _change_times(survey, each, other, size)
            changes += changed.size
            x = survey.values[each][column]
            for at in np.searchsorted(survey.time[each], changed).tolist():
                moved = present_median(x[at + 2 : at + 6]) - present_median(x[max(0, at - 5) : max(0, at - 1)])
                followed += bool(abs(moved) > _MUCH * abs(height))
        if changes <= 2 or followed >= max(2.0, _FOLLOWED * changes):
            return f"{survey.channels[other].name} changes at that moment"
    return ""


def pulsing_with(survey: Survey, column: int, run: str, window_s: tuple[float, float]) -> tuple[list[str], list[str]]:
    """Names of the commands, and of the other measured channels, that leave their level and return in a window."""
    first, last = _rows_near(survey, run, window_s, 0.5)
    pulsing: dict[bool, list[str]] = {True: [], False: []}
    for roles, measured in ((COMMAND_ROLES, False), (MEASURED_ROLES, True)):
        for other in survey.columns(*roles):
            x = survey.values[run][other]
            inside, before, after = x[first:last], x[max(0, first - 3) : first], x[last : last + 3]
            if other == column or not (inside.size and before.size and after.size):
                continue
            off = float(np.median(inside) - 0.5 * (np.median(before) + np.median(after)))
            limit = max(8.0 * survey.scale(run, other).floor, 2.0 * abs(float(np.median(after) - np.median(before))))
            if abs(off) > max(limit, 1e-300):
                pulsing[measured].append(survey.channels[other].name)
    return pulsing[False], pulsing[True]


def kink_elsewhere(survey: Survey, column: int, run: str, moment_s: tuple[float, float], height: float) -> str:
    """Which other measured channel changes its course at this moment as much as the jump asks for; empty if none.

    A kink is what a cubic cannot follow: a smooth bend is none. It explains a jump only when the turn, carried on for
    two sampling periods, is a third of the jump, each as a share of its own channel's span. A displacement needs a
    change of speed to jump, so beside a recorded speed that does not change a kink explains nothing.
    """
    first, last = _rows_near(survey, run, moment_s, _NEAR_PERIODS)
    if survey.channels[column].role == "displacement":
        speeds = [survey.values[run][other] for other in survey.columns("spindle_speed")]
        if any(np.isfinite(x[first:last]).any() and not _changes(x, first, last) for x in speeds):
            return ""
    others = [other for other in survey.columns(*MEASURED_ROLES) if other != column]
    asked = _OF_JUMP * abs(height) / max(survey.scale(run, column).span, abs(height))
    carried = _CARRIED * _period(survey, run)
    kinks = _kinks(survey, run, others, 0.5 * sum(moment_s))
    bent = (other for other, turn in kinks if abs(turn) * carried >= asked * survey.scale(run, other).span)
    return next((f"{survey.channels[other].name} changes its course at that moment" for other in bent), "")


def _rows_near(survey: Survey, run: str, moment_s: tuple[float, float], periods: float) -> tuple[int, int]:
    time, near = survey.time[run], periods * _period(survey, run)
    return int(np.searchsorted(time, moment_s[0] - near)), int(np.searchsorted(time, moment_s[1] + near, "right"))


def _period(survey: Survey, run: str) -> float:
    time = survey.time[run]
    return float(np.median(np.diff(time))) if time.size > 1 else 0.0


def _change_times(survey: Survey, run: str, column: int, size: float) -> Array:
    """When a command changes by so much [s]: differences far above its usual ones, those in a row counted once."""
    series = survey.series(run, column)
    if series.x.size < 2:
        return np.empty(0)
    differences = np.abs(np.diff(series.x))
    least = max(6.0 * float(np.median(differences)), 0.02 * float(np.ptp(series.x)), size, 1e-300)
    at = np.flatnonzero(differences > least)
    at = at[np.diff(at, prepend=-10) > 2]
    return np.asarray(series.time_s[at + 1], dtype=np.float64)


def _changes(x: Array, first: int, last: int) -> bool:
    """Whether a command moves in the window by more than it usually does between two samples."""
    piece = x[first:last]
    piece = piece[np.isfinite(piece)]
    if piece.size < 2 or np.ptp(piece) == 0.0:
        return False
    whole = float(np.nanmax(x) - np.nanmin(x))
    reach = 10 * (last - first)
    wide = np.diff(x[max(0, first - reach) : last + reach])
    wide = np.abs(wide[np.isfinite(wide)])
    least = max(6.0 * float(np.median(wide)) if wide.size else 0.0, 0.02 * whole)
    return bool(np.abs(np.diff(piece)).max() > least)


def _jumps(x: Array, first: int, last: int, floor: float) -> bool:
    """Whether a channel jumps in the window: beyond its noise, and sharper than its differences around."""
    differences = np.abs(np.diff(x[max(0, first - _COINCIDENCE_REACH) : last + _COINCIDENCE_REACH]))
    inside = np.abs(np.diff(x[first:last]))
    inside, differences = inside[np.isfinite(inside)], differences[np.isfinite(differences)]
    if inside.size == 0 or differences.size < 8:
        return False
    usual = float(np.quantile(differences, 0.75))
    return bool(inside.max() > max(6.0 * floor, 3.0 * usual))


def _kinks(survey: Survey, run: str, columns: list[int], at: float) -> list[tuple[int, float]]:
    """(column, change of slope [unit/s]) of the channels that have a kink at this moment; O(channels)."""
    time, period = survey.time[run], _period(survey, run)
    middle = int(np.searchsorted(time, at))
    rows = slice(max(0, middle - _COINCIDENCE_REACH), middle + _COINCIDENCE_REACH)
    columns = [column for column in columns if np.isfinite(survey.values[run][column, rows]).all()]
    dt = (time[rows] - at) / max(period, 1e-300)
    if min(middle, time.size - middle) < 8 or not columns:
        return []
    x = survey.values[run][columns, rows]
    smooth, _ = np.linalg.qr(np.vander(dt, 4))
    rest = x - (x @ smooth) @ smooth.T
    explained, turns = [], []
    for shift in range(-_SEARCHED, _SEARCHED + 1):
        bent = 0.5 * np.abs(dt - shift)
        bent -= smooth @ (smooth.T @ bent)
        size = float(bent @ bent)
        turns.append(rest @ bent / size)
        explained.append(turns[-1] ** 2 * size)
    best = np.argmax(explained, axis=0)
    each = np.arange(len(columns))
    gained, turn = np.array(explained)[best, each], np.array(turns)[best, each]
    sigma2 = np.maximum((rest * rest).sum(axis=1) - gained, 0.0) / (dt.size - 5)
    # by chance one of so many channels gets this far once in a thousand
    clear = NormalDist().inv_cdf(1.0 - _BY_CHANCE / len(columns))
    here = np.abs(best - len(turns) // 2) <= _KINK_PERIODS
    found = here & (gained > clear**2 * np.maximum(sigma2, 1e-300))
    return [(columns[k], float(turn[k]) / period) for k in np.flatnonzero(found)]


#: A jump is looked at when it exceeds so many standard deviations of single differences (6e-7 in normal noise).
_SHARP = 5.0
_CLEAR = 6.0  #: A step is believed when it exceeds so many standard errors of the levels on its two sides.
_SMALLEST = {"degC": 0.5, "um": 4.0}  #: Smaller jumps do no harm to a thermal model [K, µm].
_STEPS = 3.5  #: A jump spans more than so many steps of the resolution.
_LONGEST_SPIKE = 3
_BRIEF_S = 25.0  #: From the first to the last sample of a spike; a burst of coolant on a thin sensor is longer.
_REACH = 12  #: Samples on each side from which the levels beside a jump are taken.
_MOST = 400  #: Jumps looked at per channel and run; a channel with more is not a measurement with jumps in it.
#: Share of a jump that other differences nearby may reach; a lag of one sampling period leaves 0.37 for the next.
_REST = 0.35
_NOISY_REST = 0.6  #: The same where the noise is as large.
_LIKE_STEP = 0.35  #: By this share of it the jump between the levels may differ from the one between two samples.
_LEVEL_BESIDE = _NOISY_REST * (1.0 + _LIKE_STEP)  #: So that no other difference nearby reaches this share of that one.


@dataclass(frozen=True)
class Jump:
    """A level that changes for good: position of the last sample before it, height [unit], time [s].

    `bends`: the course has another slope from there.
    """

    at: int
    height: float
    time_s: float
    error: float
    bends: bool


def sharp_differences(survey: Survey, run: str, columns: list[int]) -> dict[int, Ints]:
    """Positions i where x[i+1] - x[i] of a channel stands out from the noise around it, the largest if there are many.

    Only of channels that have such differences; O(n).
    """
    found: dict[int, Ints] = {}
    for alike, x in survey.together(run, columns):
        if x.shape[1] < 6:
            continue
        scales = [survey.scale(run, column) for column in alike]
        differences = np.abs(np.diff(x, axis=1))
        quantum = np.array([[scale.quantum] for scale in scales])
        least = np.maximum([[_SMALLEST[survey.channels[column].unit]] for column in alike], _STEPS * quantum)
        # the noise of each block or of its neighbours, whichever is largest: noise may change with the speed
        blocks = np.array([scale.block_noise for scale in scales])
        padded = np.concatenate([blocks[:, :1], blocks, blocks[:, -1:]], axis=1)
        local = np.maximum(np.maximum(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])
        limit = np.maximum(_SHARP * np.sqrt(2.0) * np.maximum(local, 0.3 * quantum), least)
        block = np.minimum(
            np.arange(differences.shape[1]) // (differences.shape[1] // blocks.shape[1]), limit.shape[1] - 1
        )
        is_sharp = differences > limit[:, block]
        for k in np.flatnonzero(is_sharp.any(axis=1)).tolist():
            sharp = np.flatnonzero(is_sharp[k])
            if sharp.size > _MOST:
                sharp = np.sort(sharp[np.argpartition(-differences[k, sharp], _MOST)[:_MOST]])
            found[alike[k]] = sharp
    return found


_Jumpy = list[tuple[Series, Ints, list["Jump"]]]


def _jumping(survey: Survey) -> dict[int, _Jumpy]:
    """The measured channels that have `sharp_differences`: run by run these, and what shifts of level they are."""
    if "jumping" not in survey.kept:
        columns = survey.columns(*MEASURED_ROLES)
        found: dict[int, _Jumpy] = {column: [] for column in columns}
        for run in survey.runs:
            for column, sharp in sharp_differences(survey, run, columns).items():
                series = survey.series(run, column)
                found[column].append((series, sharp, _level_shifts(series, sharp, survey.scale(run, column).noise)))
        survey.kept["jumping"] = {column: series_at for column, series_at in found.items() if series_at}
    kept: dict[int, _Jumpy] = survey.kept["jumping"]
    return kept


def spikes(survey: Survey) -> Iterator[Finding]:
    """Findings ``spike``: up to three samples off, the level before and after the same. O(samples).

    No fault is what a command explains, what some but not all other channels see in the same samples (all see
    interference), and what is no higher than steps of the same channel: a thin sensor. Of several samples that last
    longer than half a minute a short process may be the cause: a warning, and nothing is left out.
    """
    for column, series_at in _jumping(survey).items():
        found: list[tuple[Series, int, int, float]] = []
        shifts: list[float] = []
        for series, sharp, jumps in series_at:
            run, widest = series.run, 5.0 * float(survey.scale(series.run, column).block_noise.max())
            found += [(series, *spike) for spike in _spike_samples(series, sharp, widest)]
            for jump in jumps:
                # a gauge jumps with the speed and may be disturbed as well
                moment_s = (float(series.time_s[jump.at]), jump.time_s)
                gauge = series.channel.role == "displacement"
                if not (gauge and commanded(survey, column, run, moment_s, jump.height)):
                    shifts.append(abs(jump.height))
        others = len(survey.columns(*MEASURED_ROLES)) - 1
        kept: dict[tuple[str, bool], list[tuple[tuple[float, float], float]]] = {}
        for series, first, last, height in found:
            steps_too = sum(shift > 0.6 * abs(height) for shift in shifts) >= 2
            window = (float(series.time_s[first]), float(series.time_s[last]))
            commands, measured = pulsing_with(survey, column, series.run, window)
            if not steps_too and not commands and not 0 < len(measured) < 0.6 * others:
                kept.setdefault((series.run, window[1] - window[0] > _BRIEF_S), []).append((window, height))
        for (run, unsure), hits in kept.items():
            channel = survey.channels[column]
            worst = max((height for _, height in hits), key=abs)
            many = f"has {len(hits)} spikes, the largest" if len(hits) > 1 else "has a spike"
            doubt = "; a short process, e.g. coolant on a thin sensor, can do this" if unsure else ""
            does = "Nothing is left out." if unsure else "The samples are left out."
            finding = FINDINGS.finding(
                "spike",
                f"{channel.name} in run {run} {many} of {difference(worst, channel)}, {{when}}{doubt}.",
                Where(channel.name, run),
                {"spikes": len(hits), "largest": worst, "noise": survey.scale(run, column).noise},
                f"Look for interference or a loose contact. {does}",
                "none" if unsure else "leave-out-stretch",
            )
            yield from told(finding, [window for window, _ in hits], few=1)


def steps(survey: Survey) -> Iterator[Finding]:
    """Findings ``step``: the level shifts between two samples and stays. O(samples).

    A fault when nothing else happens then; not worth a word when a command changes that goes with jumps of this channel
    elsewhere too; no fault when another channel jumps with it, or when the channel jumps again and again. In doubt, and
    a warning only, when another channel changes its course just then, when it goes up and down once, or when it is a
    displacement and no spindle speed is recorded.
    """
    speed_known = bool(survey.columns("spindle_speed"))
    for column, series_at in _jumping(survey).items():
        found: list[tuple[Series, Jump, str, str]] = []
        for series, _, shifts in series_at:
            for jump in shifts:
                moment_s = (float(series.time_s[jump.at]), jump.time_s)
                command = commanded(survey, column, series.run, moment_s, jump.height)
                found.append((series, jump, command, command or _company(survey, series, jump, moment_s)))
        role = survey.channels[column].role
        # a displacement may jump with every change of speed and slip once; a thin sensor jumps by its nature
        own = [jump for _, jump, _, cause in found if not (cause and role == "displacement")]
        ups, downs = sum(jump.height > 0 for jump in own), sum(jump.height < 0 for jump in own)
        switching = min(ups, downs) >= 1 and ups + downs >= 3 and max(ups, downs) <= 4 * min(ups, downs)
        lawful: dict[tuple[str, str], list[Jump]] = {}
        alone = []
        for series, jump, command, cause in found:
            if command:
                continue
            if cause or switching:
                said = cause or "it jumps up and down repeatedly"
                lawful.setdefault((series.run, said), []).append(jump)
            else:
                alone.append((series, jump))
        for (run, cause), jumps in lawful.items():
            yield _lawful(survey, column, run, cause, jumps)
        doubt = "a change of spindle speed can do this, and none is recorded"
        doubt = doubt if role == "displacement" and not speed_known else ""
        if min(ups, downs) == 1 and not doubt:
            doubt = "it goes up once and down once, as a thin sensor in the coolant does"
        yield from _faults(survey, column, alone, doubt)


def _company(survey: Survey, series: Series, jump: Jump, moment_s: tuple[float, float]) -> str:
    """The other measured channels that jump at this moment, or the bend there, in words; empty if nothing is."""
    first, last = _rows_near(survey, series.run, moment_s, _NEAR_PERIODS)
    together = [
        survey.channels[other].name
        for other in survey.columns(*MEASURED_ROLES)
        if other != series.column
        and _jumps(survey.values[series.run][other], first, last, survey.scale(series.run, other).floor)
    ]
    if together:
        return f"{', '.join(together[:3])} jumps with it"
    return "its course bends there too" if jump.bends else ""


def _faults(survey: Survey, column: int, alone: list[tuple[Series, Jump]], doubt: str) -> Iterator[Finding]:
    channel = survey.channels[column]
    for k, (series, jump) in enumerate(alone):
        before = [other for s, other in alone[:k] if s.run == series.run]
        after = [other for s, other in alone[k + 1 :] if s.run == series.run]
        if any(_undoes(jump, other) for other in before):
            continue
        # the stretch ends where the level steps back
        ends = [float(series.time_s[other.at]) for other in after if _undoes(other, jump)]
        end = ends[0] if ends else float(series.time_s[-1])
        moment_s = (float(series.time_s[jump.at]), jump.time_s)
        unsure = doubt or kink_elsewhere(survey, column, series.run, moment_s, jump.height)
        yield FINDINGS.finding(
            "step",
            f"{channel.name} in run {series.run} steps by {difference(jump.height, channel)} at {moment(jump.time_s)} "
            f"(to {reading(float(series.x[jump.at + 1]), channel)}) and stays there; "
            + (f"it may be real: {unsure}." if unsure else "no other channel changes then."),
            Where(channel.name, series.run, jump.time_s, end),
            {"height": jump.height, "standard_error": jump.error},
            "Look for a sensor or gauge that slipped or was set to zero; if it was, cut the file there: two runs. "
            + ("Nothing is left out." if unsure else "The stretch from there is left out."),
            "none" if unsure else "leave-out-stretch",
            level="warning" if unsure else "error",
        )


def _lawful(survey: Survey, column: int, run: str, cause: str, jumps: list[Jump]) -> Finding:
    channel = survey.channels[column]
    largest = max(jumps, key=lambda jump: abs(jump.height))
    many = f"steps {len(jumps)} times, by up to" if len(jumps) > 1 else "steps by"
    said = f"{channel.name} in run {run} {many} {difference(largest.height, channel)} (at {moment(largest.time_s)}); "
    said += f"{cause}, so this is taken for real."
    where = Where(channel.name, run, jumps[0].time_s, jumps[-1].time_s)
    evidence = {"steps": len(jumps), "height": largest.height, "standard_error": largest.error}
    return FINDINGS.finding("step", said, where, evidence, "Nothing is left out.", level="info")


def _undoes(later: Jump, earlier: Jump) -> bool:
    return later.height * earlier.height < 0 and abs(later.height + earlier.height) < 0.3 * abs(earlier.height)


def _spike_samples(series: Series, candidates: Ints, widest: float) -> list[tuple[int, int, float]]:
    """(first, last, height) of every spike; `widest` is how far apart noise can put the samples beside it."""
    x, found, free = series.x, [], 0
    for i in candidates:
        if i + 1 < free:
            continue
        before = x[max(free, i - 3) : i + 1]
        if before.size < 2:
            continue
        level = float(np.median(before))
        jump = float(x[i + 1] - x[i])
        spread = float(np.ptp(before))
        for last in range(i + 1, min(i + 1 + _LONGEST_SPIKE, x.size - 2)):
            off = x[i + 1 : last + 1] - level
            after = x[last + 1 : last + 4]
            if not np.all(off * np.sign(jump) > 0.5 * abs(jump)):
                break
            height = float(off[np.argmax(np.abs(off))])
            if abs(x[last + 1] - level) >= _REST * abs(height):
                continue
            # a spike may sit on a slope
            slope = float(max(np.abs(np.diff(before)).max(), np.abs(np.diff(after)).max(initial=0.0)))
            drop = (last + 2 - i) * 2.0 * slope if slope < 0.1 * abs(height) else 0.0
            back = float(np.median(after)) - level
            # both sides level: the top of a real peak has slopes beside it
            if (
                abs(x[last + 1] - level) < max(0.15 * abs(height), min(max(widest, drop), _REST * abs(height)))
                and abs(back) < max(0.25 * abs(height), min(drop, _REST * abs(height)))
                and max(spread, float(np.ptp(after))) < max(_REST * abs(height), min(widest, 0.6 * abs(height)))
            ):
                found.append((int(i + 1), int(last), height))
                free = last + 1
                break
    return found


def _level_shifts(series: Series, candidates: Ints, noise: float) -> list[Jump]:
    x, time, found = series.x, series.time_s, []
    period = float(np.median(np.diff(time)))
    for i in candidates:
        left = slice(max(0, i + 1 - _REACH), i + 1)
        right = slice(i + 1, min(x.size, i + 1 + _REACH))
        if left.stop - left.start < 5 or right.stop - right.start < 5:
            continue
        around = np.abs(np.diff(x[left.start : right.stop]))
        around[i - left.start] = 0.0
        if around.max() >= _LEVEL_BESIDE * abs(x[i + 1] - x[i]):
            continue
        if time[i + 1] - time[i] > 3.5 * period:
            continue  # behind a gap a level may be another one
        middle = 0.5 * (time[i] + time[i + 1])
        before, error_before, slope_before = line_at(time[left], x[left], float(middle))
        after, error_after, slope_after = line_at(time[right], x[right], float(middle))
        # a sensor that slips goes on as before, at another level; what bends is a process
        bend = abs(slope_after - slope_before) * 0.5 * _REACH * period
        bends = bend > max(0.25 * abs(after - before), 3.0 * (error_before + error_after))
        # ... and what is still on its way in the first sample is a lag
        height, error = after - before, float(np.hypot(error_before, error_after))
        if x.size > i + 8:
            settled = float(np.median(x[i + 4 : i + 8]) - slope_before * (np.median(time[i + 4 : i + 8]) - time[i + 1]))
            late = (settled - float(x[i + 1])) * np.sign(height)
            bends |= bool(late > max(0.12 * abs(height), 3.5 * noise))
        smallest = _SMALLEST[series.channel.unit]
        if (
            abs(height) > max(_CLEAR * error, smallest)
            and abs(height / float(x[i + 1] - x[i]) - 1.0) < _LIKE_STEP
            and float(around.max()) < max(_REST * abs(height), min(6.5 * noise, _NOISY_REST * abs(height)))
        ):
            found.append(Jump(int(i), height, float(time[i + 1]), error, bool(bends)))
    return found


def line_at(time: Array, x: Array, at: float) -> tuple[float, float, float]:
    """(value at a moment, its standard error, slope) of a straight line."""
    centre = float(time.mean())
    dt = time - centre
    spread = max(float(dt @ dt), 1e-300)
    slope = float(dt @ x) / spread
    rest = x - x.mean() - slope * dt
    sigma = float(np.sqrt(rest @ rest / max(x.size - 2, 1)))
    error = sigma * float(np.sqrt(1.0 / x.size + (at - centre) ** 2 / spread))
    return float(x.mean()) + slope * (at - centre), error, slope
