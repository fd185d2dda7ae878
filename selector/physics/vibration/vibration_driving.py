"""What would the model have done in recorded runs: which channels are its shafts and sources, and what is told."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.physics.channel_differences import as_recorded, clock_jitter
from selector.physics.checks import errors_name, require_within
from selector.physics.model_text import key_text
from selector.physics.ranges import true_stretches
from selector.physics.simulation_kind import Progress, unheard
from selector.physics.vibration.final_motion import MotionSignal
from selector.physics.vibration.finding_table import FINDINGS
from selector.physics.vibration.model_file import file_shafts, mean_rpm
from selector.physics.vibration.recorded_force import GAP, Stretch, gaps, ring_time_s, stamped_answer, stretches
from selector.physics.vibration.structure import ShaftCourse
from selector.physics.vibration.vibration_model import (
    FINALS,
    RELATIVE,
    VibrationModel,
    VibrationSimulation,
    force_name,
    speed_name,
)
from selector.recording import Channel, Recording
from selector.types import Mask, Matrix, Vector


@dataclass(frozen=True)
class RecordedChannels:
    """What was recorded of a model."""

    #: speeds, forces and motions: Shaft, source, and output of the model → name of the recorded channel
    speeds: Mapping[str, str]
    forces: Mapping[str, str]
    motions: Mapping[str, str]
    findings: tuple[Finding, ...]  #: Channels that belong to nothing, or could be of several


def recorded_channels(model: VibrationModel, recording: Recording) -> RecordedChannels:
    """The channels of a recording that belong to this model: by name, else by place or axis, else by being alone."""
    file = model.file
    speeds = _matched({name: (name, speed_name(name)) for name in file.shafts}, _of_role(recording, "spindle_speed"))
    forces = _matched({name: (name, force_name(name)) for name in file.sources}, _of_role(recording, "force"))
    finals = {name: (name, member) for name, member in model.finals.items()} | {RELATIVE: (RELATIVE,)}
    motions = _matched(finals, _of_role(recording, "displacement"))
    alone = {role: _of_role(recording, role) for role in ("spindle_speed", "force", "displacement")}
    leading = [name for name, shaft in file.shafts.items() if shaft.of is None]
    if file.cutting is not None and file.cutting.shaft in leading:
        leading = [file.cutting.shaft]
    if not speeds and len(alone["spindle_speed"]) == len(leading) == 1:
        speeds = {leading[0]: alone["spindle_speed"][0].name}
    if not forces and len(alone["force"]) == len(file.sources) == 1:
        forces = {next(iter(file.sources)): alone["force"][0].name}
    if not motions and len(alone["displacement"]) == 1:
        motions = {RELATIVE: alone["displacement"][0].name}
    unused = (
        *_unused(alone["spindle_speed"], speeds.values(), "shaft", file.shafts),
        *_unused(alone["force"], forces.values(), "source", file.sources),
        *_not_compared(alone["displacement"], motions),
    )
    return RecordedChannels(speeds, forces, motions, unused)


def _of_role(recording: Recording, role: str) -> list[Channel]:
    return [channel for channel in recording.channels if channel.role == role]


def _matched(wanted: Mapping[str, tuple[str, ...]], channels: Iterable[Channel]) -> dict[str, str]:
    """Key → channel that is called as one of its names, or else the only one whose place or axis is."""
    found: dict[str, str] = {}
    there = list(channels)
    for key, names in wanted.items():
        called = {name.casefold() for name in names}
        by_name = [one.name for one in there if one.name.casefold() in called]
        by_place = [one.name for one in there if called & {(one.place or "").casefold(), (one.axis or "").casefold()}]
        if by_name or len(by_place) == 1:
            found[key] = (by_name or by_place)[0]
    # a channel whose place fits two keys is that of neither, unless one of them has its name
    several = {name for name in found.values() if list(found.values()).count(name) > 1}
    return {
        key: name
        for key, name in found.items()
        if name not in several or name.casefold() in {one.casefold() for one in wanted[key]}
    }


def _not_compared(channels: Iterable[Channel], motions: Mapping[str, str]) -> Iterator[Finding]:
    """One finding of all displacements that are neither of the tool nor of the workpiece."""
    names = [one.name for one in channels if one.name not in motions.values()]
    free = [key for key in (*FINALS, RELATIVE) if key not in motions]
    if not names or not free:
        return
    listed = ", ".join(map(repr, names[:6])) + (" …" if len(names) > 6 else "")
    are = "(displacements) are" if len(names) > 1 else "(displacement) is"
    places = " or ".join(f'"{key}"' for key in free)
    yield FINDINGS.finding(
        "motion-not-compared",
        f"{listed} {are} not known to be of tool or workpiece, and not compared.",
        Where(channel=names[0]),
        {"channels": names, "places": free},
        f"say in the machine file what it moved, e.g. [channels.{key_text((names[0],))}] place = {places}",
        level="info" if motions else "warning",
    )


def _unused(
    channels: Iterable[Channel], used: Collection[str], what: str, known: Collection[str]
) -> tuple[Finding, ...]:
    return tuple(
        FINDINGS.finding(
            "channel-of-nothing",
            f"{one.name!r} ({one.role}) belongs to no {what} of the model, or could be of several, and does not act.",
            Where(channel=one.name),
            {"known": list(known)[:20]},
            f'give it the place of its {what} in the machine file: place = "{next(iter(known), "…")}"',
        )
        for one in channels
        if one.name not in used
    )


_LONG = 0.5  #: Share of the run from which on its beginning is a warning.


def gap_findings(time_s: Vector, ring_s: float | None) -> Iterator[Finding]:
    """The longest gap between stamps, and how many there are; `ring_s` is None where no force was recorded [s]."""
    found = gaps(time_s)
    if not len(found):
        return
    begin_s, end_s = found[int(np.argmax(found[:, 1] - found[:, 0]))].tolist()
    until_s = end_s if ring_s is None else min(end_s + ring_s, float(time_s[-1]))
    yield FINDINGS.finding(
        "recorded-gap",
        f"Nothing was recorded from {begin_s:.6g} to {end_s:.6g} s"
        + (f", the longest of {len(found)} gaps" if len(found) > 1 else "")
        + ". Speeds and forces run straight across"
        + ("." if ring_s is None else f": the motion is not to be believed before {until_s:.6g} s."),
        Where(from_s=begin_s, to_s=until_s),
        {"gap_s": end_s - begin_s, "gaps": len(found)},
        "leave this stretch out when you compare, or cut the run at its gaps",
    )


def clock_findings(time_s: Vector, parts: Sequence[Stretch]) -> Iterator[Finding]:
    """Stamps that stray from an even grid, those that have none, and rows that were lost; for recorded forces."""
    stray = max(part.stray for part in parts)
    if not all(part.even for part in parts):
        steps = np.diff(time_s)
        yield FINDINGS.finding(
            "recorded-clock-uneven",
            f"The clock is uneven: steps from {steps.min():.4g} to {steps.max():.4g} s. Recorded forces are brought to "
            "even times by cubic splines; what has fewer than some seven of the longer steps a period is answered too "
            "weakly, or as another frequency.",
            evidence={"least_s": float(steps.min()), "most_s": float(steps.max())},
            level="warning",
        )
    yield from clock_jitter(stray, "its ticks count as the times of the forces")
    missing = np.concatenate([np.diff(part.at) - 1.0 for part in parts if part.even] or [np.zeros(0)])
    lost = int(missing[missing <= GAP - 1.0].sum())
    if lost:
        yield FINDINGS.finding(
            "recorded-rows-lost",
            f"{lost} row{'s' if lost > 1 else ''} of the clock lack{'' if lost > 1 else 's'}: put in by cubic splines.",
            evidence={"lost": lost},
        )


def steady_before(ring_s: float, duration_s: float) -> Finding:
    """Until when the motion by recorded forces hangs on what acted before them."""
    return FINDINGS.finding(
        "steady-before-recording",
        "Recorded forces are taken to have gone on before and after the run as they went at its ends. What really "
        f"acted is not known: a thousandth of what it left is still there after {ring_s:.3g} s.",
        Where(from_s=0.0, to_s=min(ring_s, duration_s)),
        {"ring_s": ring_s if np.isfinite(ring_s) else None},
        level="warning" if ring_s > _LONG * duration_s else "info",
    )


_MOST_RPM, _MOST_FORCE_N = 1e6, 1e9
_FEWEST = 8
_TURNED_BACK = 0.01  #: Share of the largest speed, below which a sign is noise.


def driven_runs(
    model: VibrationModel, recording: Recording, *, seed: int | None = None, progress: Progress = unheard
) -> VibrationSimulation:
    """A simulation of every run of a recording: recorded speeds turn the shafts, recorded forces replace spectra.

    Samples at the time stamps of the recording; channels are called as the recorded ones that they belong to.

    The shifts of the other sources are drawn by the seed: a recording of speeds does not tell them. Without a `seed`
    they are those of the file's, and there is no noise.

    The model's own run does not count; how channels are found: `recorded_channels`. `progress` is told how many runs of
    how many are done.

    InputError: the recording cannot drive this model: neither speed nor force, or too few samples.
    """
    channels = recorded_channels(model, recording)
    if not channels.speeds and not channels.forces:
        raise _nothing_drives(model, recording)
    phases = model.phases_rad(model.file.run.seed if seed is None else seed)
    signals: dict[str, MotionSignal] = {}
    findings: list[Finding] = list(channels.findings)
    weights: dict[str, float] = {}
    speeds: dict[str, dict[str, float]] = {}
    for number, run in enumerate(recording.runs):
        progress(number, len(recording.runs), run)
        with errors_name(f"run {run}", of_keys=True):
            driven = _DrivenRun(model, recording, run, channels)
            signals[run] = driven.signal(phases)
        findings += [replace(one, where=replace(one.where, run=run)) for one in driven.findings]
        weights[run], speeds[run] = driven.duration_s, driven.mean_rpm
    whole = sum(weights.values())
    shaft_rpm = {
        name: sum(weights[run] * speeds[run][name] for run in recording.runs) / whole for name in model.file.shafts
    }
    names = {
        **channels.motions,
        **{f"{source}_force": name for source, name in channels.forces.items()},
        **{f"{shaft}_speed": name for shaft, name in channels.speeds.items()},
    }
    if channels.forces:
        told = FINDINGS.finding(
            "lines-of-the-file",
            f"The recorded force of {', '.join(channels.forces)} acts in the recording that was simulated; lines, "
            "amplitudes and errors of the surface are told of the spectra of the model file.",
            evidence={"sources": list(channels.forces)},
        )
        findings.append(told)
    return VibrationSimulation(
        as_recorded(model.recorded(signals, seed), recording, names),
        model.motions(shaft_rpm),
        shaft_rpm,
        tuple(findings),
        names,
        tuple(dict.fromkeys((*channels.speeds.values(), *channels.forces.values()))),
    )


class _DrivenRun:
    """One run of a recording, and what is to be said of it."""

    def __init__(self, model: VibrationModel, recording: Recording, run: str, channels: RecordedChannels) -> None:
        self.model, self.recording, self.run, self.channels = model, recording, run, channels
        self.stamps_s = recording.time_s(run)
        self.time_s = self.stamps_s - self.stamps_s[0]
        if len(self.time_s) < _FEWEST:
            raise OptionError(
                f"{len(self.time_s)} samples",
                expected=f"at least {_FEWEST}",
                where=f"run {run}",
                advice="leave this run out",
            )
        self.duration_s = float(self.time_s[-1])
        self.findings: list[Finding] = []
        self.courses = file_shafts(model.file, self._recorded_courses())
        self.mean_rpm = {name: mean_rpm(course, 0.0, self.duration_s) for name, course in self.courses.items()}
        self._require_turning_cut()

    def signal(self, phases_rad: Mapping[str, float]) -> MotionSignal:
        """Motion and forces at the time stamps of the run."""
        recorded = {source: self._values(name, _MOST_FORCE_N) for source, name in self.channels.forces.items()}
        forces = {source: values for source, values in recorded.items() if values is not None}
        others = tuple(source for source in self.model.sources if source.name not in forces)
        found = self.model.signal(self.time_s, self.courses, phases_rad, sources=others, leave_out=True)
        self.findings += found.findings
        answers = self._answers(forces)
        motion = found.motion_m + sum((moved for moved, _ in answers.values()), np.zeros_like(found.motion_m))
        rows = dict(zip(found.sources, found.force_n, strict=True))
        rows |= {source: force for source, (_, force) in answers.items()}
        names = tuple(source.name for source in self.model.sources)
        force = np.array([rows[name] for name in names]).reshape(len(names), len(self.time_s))
        return replace(found, time_s=self.stamps_s, sources=names, force_n=force, motion_m=motion)

    def _answers(self, forces: Mapping[str, Vector]) -> dict[str, tuple[Matrix, Vector]]:
        """Source → motion by its recorded force, and that as it acted."""
        if not forces:
            self.findings += gap_findings(self.time_s, None)
            return {}
        ring_s = ring_time_s(self.model.structure)
        parts = stretches(self.time_s, ring_s)
        finals, method = self.model.finals, self.model.method(self.mean_rpm)
        self.findings += (*gap_findings(self.time_s, ring_s), *clock_findings(self.time_s, parts))
        self.findings.append(steady_before(ring_s, self.duration_s))
        return {
            source.name: stamped_answer(self.model.structure, source, forces[source.name], parts, finals, method)
            for source in self.model.sources
            if source.name in forces
        }

    def _recorded_courses(self) -> dict[str, ShaftCourse]:
        found = {}
        for shaft, name in self.channels.speeds.items():
            values = self._values(name, _MOST_RPM)
            if values is not None:
                seen = np.isfinite(values)
                self.findings += _without_sign(name, values[seen])
                found[shaft] = ShaftCourse(self.time_s[seen], np.abs(values[seen]))
        return found

    def _require_turning_cut(self) -> None:
        """Raises OptionError if the shaft of the cut stands through the run: no surface is made then."""
        cut = self.model.file.cutting
        if cut is None or self.mean_rpm[cut.shaft] > 0:
            return
        leading: str | None = cut.shaft
        while leading is not None and leading not in self.channels.speeds:
            leading = self.model.file.shafts[leading].of
        raise OptionError(
            f"a speed of 0 r/min through the whole run, and the cut is at shaft {cut.shaft!r}",
            expected="a shaft that turns: [cutting] asks what the vibration leaves on a part",
            where=f"channel {cut.shaft if leading is None else self.channels.speeds[leading]}",
            advice="leave this run out, or leave [cutting] out of the model file if the spindle stood; otherwise check "
            "the channel and its unit",
        )

    def _values(self, channel: str, most: float) -> Vector | None:
        """A recorded course with NaN where it lacks; None where nothing of it was recorded; told by findings."""
        values = np.asarray(self.recording.values(self.run, [channel])[:, 0], dtype=np.float64)
        with errors_name(f"channel {channel}"):
            require_within(values, self.stamps_s, most, self.recording.channel(channel).unit)
        seen = np.isfinite(values)
        if not seen.any():
            self.findings.append(
                FINDINGS.finding(
                    "input-not-recorded",
                    f"{channel} has no values in this run: what the model file says acts instead.",
                    Where(channel=channel),
                    suggestion="leave the run out, or record the channel",
                    level="warning",
                )
            )
            return None
        if seen.all():
            return values
        self.findings.append(self._bridged(channel, ~seen))
        return values

    def _bridged(self, channel: str, lacks: Mask) -> Finding:
        begin, end = max(true_stretches(lacks).tolist(), key=lambda one: one[1] - one[0])
        first, last = max(begin - 1, 0), min(end, len(lacks) - 1)
        return FINDINGS.finding(
            "input-bridged",
            f"{channel} lacks {lacks.sum()} of {len(lacks)} values, up to {end - begin} in a row: "
            "put in from those before and after.",
            Where(channel=channel, from_s=float(self.time_s[first]), to_s=float(self.time_s[last])),
            {"missing": int(lacks.sum()), "longest": end - begin},
        )


def _without_sign(channel: str, rpm: Vector) -> Iterator[Finding]:
    """That the amount of a speed below 0 counts; the noise of a standing shaft is not told."""
    back = rpm < -_TURNED_BACK * np.abs(rpm).max()
    if not back.any():
        return
    both = bool((rpm > _TURNED_BACK * np.abs(rpm).max()).any())
    said = f"in {back.sum()} of {len(rpm)} samples, and above it in others" if both else "where the shaft turns"
    yield FINDINGS.finding(
        "speed-without-sign",
        f"{channel} is below 0 {said}: the shaft is taken to turn as fast the one way as the other, by the amount.",
        Where(channel=channel),
        {"below_0": int(back.sum()), "lowest_rpm": float(rpm.min()), "highest_rpm": float(rpm.max())},
        "cut the run where the shaft turns round if this matters" if both else "",
        level="warning" if both else "info",
    )


def _nothing_drives(model: VibrationModel, recording: Recording) -> OptionError:
    here = ", ".join(f"{channel.name} ({channel.role})" for channel in recording.channels[:12])
    shafts, sources = ", ".join(model.file.shafts) or "none", ", ".join(model.file.sources)
    return OptionError(
        f"no channel with the speed of a shaft ({shafts}) or the force of a source ({sources}): {here}",
        expected="a spindle_speed or force channel that is called as one of them, or has it as its place",
        where=f"model {model.name!r}",
        advice='give the channel role and place in the machine file: role = "force", place = "SOURCE"',
    )
