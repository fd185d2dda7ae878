"""Faults rehearsed on recorded readings: what an exported program leaves, follows and notices when something fails."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from selector.controllers.application import Accuracy
from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.decided import SensorCode, is_turned, mode_words
from selector.controllers.model_file import ModelFile
from selector.controllers.replay.parts import Answers, Part, Rows, reference_answers, rows_at
from selector.findings import Finding, Where
from selector.types import Array, Indices

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
