"""From a model on recordings to the courses that an adaptation learns from, and from what it learnt to a model file."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from selector.adaptation.drift import AGREEING, GATE, Course
from selector.adaptation.finding_table import FINDINGS
from selector.adaptation.result import Adaptation
from selector.controllers.application import Application, displacement_of, displacement_starts
from selector.controllers.closed_values import Adaptation as Block
from selector.controllers.closed_values import OutputAdaptation
from selector.controllers.model_file import ModelFile
from selector.controllers.self_check import sealed
from selector.findings import Finding, Where
from selector.recording import Recording
from selector.types import Array

#: Response → run → (time on the clock of the run [s], displacement [µm] as the gauge has it), by time.
Touched = Mapping[str, Mapping[str, Sequence[tuple[float, float]]]]


def adaptation_courses(
    model: ModelFile, recording: Recording, application: Application, touched: Touched | None = None
) -> tuple[dict[str, list[Course]], tuple[Finding, ...]]:
    """What the model says and what was recorded, by response and run, counted from the zero of the gauge.

    With `touched`, the courses have these touch-offs, and a run without recorded displacement has no other knowledge of
    it. `application`: of this model on this recording.
    """
    zeros = displacement_starts(model, recording)
    table = application.predictions
    found: dict[str, list[Course]] = {}
    findings: list[Finding] = []
    for output in model.outputs:
        if touched is not None and output.name not in touched:
            continue
        courses, only, pairs = [], [], [np.zeros((3, 0))]
        for run in recording.runs:
            zero = zeros[run].get(output.name, 0.0)
            modelled = table.loc[table["run"] == run, output.name].to_numpy(dtype=np.float64) - zero
            recorded = displacement_of(output, recording, run) - zero
            nothing = np.zeros(0, dtype=np.intp)
            course = Course(run, recording.time_s(run), modelled, recorded, nothing, np.zeros(0))
            if touched is not None:
                counted = Counter(touched[output.name].get(run, ()))
                copies = [time_s for (time_s, _), n in counted.items() for _ in range(n - 1)]
                course, left_out = _touched(course, list(counted), zero)
                findings.extend(_told("touch-off-without-prediction", output.name, run, left_out))
                findings.extend(_told("touch-off-twice", output.name, run, copies))
                at = course.touched_at
                pairs.append(np.array([course.touched_um, recorded[at], recorded[np.maximum(at - 1, 0)]]))
                if len(at) and not np.isfinite(recorded).any():
                    only.append(run)
            courses.append(course)
        findings.extend(_contradiction(output.name, *np.concatenate(pairs, axis=1)))
        if only:
            said = f"{output.name} was not recorded in {', '.join(only)}: errors are counted at the touch-offs only."
            where = Where(channel=output.name, run=only[0] if len(only) == 1 else None)
            findings.append(FINDINGS.finding("errors-at-touch-offs-only", said, where, {"runs": only}))
        found[output.name] = courses
    return found, tuple(findings)


def _touched(course: Course, touched: Sequence[tuple[float, float]], zero: float) -> tuple[Course, list[float]]:
    """The course with its touch-offs, each at the last sample that is not after it; times without a prediction."""
    times = np.array([one[0] for one in touched])
    um = np.array([one[1] for one in touched]) - zero
    at = (np.searchsorted(course.time_s, times + 1e-6, side="right") - 1).astype(np.intp)
    # a run may begin with its displacement, after the first of them
    known = (at >= 0) & np.isfinite(course.modelled_um[at])
    recorded = course.recorded_um
    if not np.isfinite(recorded).any():
        recorded = recorded.copy()
        recorded[at[known]] = um[known]
    course = Course(course.run, course.time_s, course.modelled_um, recorded, at[known], um[known])
    return course, times[~known].tolist()


def _contradiction(response: str, *probed_um: Array) -> Iterator[Finding]:
    """Of what was touched, recorded then, and a sample before: in another unit, sign or clock, half are off by half."""
    usable = np.isfinite(np.sum(probed_um, axis=0)) & (probed_um[1] != 0.0)
    touched_um, recorded_um, before_um = np.compress(usable, probed_um, 1)
    n = len(touched_um)
    sizes = touched_um - recorded_um, recorded_um, touched_um, recorded_um - before_um
    off_um, size_um, touch_um, noise_um = (float(np.median(np.abs(of))) if n > 2 else 0.0 for of in sizes)
    # what is hardly more than the noise of the gauge contradicts nothing
    if off_um > 0.5 * size_um and max(size_um, touch_um) > 5.0 * noise_um:
        ratio = float(np.median(touched_um / recorded_um))
        yield FINDINGS.finding(
            "touch-offs-contradict-recording",
            f"{response}: half of {n} touch-offs differ by {off_um:.3g} µm or more from what was recorded at the time "
            f"(typically {size_um:.3g} µm, of which they are {ratio:.3g} times).",
            Where(channel=response),
            {"touch_offs": n, "off_um": off_um, "recorded_um": size_um, "ratio": ratio},
        )


_SAID = {
    "touch-off-without-prediction": "where the model has no prediction",
    # a copy agrees with its row, so that a false reading would be believed
    "touch-off-twice": "with the time and the reading of another, not counted",
}


def _told(kind: str, response: str, run: str, times_s: Sequence[float]) -> Iterator[Finding]:
    if times_s:
        yield FINDINGS.finding(
            kind,
            f"{response} in run {run}: {len(times_s)} touch-off{'' if len(times_s) == 1 else 's'} {_SAID[kind]}.",
            Where(channel=response, run=run, from_s=min(times_s), to_s=max(times_s)),
            {"times_s": list(times_s)},
        )


def clamp_findings(model: ModelFile, found: Adaptation) -> Iterator[Finding]:
    """Outputs whose clamp is smaller than what the adapted model wants to correct in these runs."""
    clamps = {limits.output: limits.clamp_um for limits in model.guard.limits}
    for name, of in found.responses.items():
        clamp = clamps.get(name)
        if clamp is None or of.learnt is None:
            continue
        wanted = np.abs(np.concatenate([run.predicted_um for run in of.runs]))
        if float(np.max(wanted)) > clamp:
            yield FINDINGS.finding(
                "adaptation-clamped",
                f"The clamp of {name} is ±{clamp:g} µm; with touch-offs up to {np.max(wanted):.3g} µm are to be "
                f"corrected, and {100 * np.mean(wanted > clamp):.1f} % of the samples are beyond the clamp.",
                Where(channel=name),
                {"clamp_um": clamp, "largest_um": float(np.max(wanted)), "share": float(np.mean(wanted > clamp))},
            )


def adapted_model(model: ModelFile, found: Adaptation) -> ModelFile:
    """The model with what was learnt; without any adaptation where nothing is to be adapted.

    Equations and test vectors stay as they are.
    """
    outputs = []
    for name, of in found.responses.items():
        if of.learnt is None:
            continue
        # the file calls what was learnt as a drift does
        learnt = {key: float(value) for key, value in vars(of.learnt.drift).items()}
        outputs.append(OutputAdaptation(output=name, **learnt, interval=of.learnt.widening or None))
    block = Block(outputs=tuple(outputs), gate=GATE, agreeing=AGREEING) if outputs else None
    return sealed(model.model_copy(update={"adaptation": block}), is_kept=True)
