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
from selector.controllers.guard.decided import Mode, SensorCode, decided_limits, is_turned
from selector.controllers.model_file import Input, ModelFile
from selector.controllers.replay.parts import TIME_STEP_S, Answers, Part, Rows, reference_answers
from selector.controllers.replay.rehearsed import Rehearsed, rehearsal_findings, rehearsed
from selector.controllers.self_check import clamp_reached
from selector.findings import Finding, Where
from selector.models.run_before import with_ungauged
from selector.recording import Recording
from selector.types import Array, Mask


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
    because = {name: tuple(_because(applied, clamped, run, name, faulty, begins_s, main.part)) for name in accuracy}
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
                level="info" if one.share_of_samples < SLIGHT_SHARE else "warning",
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
