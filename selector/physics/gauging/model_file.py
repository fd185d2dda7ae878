"""What does the model file of in-process gauging say: TOML text → checked values, or an error that names the key."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field

from selector.number_text import round_below
from selector.physics import model_text
from selector.physics.gauging.gauged_grinding import feeds_s
from selector.physics.gauging.transducer import (
    Correction,
    Grinding,
    LinearGauge,
    Noise,
    Relay,
    Stage,
    Surface,
    Tolerance,
    Transducer,
    wear_share,
)
from selector.physics.model_fields import Fit, Number, SectionOf, Unit, given, numbers_of, refusals, value_of

MOST_ALLOWANCE_UM = 1e6  #: In recordings: allowances and sizes [µm].
MOST_STAGES = 20

MOST_PARTS = 1_000_000  #: Parts of one file.
MOST_WAVEFORM_S = 10.0  #: Of it thousands of samples a second are kept.


class ModelSection(model_text.Entry):
    """``[model]``."""

    kind: Literal["gauging"]
    name: model_text.Name
    note: model_text.Note = ""


class RunSection(model_text.Entry):
    """``[run]``: how many parts, how often they are looked at, with which noise."""

    period_s: Annotated[float, model_text.limited(1e-6, 10.0)] | None = None
    parts: Annotated[int, Field(strict=True, ge=1, le=MOST_PARTS)] = 1
    waveform_s: Annotated[float, model_text.limited(0, MOST_WAVEFORM_S)] = 0.0
    seed: model_text.Seed = 0


class ThresholdsSection(model_text.Entry):
    """``[thresholds]``: voltages of the relay, where they are not those of eq. 23."""

    volts: Annotated[tuple[model_text.Signed, ...], Field(min_length=1, max_length=MOST_STAGES), Unit("V"), Fit()]


class RecordedSection(model_text.Entry):
    """``[recorded]``: channels of a recording, where role and name do not tell."""

    allowance: model_text.Name | None = None
    feed: model_text.Name | None = None
    gauge: model_text.Name | None = None
    measured: model_text.Name | None = None


class GaugingFile(model_text.Entry):
    """A gauge, the grinding that it stops, and what size is wanted."""

    model: ModelSection
    run: RunSection = RunSection()
    transducer: SectionOf[Transducer] | None = None
    linear: SectionOf[LinearGauge] | None = None
    relay: SectionOf[Relay] | None = None
    grinding: SectionOf[Grinding]
    surface: SectionOf[Surface] = SectionOf[Surface]()
    noise: SectionOf[Noise] = SectionOf[Noise]()
    tolerance: SectionOf[Tolerance] | None = None
    thresholds: ThresholdsSection | None = None
    correction: SectionOf[Correction] | None = None
    recorded: RecordedSection = RecordedSection()
    bounds: model_text.Bounds = Field(default_factory=dict)


KINDS: Mapping[str, type[GaugingFile]] = {"gauging": GaugingFile}


@dataclass(frozen=True)
class FileParts:
    """The values that a model file describes."""

    #: transducer and linear: The gauge: one of the two
    transducer: Transducer | None
    linear: LinearGauge | None
    relay: Relay
    grinding: Grinding
    surface: Surface
    noise: Noise
    tolerance: Tolerance | None
    correction: Correction | None

    @property
    def filter_s(self) -> float:
        """T_Φ of the gauge [s]."""
        gauge = self.linear if self.transducer is None else self.transducer.smoothing
        return gauge.time_constant_s if gauge is not None else 0.0


def file_parts(file: GaugingFile) -> FileParts:
    """The values of the sections; errors as their dataclasses have them."""
    transducer = None if file.transducer is None else value_of(Transducer, file.transducer)
    relay = Relay() if file.relay is None else value_of(Relay, file.relay)
    return FileParts(
        transducer,
        None if file.linear is None else value_of(LinearGauge, file.linear),
        relay if transducer is None else transducer.relay,
        _grinding(file.grinding),
        value_of(Surface, file.surface),
        value_of(Noise, file.noise),
        None if file.tolerance is None else value_of(Tolerance, file.tolerance),
        None if file.correction is None else value_of(Correction, file.correction),
    )


def part_contradictions(file: GaugingFile) -> Iterator[model_text.Contradiction]:
    """Whatever the values of the sections refuse, at the key of the section."""
    stages: tuple[model_text.Entry, ...] = file.grinding.stages  # type: ignore[attr-defined]
    kinds: list[tuple[type, model_text.Entry | None, model_text.Key]] = [
        (Transducer, file.transducer, ("transducer",)),
        (LinearGauge, file.linear, ("linear",)),
        (Relay, file.relay, ("relay",)),
        *((Stage, stage, ("grinding", "stages", number)) for number, stage in enumerate(stages)),
        (Surface, file.surface, ("surface",)),
        (Noise, file.noise, ("noise",)),
        (Tolerance, file.tolerance, ("tolerance",)),
        (Correction, file.correction, ("correction",)),
    ]
    wrong = [
        one
        for kind, section, key in kinds
        if section is not None
        for one in refusals(partial(value_of, kind, section), key, section)
    ]
    yield from wrong or refusals(partial(_grinding, file.grinding), ("grinding",), file.grinding)


def _grinding(section: model_text.Entry) -> Grinding:
    said = given(Grinding, section)
    return Grinding(**(said | {"stages": tuple(value_of(Stage, stage) for stage in said["stages"])}))


MOST_RECORDED = 50  #: Parts that are recorded in full; of more only the sizes are kept.
_PER_FILTER = 5
_PER_TURN = 20
_PER_GROOVE = 8
_FEWEST, _MOST = 500, 20_000  #: Samples of a part, where the file does not say how often it is looked at.


def planned_s(parts: FileParts) -> float:
    """How long a freshly dressed wheel needs for a part of mean allowance, with the lags of removal and filter [s]."""
    grinding, stages = parts.grinding, parts.grinding.stages
    feeds = feeds_s(grinding, Relay(), [stage.until_um for stage in stages])
    return feeds + 5.0 * grinding.lag_s + parts.filter_s + parts.relay.delay_s


def sampling_s(file: GaugingFile, parts: FileParts) -> float:
    """Time between the samples: what the file says, or what shows filter, turns and grooves [s]."""
    if file.run.period_s is not None:
        return file.run.period_s
    duration_s = planned_s(parts)
    wanted = min(finest_s(parts), duration_s / _FEWEST)
    return round_below(max(wanted, duration_s / _MOST))


def finest_s(parts: FileParts) -> float:
    """The longest time between samples that still shows filter, turns and grooves [s]."""
    surface = parts.surface
    wanted = [parts.filter_s / _PER_FILTER]
    if surface.runout_um > 0:
        wanted.append(60.0 / surface.workpiece_rpm / _PER_TURN)
    if surface.grooves > 0 and surface.groove_depth_um > 0:
        wanted.append(60.0 / surface.workpiece_rpm / surface.grooves / _PER_GROOVE)
    return min(wanted)


def length_contradictions(file: GaugingFile, parts: FileParts) -> Iterator[model_text.Contradiction]:
    """Parts that take too many samples to be held."""
    duration_s, period_s = planned_s(parts), sampling_s(file, parts)
    key = ("run", "period_s") if file.run.period_s is not None else ("grinding", "stages")
    samples = duration_s / period_s
    if samples < 2:
        found = f"a period of {period_s:g} s, and a part takes {duration_s:.3g} s"
        yield key, found, "a period that is shorter than a part", "shorten run.period_s, or leave it out"
    elif samples > model_text.MOST_SAMPLES:
        found = f"{samples:.3g} samples of a part that takes {duration_s:.3g} s"
        yield (
            key,
            found,
            f"at most {model_text.MOST_SAMPLES}",
            "lengthen run.period_s, or give the feeds the right power of ten",
        )


def contradictions(file: GaugingFile) -> Iterator[model_text.Contradiction]:
    """(key, found, expected, advice) of whatever does not fit together in a file whose values are valid one by one."""
    yield from _of_gauge(file)
    yield from part_contradictions(file)
    parts = file_parts(file)
    yield from _of_linear(parts)
    since = min(file.run.parts, parts.grinding.dress_every or file.run.parts)
    yield from refusals(lambda: wear_share(parts.grinding, since - 1), ("grinding",), file.grinding)
    yield from _of_thresholds(file, parts)
    yield from model_text.bound_contradictions(file.bounds)
    yield from length_contradictions(file, parts)


def _of_gauge(file: GaugingFile) -> Iterator[model_text.Contradiction]:
    one = "one gauge: [transducer] with its parts, or [linear]"
    if file.transducer is None and file.linear is None:
        advice = "add gain_v_per_um, bias_v and time_constant_s under [linear], or a transducer"
        yield ("linear",), "no gauge", one, advice
    elif file.transducer is not None and file.linear is not None:
        yield ("linear",), "a second gauge beside [transducer]", one, "leave one of the two out"
    if file.transducer is not None and file.relay is not None:
        expected = "the relay of [linear]"
        yield ("relay",), "a relay beside [transducer]", expected, "move its keys to [transducer.relay]"
    if file.transducer is None and file.run.waveform_s > 0:
        found, expected = "a waveform of a linear gauge", "a [transducer], whose parts swing"
        yield ("run", "waveform_s"), found, expected, "leave it out, or describe the gauge by its parts"


def _of_linear(parts: FileParts) -> Iterator[model_text.Contradiction]:
    gauge = parts.linear
    if gauge is not None and gauge.gain_v_per_um >= 0:
        yield (
            ("linear", "gain_v_per_um"),
            f"{gauge.gain_v_per_um:g} V/µm",
            "a gain below 0: the voltage rises while the allowance falls",
            "turn the sign of gain_v_per_um" if gauge.gain_v_per_um > 0 else "give the slope of the gauge",
        )


def _of_thresholds(file: GaugingFile, parts: FileParts) -> Iterator[model_text.Contradiction]:
    stages = len(parts.grinding.stages)
    if stages > MOST_STAGES:
        yield ("grinding", "stages"), f"{stages} stages", f"at most {MOST_STAGES}", "leave stages out"
    if file.thresholds is None:
        return
    key, volts = ("thresholds", "volts"), file.thresholds.volts
    if len(volts) != stages:
        many = f"{stages} stage{'s' * (stages != 1)}"
        advice = "give one voltage a stage, or leave the section out: they are then calculated (eq. 23)"
        yield key, f"{len(volts)} for {many}", "one threshold for each of the stages", advice
    elif any(later <= earlier for earlier, later in pairwise(volts)):
        found = ", ".join(f"{one:g}" for one in volts)
        yield key, f"{found} V", "voltages that rise, as that of the gauge does", "sort them as the stages are sorted"


def numbers(file: GaugingFile) -> Iterator[Number]:
    """The physics of gauging as named numbers, those that are switched off included: lag, wear, delay, run-out.

    Their names and bounds: docs/reference/gauging-model.md, ``[bounds]``. Errors as `parameters_of`.
    """
    parts = file_parts(file)
    if parts.transducer is not None:
        yield from numbers_of(parts.transducer, ("transducer",))
    else:
        yield from numbers_of(parts.linear, ("linear",))
        yield from numbers_of(parts.relay, ("relay",))
    yield from numbers_of(parts.grinding, ("grinding",))
    for number in numbers_of(parts.surface, ("surface",)):
        turns, grooved = parts.surface.workpiece_rpm > 0, parts.surface.grooves > 0
        if turns and (grooved or not str(number.path[-1]).startswith("groove_")):
            yield number
    yield from numbers_of(parts.noise, ("noise",))
    yield from numbers_of(file.thresholds, ("thresholds",))


FAMILY: model_text.ModelFamily[GaugingFile] = model_text.ModelFamily(
    "gauging",
    KINDS,
    contradictions,
    page="docs/reference/gauging-model.md",
    examples="fixtures/gauging",
    numbers=numbers,
)
#: The model file at a path, of a text, and of plain values; see `ModelFamily`.
read_model_file, parsed_model_file, checked_model_file = FAMILY.read, FAMILY.parsed, FAMILY.checked
