"""A gauge that stops grinding, ready to run; its channels, and which of a recording from elsewhere are the same."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import pandas as pd

from selector.errors import InputError, ModelFileError, OptionError
from selector.findings import Finding, Where
from selector.physics.channel_differences import require_named
from selector.physics.gauging import model_file
from selector.physics.gauging.characteristic import Characteristic, GaugeMotion, characteristic, linear_gauge
from selector.physics.gauging.finding_table import FINDINGS
from selector.physics.gauging.gauged_grinding import (
    FinishedSizes,
    GaugedGrinding,
    PartCourse,
    finished_sizes,
    part_course,
    waveform,
)
from selector.physics.gauging.transducer import LinearGauge, RippleCrest, stage_thresholds_v
from selector.physics.model_fields import ModelOfFile, refused, unlikely_values
from selector.physics.model_text import key_text
from selector.physics.simulation_kind import Progress, unheard
from selector.recording import Channel, Recording
from selector.types import Vector
from selector.units import CANONICAL_UNITS

UM_PER_S = 1000.0 / 60.0  #: 1 mm/min, the unit of a feed in a recording, in µm/s.


def _channel(name: str, role: str, place: str) -> Channel:
    return Channel(name, role, CANONICAL_UNITS[role], place)


ALLOWANCE = _channel("allowance", "size", "workpiece (true)")
GAUGE = _channel("gauge", "voltage", "filter")
MEASURED = _channel("measured", "size", "gauge")
FEED = _channel("feed", "feed_rate", "wheel")
STAGE = _channel("stage", "state", "relay")
#: Of a part: true allowance, smoothed voltage, size as the gauge shows it, infeed of the wheel, number of the stage,
#: the first being 1, and 0 when the feed has stopped.
PART_CHANNELS = (ALLOWANCE, GAUGE, MEASURED, FEED, STAGE)
CURRENT = _channel("current", "current", "electromagnet")
PROBE = _channel("probe", "displacement", "probe")
CONTACT = _channel("contact", "force", "contact")
GENERATOR = _channel("generator", "voltage", "generator")
WAVEFORM_CHANNELS = (CURRENT, PROBE, CONTACT, GENERATOR)  #: What else is known of the whole chain near the stop.
#: What a recording from elsewhere may have, under any name.
KINDS: Mapping[str, Channel] = {"allowance": ALLOWANCE, "feed": FEED, "gauge": GAUGE, "measured": MEASURED}


def recorded_channels(file: model_file.GaugingFile, recording: Recording) -> dict[str, str]:
    """Kind, of `KINDS`, → channel: the one that ``[recorded]`` names, else the one of this name, else the only one left
    of its role; of several of a role none is. What is named may have any role of the same unit, which may be guessed.

    Raises OptionError: the recording has no channel of a name that the file gives, or the file gives one name twice, or
    the channel is held in another unit.
    """
    by_name = {channel.name: channel for channel in recording.channels}
    found: dict[str, str] = {}
    for kind, said in _said(file).items():
        _require_channel(kind, said, KINDS[kind], by_name, found)
        found[kind] = said
    for kind, own in KINDS.items():
        same = by_name.get(own.name)
        if kind not in found and same is not None and same.unit == own.unit and own.name not in found.values():
            found[kind] = own.name
    for kind, own in KINDS.items():
        alike = [c.name for c in recording.channels if c.role == own.role and c.name not in found.values()]
        if kind not in found and len(alike) == 1:
            found[kind] = alike[0]
    return found


def _said(file: model_file.GaugingFile) -> dict[str, str]:
    return {kind: said for kind in KINDS if (said := getattr(file.recorded, kind)) is not None}


def roles_asked(file: model_file.GaugingFile, recording: Recording, unread: Sequence[str]) -> dict[str, str]:
    """Column → role that it has to be read with, where a guess says otherwise; of `unread` ones nothing else says it.

    Columns that ``[recorded]`` names, and unread ones that are called as in a simulation.
    """
    units = {channel.name: channel.unit for channel in recording.channels}
    said = {name: KINDS[kind] for kind, name in _said(file).items()}
    asked = {own.name: own.role for own in KINDS.values() if own.name in unread and own.name not in said}
    wrong = [name for name, own in said.items() if name in unread or units.get(name, own.unit) != own.unit]
    if asked or wrong:
        # all of them: what was guessed of one column may hang on another
        asked |= {name: own.role for name, own in said.items() if name in unread or name in units}
    return asked


def undecided_findings(recording: Recording, found: Mapping[str, str]) -> Iterator[Finding]:
    """Channels of which each could be one thing, so that none of them was taken."""
    told: set[str] = set()
    for kind, own in KINDS.items():
        alike = [c.name for c in recording.channels if c.role == own.role and c.name not in found.values()]
        if kind not in found and len(alike) > 1 and own.role not in told:
            told.add(own.role)
            yield FINDINGS.finding(
                "channel-undecided",
                f"{', '.join(alike)}: each of them could be the {kind}, so none of them was taken.",
                Where(channel=alike[0]),
                {"kind": kind, "channels": alike},
                f'say which it is: {kind} = "…" under [recorded]',
            )


def _require_channel(
    kind: str, said: str, own: Channel, by_name: Mapping[str, Channel], found: Mapping[str, str]
) -> None:
    where = f"key recorded.{kind}"
    require_named(said, by_name, found.values(), where)
    if by_name[said].unit != own.unit:
        raise OptionError(
            f"{said!r} with the role {by_name[said].role}, in {by_name[said].unit}",
            expected=f"a channel in {own.unit}, as of the role {own.role}",
            where=where,
            advice=f'name another channel, or say what it is in the machine file: [channels."{said}"] with '
            f'role = "{own.role}" and its unit, and give it with --machine',
        )


WAVEFORM_RUN = "waveform"


@dataclass(frozen=True)
class GaugingSimulation:
    """A simulation of one or more parts, or of recorded runs."""

    recording: Recording  #: What a measurement would hold
    courses: Mapping[str, PartCourse]  #: Run → what happened to its part; none of recorded runs
    sizes: FinishedSizes | None  #: Of all parts of the file, the recorded ones first; None of recorded runs
    #: What the whole chain did before the feed of the first part stopped, times from the start of that part
    waveform: GaugeMotion | None = None
    findings: tuple[Finding, ...] = ()  #: What is odd about the model, these parts, or the recorded clock
    inputs: tuple[str, ...] = ()  #: Recorded channels that acted, so that they are no results
    matched: Mapping[str, str] = field(default_factory=dict)  #: Kind, of `KINDS`, → recorded channel


@dataclass(frozen=True)
class GaugingModel(ModelOfFile[model_file.GaugingFile]):
    """The gauging that a model file describes; made by `gauging_model`."""

    family = model_file.FAMILY

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Channels that it gives."""
        return (*PART_CHANNELS, *(WAVEFORM_CHANNELS if self.file.run.waveform_s > 0 else ()))

    @property
    def runs(self) -> tuple[str, ...]:
        """Runs of `simulation`, one a recorded part; a single one has an empty name, for any name."""
        recorded = min(self.file.run.parts, model_file.MOST_RECORDED)
        more = (WAVEFORM_RUN,) if self.file.run.waveform_s > 0 else ()
        return ("",) if recorded == 1 and not more else (*(f"part {n + 1}" for n in range(recorded)), *more)

    @cached_property
    def values(self) -> model_file.FileParts:
        """Gauge, grinding, surface, noise and tolerance of the file."""
        return model_file.file_parts(self.file)

    @property
    def period_s(self) -> float:
        """Time between samples [s]."""
        return model_file.sampling_s(self.file, self.values)

    @property
    def is_wearing(self) -> bool:
        """Whether wheel or tip make a part differ from the next."""
        made = self.values.grinding
        return made.probe_wear_um_per_part != 0 or (made.wheel_wear > 0 and made.wear_growth_per_part > 0)

    @property
    def characteristic(self) -> Characteristic | None:
        """That of the transducer; None of a linear gauge."""
        return None if self.values.transducer is None else _characteristic(self.values.transducer)

    @cached_property
    def crest(self) -> RippleCrest | None:
        """Ripple of the smoothed voltage, at twice the frequency of the swing; None of a linear gauge."""
        transducer, curve = self.values.transducer, self.characteristic
        if transducer is None or curve is None or curve.crest_v is None:
            return None
        swings_hz = 2.0 * transducer.electromagnet.frequency_hz
        return RippleCrest(curve.allowance_um, curve.crest_v, self.values.filter_s, 2.0 * swings_hz)

    @cached_property
    def stage_gauges(self) -> tuple[LinearGauge, ...]:
        """The line at the end of each stage; of a linear gauge the same for all."""
        stages, linear = self.values.grinding.stages, self.values.linear
        if linear is not None:
            return (linear,) * len(stages)
        curve = self._curve
        found = []
        for number, stage in enumerate(stages):
            try:
                found.append(linear_gauge(curve, stage.until_um, self.values.filter_s))
            except InputError as error:
                low, high = curve.monotone_um
                raise ModelFileError(
                    f"{stage.until_um:g} µm, where the voltage of the gauge does not change",
                    expected=f"an allowance from {low:.4g} to {high:.4g} µm, in which the tip meets the workpiece",
                    where=f"key grinding.stages[{number + 1}].until_um",
                    advice="set the gauge nearer or farther (transducer.rest_gap_m), or end the stage elsewhere",
                ) from error
        return tuple(found)

    @cached_property
    def advised_thresholds_v(self) -> tuple[float, ...]:
        """Thresholds of eq. 23 for the mean feed and a fresh wheel, by the line at the end of each stage [V]."""
        return stage_thresholds_v(self.stage_gauges, self.values.grinding, self.values.relay)

    @cached_property
    def setup(self) -> GaugedGrinding:
        """What is ground and gauged, with the thresholds of the file or, left out, those of eq. 23."""
        made, said = self.values, self.file.thresholds
        volts = self.advised_thresholds_v if said is None else said.volts
        process = made.grinding, made.relay, made.surface, made.noise
        return GaugedGrinding(self.stage_gauges[-1], *process, self.characteristic, volts, self.crest, made.correction)

    def with_parameters(self, values: Mapping[str, float]) -> "GaugingModel":
        """The same model with other values of some parameters; errors as `file_with`."""
        return gauging_model(super().with_parameters(values).file)

    def measured_um(self, voltage_v: Vector) -> Vector:
        """Allowances that the gauge shows for smoothed voltages; beyond what it can give, those of its ends [µm]."""
        linear = self.values.linear
        if linear is not None:
            return (voltage_v - linear.bias_v) / linear.gain_v_per_um
        curve = self._curve
        least, most = curve.monotone_um
        high, low = (float(curve.voltage_at(end)) for end in (least, most))
        return curve.allowance_at(np.clip(voltage_v, low, high))

    def simulation(
        self, *, run: str = "simulation", seed: int | None = None, progress: Progress = unheard
    ) -> GaugingSimulation:
        """The parts of the file, ground and gauged one after the other.

        `run` is the name of the run if there is one; several are called ``"part 1"`` and so on, and ``"waveform"``.
        `seed` is of noise and spread; default: that of the file.

        Raises InputError: the parts would take too many steps, or the probe reaches a core.
        """
        random = self.file.run.seed if seed is None else seed
        setup, parts = self.setup, self.file.run.parts
        sizes = finished_sizes(setup, parts, seed=random, progress=lambda done, of: progress(done, of, "parts"))
        names = [name or run for name in self.runs if name != WAVEFORM_RUN]
        courses = {
            name: part_course(setup, number, seed=random, period_s=self.period_s) for number, name in enumerate(names)
        }
        tables = {name: self._table(course) for name, course in courses.items()}
        about: dict[str, dict[str, Any]] = {
            name: {"size_um": course.size_um, "stopped_s": course.duration_s, "tripped": course.tripped}
            for name, course in courses.items()
        }
        seen = None
        if self.values.transducer is not None and self.file.run.waveform_s > 0:
            seen = waveform(self.values.transducer, next(iter(courses.values())), self.file.run.waveform_s)
            tables[WAVEFORM_RUN] = self._waveform_table(seen, next(iter(courses.values())))
            about[WAVEFORM_RUN] = {"of": names[0], "from_s": float(seen.time_s[0])}
        recording = Recording.from_runs(tables, self.outputs, self.provenance(random, about))
        found = (*model_findings(self), *sizes.findings())
        return GaugingSimulation(recording, courses, sizes, seen, found)

    def provenance(self, seed: int | None, runs: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
        """What a recording says of where it is from."""
        told = {"model": self.name, "kind": self.file.model.kind, "seed": seed, "instruments": True}
        return {"simulated": told, "runs": {run: dict(about) for run, about in runs.items()}}

    @property
    def _curve(self) -> Characteristic:
        found = self.characteristic
        if found is None:
            raise TypeError("a linear gauge has no characteristic")
        return found

    def _table(self, course: PartCourse) -> pd.DataFrame:
        stages = len(self.values.grinding.stages)
        columns = {
            ALLOWANCE.name: course.allowance_um,
            GAUGE.name: course.voltage_v,
            MEASURED.name: self.measured_um(course.voltage_v),
            FEED.name: course.feed_um_per_s / UM_PER_S,
            STAGE.name: np.where(course.stage < stages, course.stage + 1, 0),
        }
        return pd.DataFrame(columns, index=pd.Index(course.time_s, name="time_s"))

    def _waveform_table(self, seen: GaugeMotion, course: PartCourse) -> pd.DataFrame:
        # feed and stage are held from sample to sample
        at = np.searchsorted(course.time_s, seen.time_s, side="right") - 1
        held = self._table(course).iloc[at]
        columns = {
            ALLOWANCE.name: np.interp(seen.time_s, course.time_s, course.allowance_um),
            GAUGE.name: seen.smoothed_v,
            MEASURED.name: self.measured_um(seen.smoothed_v),
            FEED.name: held[FEED.name].to_numpy(),
            STAGE.name: held[STAGE.name].to_numpy(),
            CURRENT.name: seen.current_a,
            PROBE.name: 1e6 * seen.probe_m,
            CONTACT.name: seen.contact_n,
            GENERATOR.name: seen.generator_v,
        }
        return pd.DataFrame(columns, index=pd.Index(seen.time_s - seen.time_s[0], name="time_s"))


def gauging_model(file: model_file.GaugingFile) -> GaugingModel:
    """The gauging that a model file describes, ready to run.

    Raises ModelFileError: ``[bounds]`` names what is no parameter or excludes the value of one, a stage ends or a
    threshold lies where the gauge shows nothing. Raises InputError: the probe reaches a core, or the voltage falls
    nowhere.
    """
    model = GaugingModel(file)
    _ = model.parameters  # the bounds are checked here, not when a fit asks for them
    try:
        _ = model.stage_gauges
    except ModelFileError:
        raise
    except InputError as error:
        key, found, expected, advice = refused(error, ("transducer",), file.transducer)
        raise ModelFileError(found, expected=expected, where=f"key {key_text(key)}", advice=advice) from error
    curve = model.characteristic
    if curve is not None and file.thresholds is not None:
        least, most = curve.monotone_um
        high, low = (float(curve.voltage_at(end)) for end in (least, most))
        for number, volts in enumerate(file.thresholds.volts):
            if not low < volts < high:
                raise ModelFileError(
                    f"{volts:g} V",
                    expected=f"a voltage between {low:.4g} and {high:.4g} V: the gauge gives no other",
                    where=f"key thresholds.volts[{number + 1}]",
                    advice="set it within (V, not mV), or leave [thresholds] out: they are then calculated (eq. 23)",
                )
    return model


_characteristic = lru_cache(maxsize=16)(characteristic)


_SHIFT_SHARE = 0.1  #: Share of the tolerance by which a size may be off before it is told.
_SHIFT_UM = 1.0  #: The same without a tolerance [µm].


def mattering_um(model: GaugingModel) -> float:
    """Error of size that is worth a word: a tenth of the tolerance, 1 µm without one [µm]."""
    tolerance = model.values.tolerance
    return _SHIFT_UM if tolerance is None else _SHIFT_SHARE * (tolerance.upper_um - tolerance.lower_um)


def model_findings(model: GaugingModel) -> Iterator[Finding]:
    """What is odd before a part is ground; none of it stops a simulation."""
    yield from unlikely_values(model.file)
    curve = model.characteristic
    if curve is not None:
        # what was told of the characteristic, where the gauge is of use
        _, most = curve.monotone_um
        yield from (one for one in curve.findings if np.min(one.evidence.get("allowance_um", 0.0)) <= most)
        yield from _reach(model, curve)
        yield from _ripple(model)
    yield from _slow(model)
    yield from _samples(model)


def _reach(model: GaugingModel, curve: Characteristic) -> Iterator[Finding]:
    grinding, (least, most) = model.values.grinding, curve.monotone_um
    if grinding.allowance_um > most:
        yield FINDINGS.finding(
            "allowance-beyond-reach",
            f"Parts begin with {grinding.allowance_um:.4g} µm; the gauge shows nothing of it until the allowance has "
            f"fallen to {most:.4g} µm.",
            evidence={"allowance_um": grinding.allowance_um, "reach_um": most},
        )
    wanted = grinding.stages[-1].until_um
    if wanted - least < mattering_um(model):
        yield FINDINGS.finding(
            "wanted-size-at-the-end-of-reach",
            f"The tip meets the workpiece down to {least:.4g} µm of allowance, and {wanted:.4g} µm are wanted: what "
            "is below is not seen, so a threshold may never be reached.",
            evidence={"wanted_um": wanted, "least_um": least},
        )


def _ripple(model: GaugingModel) -> Iterator[Finding]:
    """Of the smoothed voltage at the frequency of the rectified swing, whose peaks the relay compares."""
    setup = model.setup
    if model.crest is None:
        return
    gain = setup.gauge.gain_v_per_um
    crest_v = float(model.crest.crest_at(setup.wanted_um, setup.gauge.time_constant_s))
    early_um, clear_v = crest_v / abs(gain), model.advised_thresholds_v[-1] + crest_v
    is_set = abs(setup.thresholds_v[-1] - clear_v) < 0.5 * crest_v
    if early_um > mattering_um(model) and not is_set:
        yield FINDINGS.finding(
            "ripple-behind-filter",
            "Behind the filter the voltage still swings at twice the frequency of the probe, up to "
            f"{1e3 * crest_v:.2g} mV above its mean: the relay trips on these peaks, {early_um:.2g} µm early. The "
            "calculated threshold (eq. 23) does not know of it.",
            evidence={"crest_v": crest_v, "early_um": early_um, "clear_v": clear_v},
            suggestion=(
                f"set the last threshold to about {clear_v:.5g} V, which takes it out, or give "
                "smoothing.time_constant_s more"
            ),
        )


def _slow(model: GaugingModel) -> Iterator[Finding]:
    """Filter, delay and lag that are long against the feed that they act in."""
    rates, made = model.setup.rates_um_per_s, model.values
    ends = (made.grinding.allowance_um, *(stage.until_um for stage in made.grinding.stages))
    lasts_s = (ends[-2] - ends[-1]) / rates[-1]
    gauge, relay = ("linear", "relay") if made.transducer is None else ("transducer.smoothing", "transducer.relay")
    for key, time_s in (
        (f"{gauge}.time_constant_s", made.filter_s),
        (f"{relay}.delay_s", made.relay.delay_s),
        ("grinding.lag_s", made.grinding.lag_s),
    ):
        if time_s <= lasts_s:
            continue
        yield FINDINGS.finding(
            "slow-for-the-stage",
            f"{key} is {time_s:.4g} s, and the last stage takes {lasts_s:.3g} s: the gauge commands before the stage "
            f"has settled, or before it begins.",
            evidence={"key": key, "time_s": time_s, "stage_s": lasts_s},
        )


def _samples(model: GaugingModel) -> Iterator[Finding]:
    said, finest = model.file.run.period_s, model_file.finest_s(model.values)
    if said is None or said <= finest * (1.0 + 1e-9):
        return
    surface = model.values.surface
    what = f"T_Φ of {model.values.filter_s:.3g} s"
    if surface.workpiece_rpm > 0:
        what += f" and turns of {60.0 / surface.workpiece_rpm:.3g} s" + (
            f" with {surface.grooves} grooves" if surface.grooves else ""
        )
    yield FINDINGS.finding(
        "coarse-period",
        f"Samples are {said:.3g} s apart, which does not show {what}; the recording looks different from what "
        "happened. The sizes are calculated in finer steps.",
        evidence={"period_s": said, "advised_s": finest},
        suggestion=f"take run.period_s = {finest:.2g} or less, or leave it out",
    )
