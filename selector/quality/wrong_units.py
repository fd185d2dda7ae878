"""Channels that are recorded in another unit than the one they are declared in."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from selector.findings import Finding, Where
from selector.quality.finding_table import FINDINGS
from selector.quality.siblings import Relations, relations_of
from selector.quality.survey import THERMAL_ROLES, Survey, difference, medians_of_others, present_median, reading
from selector.types import Array
from selector.units import parse_unit


@dataclass(frozen=True)
class Mistake:
    """Recorded value = gain · true value + offset."""

    name: str
    gain: float
    offset: float
    unit: str  #: That the numbers are in, as a machine file says it.

    def undone(self, value: float) -> float:
        """The true value behind a recorded one."""
        return (value - self.offset) / self.gain

    def remedy_in_one_run(self, channel: str, run: str) -> str:
        """What to do about one file: a line of the machine file would hold for all of them."""
        return f'If so, say it in the machine file: [runs."{run}".channels."{channel}"] with unit = "{self.unit}".'


_THERMAL = (
    Mistake("°F taken for °C", 1.8, 32.0, "degF"),
    Mistake("K taken for °C", 1.0, 273.15, "K"),
    Mistake("tenths of a degree taken for °C", 10.0, 0.0, "0.1 degC"),
    Mistake("hundredths of a degree taken for °C", 100.0, 0.0, "0.01 degC"),
    Mistake("thousandths of a degree taken for °C", 1000.0, 0.0, "mdegC"),
    Mistake("°C taken for °F", 1 / 1.8, -32 / 1.8, "degC"),
    Mistake("°C taken for K", 1.0, -273.15, "degC"),
)
_LENGTH = (
    Mistake("mm taken for µm", 1e-3, 0.0, "mm"),
    Mistake("µm taken for mm", 1e3, 0.0, "um"),
    Mistake("inch taken for µm", 1 / 25400.0, 0.0, "inch"),
    Mistake("mil taken for µm", 1 / 25.4, 0.0, "mil"),
    Mistake("m taken for µm", 1e-6, 0.0, "m"),
)
#: Days and warm starts move the level of a machine by less [K]; the smallest mistake (°C for °F) moves 20 °C by 27.
_OFF_K = 12.0
_NEAR_K = 8.0  #: A level that is right again agrees this well with the other runs or channels at the start [K].
#: Cold channels of a machine start within this [K]; a hot part does so, seen through a mistake, by chance only.
_SAME_START_K = 1.0
_ROOM_C = (0.0, 50.0)  #: Where a machine starts [°C]; what starts elsewhere is no reference.
#: Where channels start when every one of them in every run has the mistake [°C]: 14–43 °C seen through it.
_ALL_ALIKE_C = {
    "°F taken for °C": (57.0, 110.0), "K taken for °C": (270.0, 325.0), "°C taken for °F": (-14.0, -1.0),
    "thousandths of a degree taken for °C": (5000.0, 45_000.0),
}  # fmt: skip


def wrong_temperature_units(survey: Survey) -> Iterator[Finding]:
    """Findings ``wrong-unit`` for temperatures, by the level at the start of each run. O(samples)."""
    columns = survey.columns(*THERMAL_ROLES)
    # what never changes in a run is dead, and measures in no unit
    starts = [
        [s.start if s.distinct > 1 else np.nan for r in survey.runs if (s := survey.scale(r, c))] for c in columns
    ]
    level = np.array(starts, dtype=np.float64).reshape(len(columns), len(survey.runs))
    if not np.isfinite(level).any():
        return
    coldest, hottest = float(np.nanmin(level)), float(np.nanmax(level))
    for mistake in _THERMAL:
        low, high = _ALL_ALIKE_C.get(mistake.name, (np.inf, np.inf))
        if not any(_is_possible(survey, c, run, mistake) for c in columns for run in survey.runs):
            continue
        if low <= coldest and hottest <= high + _OFF_K and (level.size > 1 or mistake.gain in (1.0, 1000.0)):
            yield FINDINGS.finding(
                "wrong-unit",
                f"All temperatures start at {coldest:.4g} °C or more, in every run: this looks like {mistake.name} "
                f"(then the coldest starts at {mistake.undone(coldest):.3g} °C).",
                Where(),
                {"coldest_start": coldest, "gain": mistake.gain, "offset": mistake.offset, "mistake": mistake.name},
                f'If so, declare unit = "{mistake.unit}" for these channels in the machine file.',
                level="warning",
            )
            return
    suspects: list[tuple[int, int, Mistake, float, str]] = []
    in_others = np.apply_along_axis(medians_of_others, 1, level)
    # most runs may have the mistake: where no channel begins in a room, the runs tell it that do
    is_odd = (level < _ROOM_C[0]) | (level > _ROOM_C[1])
    odd_runs = (is_odd | np.isnan(level)).all(axis=0) & (is_odd.sum(axis=0) > 1)
    in_others[:, odd_runs] = np.apply_along_axis(present_median, 1, np.where(odd_runs, np.nan, level))[:, np.newaxis]
    # one other channel may be a colder part
    count = np.isfinite(level).sum(axis=0) - np.isfinite(level)
    beside = np.where(count >= 2, np.apply_along_axis(medians_of_others, 0, level), np.nan)
    # else none is far off
    for i, r in np.argwhere(np.isfinite(level)).tolist() if hottest - coldest >= _OFF_K else ():
        for middle, source in ((in_others[i, r], "in the other runs"), (beside[i, r], "beside the other channels")):
            if _ROOM_C[0] <= middle <= _ROOM_C[1]:
                of_unit = tuple(one for one in _THERMAL if _is_possible(survey, columns[i], survey.runs[r], one))
                found = _explaining(float(level[i, r]), float(middle), of_unit)
                if found is not None:
                    suspects.append((i, r, found, float(middle), source))
                    break
    yield from _told_temperatures(survey, columns, level, suspects)


def _told_temperatures(
    survey: Survey, columns: list[int], level: Array, suspects: list[tuple[int, int, Mistake, float, str]]
) -> Iterator[Finding]:
    if not suspects:
        return
    relations = relations_of(survey)
    affected = np.zeros(level.shape, dtype=np.bool_)
    for i, r, *_ in suspects:
        affected[i, r] = True
    for i, r, mistake, middle, source in suspects:
        channel, run = survey.channels[columns[i]], survey.runs[r]
        healthy = np.isfinite(level[i]) & ~affected[i]
        beside = [columns[j] for j in np.flatnonzero(affected[:, r]) if j != i]
        gain = _gain(relations, columns[i], r, beside)
        whole_run = bool(affected[:, r][np.isfinite(level[:, r])].mean() > 0.7)
        # a level alone could be a hot part; movement that is right as it stands says that it is one
        moves_right = gain is not None and 0.75 < gain < 1.25 and mistake.gain not in (1.0, 10.0, 100.0)
        # unless what the movement was learned from has the same mistake: then the starts tell it
        if moves_right and not whole_run and not _starts_agree(level, i, mistake):
            continue
        acts = bool(healthy.any())
        now = float(level[i, r])
        yield FINDINGS.finding(
            "wrong-unit",
            f"{channel.name} in run {run} starts at {reading(now, channel)}, {source} it is {middle:.3g} °C: this "
            f"looks like {mistake.name} (factor {mistake.gain:.4g}, offset {mistake.offset:.5g}; then it starts at "
            f"{mistake.undone(now):.3g} °C).",
            Where(channel.name, run),
            {"start": now, "reference": middle, "gain": mistake.gain, "offset": mistake.offset}
            | {"mistake": mistake.name, "unit": mistake.unit, "measured_gain": gain},
            f"{mistake.remedy_in_one_run(channel.name, run)} The channel is left out of this run."
            if acts
            else f'If so, declare unit = "{mistake.unit}" for this channel in the machine file.',
            "leave-out-channel" if acts else "none",
            level="error" if acts else "warning",
        )


def _starts_agree(level: Array, i: int, mistake: Mistake) -> bool:
    """Whether a channel starts where the others do in two runs and in most, the warm ones aside, the mistake undone."""
    siblings = np.delete(level, i, axis=0)
    runs = np.flatnonzero(np.isfinite(level[i]) & np.isfinite(siblings).any(axis=0))
    middle = np.nanmedian(siblings[:, runs], axis=0)
    agreeing = np.sum(np.abs((level[i, runs] - mistake.offset) / mistake.gain - middle) < _SAME_START_K)
    return bool(agreeing >= 2 and agreeing > 0.5 * np.isfinite(level[i]).sum())


def _gain(relations: Relations, column: int, r: int, affected: list[int]) -> float | None:
    """Movement of a channel over what its siblings say, learned on the other runs; None if it does not follow them."""
    i = relations.columns.index(column)
    siblings = relations.siblings(i, without=[relations.columns.index(other) for other in affected])
    others = relations.others(i, r)
    if not siblings or not others or not relations.present[i, r]:
        return None
    told = relations.prediction(siblings, relations.weights_without(i, siblings, [r]), r)
    own = relations.movement(r)[i]
    gain = float(told @ own / max(float(told @ told), 1e-300))
    follows = float(np.sum((own - gain * told) ** 2)) < 0.1 * float(own @ own)
    return gain if follows and np.ptp(told) > 1.0 else None


def wrong_length_units(survey: Survey) -> Iterator[Finding]:
    """Findings ``wrong-unit`` for displacements, by span and noise of each run. O(channels · runs)."""
    thermal = survey.columns(*THERMAL_ROLES)
    warmed = {run: max((survey.scale(run, c).span for c in thermal), default=0.0) for run in survey.runs}
    moved = {survey.channels[c].axis for c in survey.columns("position_command", "position") if not thermal}
    for column in survey.columns("displacement"):
        channel = survey.channels[column]
        if channel.axis is not None and channel.axis in moved:
            continue  # a following error: all of it goes with the feed, the smallest steps, too
        scales = {run: survey.scale(run, column) for run in survey.runs}
        usable = [run for run in survey.runs if scales[run].count >= 20 and scales[run].distinct > 5]
        told = False
        spans = medians_of_others(np.array([scales[run].span for run in usable])).tolist()
        floors = medians_of_others(np.array([scales[run].floor for run in usable])).tolist()
        sound = [(one.span, one.floor) for run, one in scales.items() if run in usable and _is_usual(one.span)]
        for run, span, floor in zip(usable, spans, floors, strict=True) if len(usable) > 1 else ():
            here = scales[run]
            if sound and not _is_usual(span):  # most runs have the mistake
                span, floor = np.median(sound, axis=0).tolist()
            for mistake in (one for one in _LENGTH if _is_possible(survey, column, run, one)):
                # the noise of a gauge does not depend on what the machine did, the span does
                decade = abs(np.log10(mistake.gain)) > 2
                noise_off = here.floor / max(floor * mistake.gain, 1e-300)
                span_off = here.span / max(span * mistake.gain, 1e-300)
                quiet, noisy, short, long = (0.25, 8, 0.05, 20) if decade else (0.6, 1.6, 0.2, 5)
                fits = quiet < noise_off < noisy and short < span_off < long
                # of two runs that differ, the implausible one is wrong
                if fits and (len(usable) > 2 or not _is_usual(here.span)):
                    told = True
                    yield FINDINGS.finding(
                        "wrong-unit",
                        f"{channel.name} in run {run} moves by {here.span:.3g} µm, in the other runs by "
                        f"{difference(span, channel)}, and its noise is smaller or larger by the same factor: this "
                        f"looks like {mistake.name} (factor {mistake.gain:.3g}).",
                        Where(channel.name, run),
                        {"span_um": here.span, "usual_span_um": span, "gain": mistake.gain}
                        | {"mistake": mistake.name, "unit": mistake.unit},
                        f"{mistake.remedy_in_one_run(channel.name, run)} The channel is left out of this run.",
                        "leave-out-channel",
                        level="error",
                    )
                    break
        if told or not usable or not thermal:
            continue
        largest = max(scales[run].span for run in usable)
        rise = max(warmed[run] for run in usable)
        small, large = largest < 0.5 and rise >= 3.0, largest > 20_000 and rise < 60.0
        mistake = _LENGTH[0 if small else 1]
        if not (small or large) or not any(_is_possible(survey, column, run, mistake) for run in usable):
            continue
        yield FINDINGS.finding(
            "wrong-unit",
            f"{channel.name} moves by {difference(largest, channel)} at most, in every run, while temperatures move by "
            f"{rise:.3g} K: this looks like {mistake.name} (factor {mistake.gain:g}).",
            Where(channel.name),
            {"span_um": largest, "gain": mistake.gain, "mistake": mistake.name, "temperature_span_k": rise},
            f'If so, declare unit = "{mistake.unit}" for this channel in the machine file.',
            level="warning",
        )


def _is_usual(span_um: float) -> bool:
    """Whether a displacement moves by as much as those of machines do."""
    return 0.5 <= span_um <= 5000.0


def _is_possible(survey: Survey, column: int, run: str, mistake: Mistake) -> bool:
    """Whether the channel was not read in the very unit that the mistake says it is in."""
    units = survey.recording.provenance.get("runs", {}).get(run, {}).get("units", {})
    unit = units.get(survey.channels[column].name)
    return unit is None or parse_unit(mistake.unit) != unit


def _explaining(value: float, reference: float, mistakes: tuple[Mistake, ...]) -> Mistake | None:
    """The mistake that takes a far-off level back to its reference, or None."""
    if not np.isfinite(value) or abs(value - reference) < _OFF_K:
        return None
    best = min(mistakes, key=lambda mistake: abs(mistake.undone(value) - reference))
    return best if abs(best.undone(value) - reference) < _NEAR_K else None
