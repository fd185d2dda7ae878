"""Recorded runs through the written files and through the reference, and what a person has to know of it."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from selector.controllers.application import (
    SLIGHT_SHARE,
    Accuracy,
    Application,
    apply_model,
    displacement_of,
    displacement_starts,
    known_starts,
    position_channels,
    require_channels,
    sensor_starts,
    unit_of_difference,
)
from selector.controllers.evaluator import axes_of
from selector.controllers.finding_table import FINDINGS, OUTSIDE_VALID_RANGE
from selector.controllers.guard.decided import Mode, SensorCode, decided_limits, is_turned, mode_words
from selector.controllers.model_file import Input, ModelFile
from selector.controllers.replay.parts import TIME_STEP_S, Answers, Part, Rows, reference_answers, rows_at
from selector.controllers.self_check import clamp_reached
from selector.findings import Finding, Where
from selector.models.run_before import with_ungauged
from selector.recording import Recording
from selector.types import Array, Indices, Mask

OUTAGE_S = 600.0
CLOCK_S = 3600.0
NOISE_SHARE, JUMP_SHARE = 0.1, 0.5  #: Of the width of a sensor's valid range.
MOST_ROWS = 2500  #: Of a longer run every second, third … sample is taken.
KINDS = ("dead", "stuck", "jumping", "noisy", "power cycle", "clock forward", "clock back", "stopped and resumed")


@dataclass(frozen=True)
class Rehearsed:
    """One fault and one output, over the samples from the fault to the end of the run."""

    fault: str  #: One of `KINDS`
    sensor: str | None  #: None: of the whole control
    run: str
    from_s: float  #: From the start of the run
    output: str
    left: Accuracy  #: With the fault; of a run without recorded displacement against the program without the fault
    healthy_rmse_um: float | None  #: Without the fault, over the same samples
    mode: str  #: What it mostly follows when it does not follow what it would without the fault
    reacts_after_s: float | None  #: From the fault until mode or code of the sensor change; None: never
    max_abs_difference_um: float  #: Between the program and what it has to give in these calls
    allowed_um: float  #: What its numbers explain of it

    def as_dict(self) -> dict[str, object]:
        """An entry of `replay.rehearsal` of `selector.export/1`."""
        names = ("fault", "sensor", "run", "from_s", "output", "mode", "max_abs_difference_um")
        own = {name: getattr(self, name) for name in names}
        sizes = {"rmse_um": self.left.rmse_um, "max_um": self.left.max_um, "before_max_um": self.left.before_max_um}
        return own | sizes | {"healthy_rmse_um": self.healthy_rmse_um, "reacts_after_s": self.reacts_after_s}


def rehearsed(
    model: ModelFile,
    files: Mapping[str, str],
    part: Part,
    run: str,
    rows: Rows,
    recorded_um: Array,
    ungauged: int,
    zero_um: float | Array,
    say: Callable[[str], None] | None = None,
) -> tuple[Rehearsed, ...]:
    """Every fault at half of what was gauged of a run, through the main program; columns are outputs."""
    step = max(1, -(-len(rows) // MOST_ROWS))
    chosen = np.arange(0, len(rows), step)
    rows, recorded_um = rows_at(rows, chosen), recorded_um[chosen]
    time_s = np.cumsum(rows.dt_s)
    if len(rows) - ungauged // step < 3:
        return ()
    time_s -= time_s[ungauged // step]
    at = int(np.searchsorted(time_s, 0.5 * time_s[-1]))
    healthy = _given(model, files, part, rows)
    signs = np.array([1.0 if is_turned(output) else -1.0 for output in model.outputs])
    healthy_um = signs * (healthy.correction_um - zero_um)
    recorded_um = np.where(np.isfinite(recorded_um).any(axis=0), recorded_um, healthy_um)
    found = []
    for kind, sensor, faulty, kept in _faults(model, rows, at):
        if say is not None:
            say(f"{sensor or 'control'} {kind}")
        answers = _given(model, files, part, faulty)
        whole = reference_answers(model, faulty)
        expected_um = part.expected(model, faulty, whole, answers)
        off = np.nan_to_num(np.abs(answers.correction_um - expected_um), nan=np.inf).max(axis=0).tolist()
        allowed = part.allowed_um(model, faulty, whole)
        given_um, seen = signs * (answers.correction_um - zero_um), kept >= at
        samples = kept[seen]
        mode, reacts_s = _reaction(model, answers, healthy, kept, at, time_s, sensor) if part.tells_mode else ("", None)
        for k, output in enumerate(model.outputs):
            left = Accuracy.of(given_um[seen, k], recorded_um[samples, k])
            usual = Accuracy.of(healthy_um[samples, k], recorded_um[samples, k])
            numbers = off[k], allowed[output.name]
            place = run, float(time_s[at]), output.name
            found.append(Rehearsed(kind, sensor, *place, left, usual.rmse_um, mode, reacts_s, *numbers))
    return tuple(found)


def _given(model: ModelFile, files: Mapping[str, str], part: Part, rows: Rows) -> Answers:
    none_before = Answers.empty(0, len(model.outputs), len(model.inputs), 0)
    return part.execute(model, rows, files, none_before)


def _faults(model: ModelFile, rows: Rows, at: int) -> Iterator[tuple[str, str | None, Rows, Indices]]:
    """Kind, sensor, the calls, and which samples they are of."""
    everything, after = np.arange(len(rows)), np.arange(len(rows)) >= at
    rng = np.random.default_rng(0)
    for k, item in enumerate(model.inputs):
        own, width = rows.readings[:, k], item.valid_max - item.valid_min
        courses = {
            "dead": np.nan,
            "stuck": own[at],
            "jumping": own + JUMP_SHARE * width,
            "noisy": own + NOISE_SHARE * width * rng.standard_normal(len(rows)),
        }
        for kind, course in courses.items():
            readings = rows.readings.copy()
            readings[:, k] = np.where(after, course, own)
            yield kind, item.name, replace(rows, readings=readings), everything
    time_s = np.cumsum(rows.dt_s)
    is_out = after & (time_s < time_s[at] + OUTAGE_S)
    kept = np.flatnonzero(~is_out)
    if (kept > at).any():
        cycled = rows_at(rows, kept)
        again = int(np.argmax(kept > at))
        cycled.is_restart[again], cycled.standstill_s[again] = True, cycled.dt_s[again]
        cycled.dt_s[again] = 0.0
        yield "power cycle", None, cycled, kept
    for kind, seconds in (("clock forward", rows.dt_s[at] + CLOCK_S), ("clock back", -CLOCK_S)):
        yield kind, None, replace(rows, dt_s=np.where(everything == at, seconds, rows.dt_s)), everything
    yield "stopped and resumed", None, replace(rows, is_ready=rows.is_ready & ~is_out), everything


def _reaction(
    model: ModelFile, answers: Answers, healthy: Answers, kept: Indices, at: int, time_s: Array, sensor: str | None
) -> tuple[str, float | None]:
    """What is followed instead, and when that or the code of the sensor begins."""
    changed = (answers.mode != healthy.mode[kept]) & (kept >= at)
    noticed = changed.copy()
    if sensor is not None:
        code = answers.sensors[:, [item.name for item in model.inputs].index(sensor)]
        noticed |= (code > SensorCode.RECOVERING) & (kept >= at)
    reacts_s = float(time_s[kept[int(np.argmax(noticed))]] - time_s[at]) if noticed.any() else None
    modes, counts = np.unique(answers.mode[changed if changed.any() else kept >= at], return_counts=True)
    return mode_words(int(modes[int(np.argmax(counts))]), model), reacts_s


def rehearsal_findings(found: Sequence[Rehearsed]) -> Iterator[Finding]:
    """Faults in which the program is not what it has to be, and per output the fault that leaves most."""
    for one in found:
        if not one.max_abs_difference_um <= one.allowed_um:
            yield FINDINGS.finding(
                "replay-differs",
                f"With {one.sensor or 'the control'} {one.fault}, {one.output} and the reference differ by up to "
                f"{one.max_abs_difference_um:.3g} µm; {one.allowed_um:.3g} µm is what its numbers explain.",
                Where(channel=one.sensor, run=one.run, from_s=one.from_s),
                one.as_dict(),
            )
    for output in dict.fromkeys(one.output for one in found):
        own = [one for one in found if one.output == output and one.left.max_um is not None]
        if not own:
            continue
        worst = max(own, key=lambda one: one.left.max_um or 0.0)
        when = "never noticed" if worst.reacts_after_s is None else f"noticed after {worst.reacts_after_s:.0f} s"
        what = worst.fault if worst.sensor is None else f"{worst.sensor} {worst.fault}"
        is_worse = (worst.left.max_um or 0.0) > (worst.left.before_max_um or 0.0)
        yield FINDINGS.finding(
            "fault-costs",
            f"{output}, worst of {len(own)} rehearsed faults: {what} leaves up to {worst.left.max_um:.3g} µm "
            f"({worst.left.before_max_um:.3g} µm without any correction); {when}.",
            Where(channel=worst.sensor, run=worst.run, from_s=worst.from_s),
            worst.as_dict(),
            level="warning" if is_worse else "info",
        )


@dataclass(frozen=True)
class PartDifference:
    """One file and one output over all runs."""

    file: str
    output: str
    executed_by: str
    #: To what it has to give; that of the run in which it is farthest beyond what is allowed
    max_abs_difference_um: float
    allowed_um: float  #: What its number type explains in that run
    guard_difference_um: float  #: Between what it has to give and the whole guard, in any run
    lacks: str  #: Why these differ; empty = they are the same

    @property
    def is_explained(self) -> bool:
        """No difference is larger than allowed."""
        return self.max_abs_difference_um <= self.allowed_um

    def as_dict(self) -> dict[str, object]:
        """An entry of `replay.parts` of `selector.export/1`."""
        told = ("file", "output", "executed_by", "max_abs_difference_um", "allowed_um", "guard_difference_um")
        return {name: getattr(self, name) for name in told}


@dataclass(frozen=True, eq=False)
class ExecutedPart:
    """One file on the rows of one run."""

    part: Part
    answers: Answers  #: What it gave
    expected_um: Array  #: (n_rows, n_outputs): What it has to give
    whole: Answers  #: What the whole guard gives
    allowed_um: Mapping[str, float]  #: Per output

    def differences(self, model: ModelFile) -> Iterator[PartDifference]:
        """One per output."""
        largest = _largest(self.answers.correction_um - self.expected_um)
        of_guard = _largest(self.expected_um - self.whole.correction_um)
        part, executed_by = self.part, self.part.executed_by()
        for output, size, guard in zip(model.outputs, largest, of_guard, strict=True):
            allowed = self.allowed_um[output.name]
            yield PartDifference(part.file, output.name, executed_by, size, allowed, guard, part.lacks)


@dataclass(frozen=True)
class BeyondValid:
    """An input that was beyond its valid range, which the guard takes for the end of the range."""

    input: Input
    share_of_samples: float


@dataclass(frozen=True, eq=False)
class ReplayedRun:
    """One run."""

    run: str
    time_s: Array  #: (n_samples,)
    #: correction_um and reference_um: (n_samples, n_outputs): Of the main program, and what it has to give in float64;
    #: less `zero_um`
    correction_um: Array
    reference_um: Array
    #: (n_samples, n_outputs): Recorded displacement from its own start (`displacement_starts`); NaN where there is none
    recorded_um: Array
    accuracy: dict[str, Accuracy]  #: Per output, recorded displacement with and without this correction
    #: Share of the samples in which the program did not follow the whole model, as it says itself; where it does not,
    #: in which the whole guard would not have followed it
    faulty_share: float
    beyond_valid: tuple[BeyondValid, ...] = ()
    #: How long the program corrected nothing at the start, because readings have to be good for some time first
    begins_s: float = 0.0
    applied: Mapping[str, Accuracy] = field(default_factory=dict)  #: Per output, what `apply` leaves of this run
    because: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  #: Per output, why the program leaves more
    clamped: tuple[Finding, ...] = ()  #: What clamps cut off
    ungauged: int = 0  #: First samples, from before the gauge began: they only warm the memory
    zero_um: float | Array = 0.0  #: Per output, what the program corrects where such a gauge has its zero

    @property
    def max_abs_difference_um(self) -> float:
        """Largest difference between program and reference [µm]; infinite if the program gave no number."""
        return max(_largest(self.correction_um - self.reference_um), default=0.0)


@dataclass(frozen=True, eq=False)
class Replay:
    """All runs, what executed the main program, and how far each written file is from what it has to give."""

    runs: tuple[ReplayedRun, ...]
    executed_by: str
    parts: tuple[PartDifference, ...] = ()
    tells_mode: bool = True  #: Whether the main program says what it follows
    rehearsal: tuple[Rehearsed, ...] = ()  #: Faults on the run with the largest displacement

    @property
    def rows(self) -> int:
        """Samples in all."""
        return sum(len(run.time_s) for run in self.runs)

    @property
    def max_abs_difference_um(self) -> float:
        """Largest difference of the main program in all runs [µm]."""
        return max((run.max_abs_difference_um for run in self.runs), default=0.0)

    def as_dict(self) -> dict[str, object]:
        """The part of `selector.export/1`."""
        told = {name: getattr(self, name) for name in ("rows", "max_abs_difference_um", "executed_by")}
        of_runs = [
            {"run": run.run, "output": name, "because": list(run.because.get(name, ()))}
            | {"program_rmse_um": of.rmse_um, "program_max_um": of.max_um, "before_rmse_um": of.before_rmse_um}
            | {"apply_rmse_um": run.applied[name].rmse_um, "apply_max_um": run.applied[name].max_um}
            for run in self.runs
            for name, of in run.accuracy.items()
        ]
        rehearsal = [one.as_dict() for one in self.rehearsal]
        return told | {"parts": [part.as_dict() for part in self.parts], "runs": of_runs, "rehearsal": rehearsal}


def replayed(
    model: ModelFile,
    files: Mapping[str, str],
    recording: Recording,
    parts: Sequence[Part],
    progress: Callable[[str], None] | None = None,
) -> Replay:
    """Every run of a recording from its own start through the written files; the first part is the main program."""
    require_channels(model, recording)
    written = [part for part in parts if part.file in files]
    starts = displacement_starts(model, recording)
    applied = apply_model(model, recording, known_starts(sensor_starts(model, recording)))
    found: list[ReplayedRun] = []
    differences: list[PartDifference] = []
    for run in recording.runs:
        if progress is not None:
            progress(f"run {run}")
        rows = rows_of_run(model, recording, run)
        whole = reference_answers(model, rows)
        main, *others = executed(model, files, written, rows, whole)
        differences += [one for of in (main, *others) for one in of.differences(model)]
        telling = main.answers if main.part.tells_mode else whole
        found.append(_run(model, recording, run, starts[run], main, telling, whole, applied))
    hardest = max(found, key=lambda of: float(np.nanmax(np.abs(of.recorded_um), initial=0.0)), default=None)
    faults: tuple[Rehearsed, ...] = ()
    if hardest is not None:
        rows = rows_of_run(model, recording, hardest.run)
        zero = hardest.ungauged, hardest.zero_um
        faults = rehearsed(model, files, written[0], hardest.run, rows, hardest.recorded_um, *zero, progress)
    return Replay(tuple(found), written[0].executed_by(), _over_runs(differences), written[0].tells_mode, faults)


def rows_of_run(model: ModelFile, recording: Recording, run: str) -> Rows:
    """The calls that a control would have made in a recorded run: ready and wanted throughout, at `TIME_STEP_S`."""
    channels, n_inputs = position_channels(model, recording), len(model.inputs)
    names = [*(item.name for item in model.inputs), *(channels[axis] for axis in axes_of(model))]
    time_s, values = called(model, recording, run, names)
    time_s, n = np.round(time_s / TIME_STEP_S) * TIME_STEP_S, len(time_s)
    readings, positions = values[:, :n_inputs], values[:, n_inputs:]
    always, never = np.ones(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    return Rows(np.diff(time_s, prepend=time_s[:1]), readings, positions, always, always, never, np.zeros(n))


def called(model: ModelFile, recording: Recording, run: str, names: Sequence[str]) -> tuple[Array, Array]:
    """(time_s, values) of the calls of a run; with memory also of those before its gauge began."""
    own = recording.time_s(run), recording.values(run, names)
    return with_ungauged(recording, run, names) if model.states else own


def executed(
    model: ModelFile, files: Mapping[str, str], parts: Sequence[Part], rows: Rows, whole: Answers
) -> list[ExecutedPart]:
    """Every part, the first one being the main program; `whole` = the answers of the whole guard."""
    found: list[ExecutedPart] = []
    for part in parts:
        answers = part.execute(model, rows, files, found[0].answers if found else whole)
        main = found[0].answers if found else answers
        expected = part.expected(model, rows, whole, main)
        found.append(ExecutedPart(part, answers, expected, whole, part.allowed_um(model, rows, whole)))
    return found


def _run(
    model: ModelFile,
    recording: Recording,
    run: str,
    starts: Mapping[str, float],
    main: ExecutedPart,
    telling: Answers,
    whole: Answers,
    applied: Application,
) -> ReplayedRun:
    correction_um, time_s = main.answers.correction_um, called(model, recording, run, ())[0]
    ungauged = len(time_s) - len(recording.time_s(run))
    recorded, zero_um = np.full(correction_um.shape, np.nan), np.zeros(len(model.outputs))
    accuracy: dict[str, Accuracy] = {}
    for k, output in enumerate(model.outputs):
        sign = 1.0 if is_turned(output) else -1.0
        recorded[ungauged:, k] = displacement_of(output, recording, run) - starts.get(output.name, 0.0)
        if ungauged and output.reference == "rise":
            # a gauge shows what changes from its zero on, the correction of that moment included
            begins_um = np.nan_to_num(applied_um(applied, run, output.name)[0])
            zero_um[k] = correction_um[ungauged, k] - sign * begins_um
        accuracy[output.name] = Accuracy.of(sign * (correction_um[:, k] - zero_um[k]), recorded[:, k])
    faulty = faulty_share(telling, whole)
    limited = np.mean(whole.sensors == SensorCode.LIMITED, axis=0) if len(time_s) else np.zeros(len(model.inputs))
    beyond = tuple(BeyondValid(of, share) for of, share in zip(model.inputs, limited.tolist(), strict=True) if share)
    begins_s = _begins_s(time_s, ungauged, main, whole)
    cut = [wanted_beyond_clamp(model, applied, run, name) for name in accuracy] if main.part.tells_mode else []
    clamped = tuple(one for one in cut if one is not None)
    seen = np.max(_largest(main.expected_um - whole.correction_um)) > SEEN_UM
    part = main.part if seen else replace(main.part, lacks="")
    because = {name: tuple(_because(applied, clamped, run, name, faulty, begins_s, part)) for name in accuracy}
    said = faulty, beyond, begins_s, applied.per_run[run], because, clamped, ungauged, zero_um
    return ReplayedRun(run, time_s, correction_um - zero_um, main.expected_um - zero_um, recorded, accuracy, *said)


def _because(
    applied: Application, clamped: Sequence[Finding], run: str, output: str, faulty: float, begins_s: float, part: Part
) -> Iterator[str]:
    """What a program does otherwise than the model alone in a run, in words."""
    for finding in applied.findings if part.tells_mode else ():
        if finding.id == OUTSIDE_VALID_RANGE and finding.where.run == run:
            width = finding.evidence["valid_max"] - finding.evidence["valid_min"]
            far = f"{100 * finding.evidence['largest_excess'] / width:.0f} %" if width > 0.0 else "any amount"
            yield f"{finding.where.channel} leaves the range of the model by up to {far} of its width"
    for finding in clamped:
        if finding.where.channel == output:
            yield f"the clamp cuts the correction in {100 * finding.evidence['share_of_samples']:.0f} % of the samples"
    if faulty > 0.0:
        yield f"a sensor is not believed in {100 * faulty:.1f} % of the samples"
    if begins_s > 0.0:
        yield f"nothing is corrected in the first {begins_s:.0f} s"
    if part.lacks:
        yield part.lacks


def applied_um(applied: Application, run: str, output: str) -> Array:
    """The displacement that `apply` predicts, from the zero of the gauge."""
    table, zero = applied.predictions, applied.zeros_um[run].get(output, 0.0)
    return table.loc[table["run"] == run, output].to_numpy(dtype=np.float64) - zero


def wanted_beyond_clamp(model: ModelFile, applied: Application, run: str, output: str) -> Finding | None:
    """What the clamp of an output cuts off in a run; None: hardly anything."""
    wanted, limits = applied_um(applied, run, output), decided_limits(model)[0][output]
    return clamp_reached(output, limits.clamp_um, wanted[np.isfinite(wanted)], f"of run {run}", run)


def _begins_s(time_s: Array, ungauged: int, main: ExecutedPart, whole: Answers) -> float:
    """How long the program waited for new sensors; 0 if it waits for none, and then says of nothing what it follows."""
    waits = _is_new(whole) & (main.answers.mode != Mode.MODEL)
    if not main.part.tells_mode or not waits.any():
        return 0.0
    first = len(waits) - 1 if waits.all() else int(np.argmin(waits))
    return max(float(time_s[first] - time_s[ungauged]), 0.0)


def faulty_share(telling: Answers, whole: Answers) -> float:
    """Share of the calls that did not follow the whole model; not those at the start, while all sensors are new.

    `telling` has the modes; `whole` has the sensor codes, which not every program tells.
    """
    if len(telling.mode) == 0:
        return 0.0
    is_new = _is_new(whole)
    begun = len(is_new) if is_new.all() else int(np.argmin(is_new))
    return float(np.sum(telling.mode[begun:] != Mode.MODEL)) / len(telling.mode)


def _is_new(whole: Answers) -> Mask:
    """At which calls the whole guard only waited for readings to be good for long enough."""
    return (whole.mode != Mode.MODEL) & (whole.sensors <= SensorCode.RECOVERING).all(axis=1)


def _largest(difference: Array) -> list[float]:
    """Per output, the largest magnitude; infinite if there is one that is no number."""
    sizes = np.where(np.isfinite(difference), np.abs(difference), np.inf)
    return [float(size) for size in np.max(sizes, axis=0, initial=0.0)]


def _over_runs(differences: Sequence[PartDifference]) -> tuple[PartDifference, ...]:
    found: dict[tuple[str, str], PartDifference] = {}
    for one in differences:
        key = one.file, one.output
        former = found.get(key, one)
        worst = max((former, one), key=lambda of: (not of.is_explained, of.max_abs_difference_um))
        guard = max(former.guard_difference_um, one.guard_difference_um)
        found[key] = replace(worst, guard_difference_um=guard)
    return tuple(found.values())


SEEN_UM = 0.01  #: What a smaller guard costs less is not told.
SEEN_MORE, SEEN_MORE_UM = 0.25, 0.5  #: So much more than `apply` a program may leave without being told.


def replay_findings(proof: Replay, *, has_guard: bool) -> tuple[Finding, ...]:
    """Findings of files (``replay-differs`` …) and of runs (``outside-valid-range``, ``worse-than-nothing`` …).

    `has_guard`: the control takes the end of the valid range for what is beyond it.
    """
    return *_of_runs(proof, has_guard), *_of_parts(proof), *rehearsal_findings(proof.rehearsal)


def _of_parts(proof: Replay) -> Iterator[Finding]:
    """Files that are farther from what they have to give than their numbers explain; what a smaller guard costs."""
    for part in proof.parts:
        evidence = {"file": part.file, "output": part.output}
        if not part.is_explained:
            sizes = ("max_abs_difference_um", "allowed_um")
            yield FINDINGS.finding(
                "replay-differs",
                f"{part.file}: {part.output} and the reference differ by up to {part.max_abs_difference_um:.3g} µm; "
                f"{part.allowed_um:.3g} µm is what its numbers explain.",
                evidence=evidence | {name: getattr(part, name) for name in sizes},
            )
        if part.lacks and part.guard_difference_um > max(part.allowed_um, SEEN_UM):
            yield FINDINGS.finding(
                "guard-differs",
                f"{part.file}: what {part.output} gets and what the whole guard would give differ by up to "
                f"{part.guard_difference_um:.3g} µm on these runs: {part.lacks}.",
                evidence=evidence | {"guard_difference_um": part.guard_difference_um},
            )


def _of_runs(proof: Replay, has_guard: bool) -> Iterator[Finding]:
    """Runs in which the program did not follow the whole model, or made the error larger."""
    for run in proof.runs:
        if run.faulty_share > 0.0:
            did = "the program held, ramped to zero or fell back to a model without it"
            if not proof.tells_mode:
                did = "the whole guard would have held, ramped to zero or fallen back; this control followed it"
            yield FINDINGS.finding(
                "not-the-whole-model",
                f"Run {run.run}: a sensor was not to be believed in {100 * run.faulty_share:.1f} % of samples; {did}.",
                Where(run=run.run),
                {"share_of_samples": run.faulty_share},
            )
        yield from run.clamped
        for one in run.beyond_valid:
            item, is_rise = one.input, one.input.reference == "rise"
            unit = unit_of_difference(item) if is_rise else item.unit
            did = "The program took the end of the range" if has_guard else "This control has no range and extrapolates"
            share = f"{100 * one.share_of_samples:.1f} % of the samples"
            yield FINDINGS.finding(
                "outside-valid-range",
                f"Run {run.run}: {item.name} was beyond {item.valid_min:.4g} … {item.valid_max:.4g} {unit}, where the "
                f"model has seen it{' rise' if is_rise else ''}, in {share}. {did}.",
                Where(channel=item.name, run=run.run),
                {"valid_min": item.valid_min, "valid_max": item.valid_max, "unit": unit}
                | {"share_of_samples": one.share_of_samples},
                # about a few samples nothing is to be done; runs of the model itself have them, too
                "" if (slight := one.share_of_samples < SLIGHT_SHARE) else None,
                level="info" if slight else "warning",
            )
        for name, of in run.accuracy.items():
            alone = run.applied.get(name, of)
            more = (of.rmse_um or 0.0) - (alone.rmse_um or 0.0)
            if alone.rmse_um is not None and more > max(SEEN_MORE_UM, SEEN_MORE * alone.rmse_um):
                why = (
                    "; ".join(run.because.get(name, ())) or "start readings are single samples, and the slew is limited"
                )
                yield FINDINGS.finding(
                    "program-leaves-more",
                    f"{name} in run {run.run}: `apply` leaves {alone.rmse_um:.3g} µm rms, this program "
                    f"{of.rmse_um:.3g} µm: {why}.",
                    Where(channel=name, run=run.run),
                    {"apply_rmse_um": alone.rmse_um, "program_rmse_um": of.rmse_um},
                )
            if of.is_worse:
                yield FINDINGS.finding(
                    "worse-than-nothing",
                    f"Run {run.run}: the program makes {name} worse: RMS error {of.rmse_um:.3g} µm with it, "
                    f"{of.before_rmse_um:.3g} µm without.",
                    Where(channel=name, run=run.run),
                    of.as_dict(),
                    "do not use it like this; check the sign, the first readings and the sensors",
                )
