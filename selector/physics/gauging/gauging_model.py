"""A gauge that stops grinding, ready to run: its file in, recordings of parts and their sizes out.

Of a transducer the smoothed voltage that is recorded is that of its characteristic behind the filter: the swing is
taken as settled at every allowance (quasi-steady), because it settles within some periods and the allowance falls by
little in them. The waveform of the whole chain is calculated without that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from selector.errors import InputError, ModelFileError
from selector.findings import Finding
from selector.physics.gauging.characteristic import Characteristic, characteristic, linear_gauge
from selector.physics.gauging.finished_sizes import FinishedSizes, finished_sizes
from selector.physics.gauging.gauged_grinding import GaugedGrinding
from selector.physics.gauging.gauging_channels import (
    ALLOWANCE,
    CONTACT,
    CURRENT,
    FEED,
    GAUGE,
    GENERATOR,
    MEASURED,
    PART_CHANNELS,
    PROBE,
    STAGE,
    UM_PER_S,
    WAVEFORM_CHANNELS,
)
from selector.physics.gauging.model_length import MOST_RECORDED, sampling_s
from selector.physics.gauging.model_parts import FileParts, file_parts
from selector.physics.gauging.model_schema import GaugingFile
from selector.physics.gauging.parameters import parameters, with_parameters
from selector.physics.gauging.part_course import PartCourse, part_course
from selector.physics.gauging.ripple_crest import RippleCrest
from selector.physics.gauging.threshold import removal_rate_um_per_s, threshold_v, wear_share
from selector.physics.gauging.transducer import LinearGauge, Transducer
from selector.physics.gauging.vibrating_contact import GaugeMotion
from selector.physics.gauging.waveform import waveform
from selector.physics.model_parameters import Parameter
from selector.physics.model_text import key_text
from selector.physics.model_values import refused
from selector.recording import Channel, Recording

Vector = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

WAVEFORM_RUN = "waveform"


@dataclass(frozen=True)
class GaugingSimulation:
    """A simulation of one or more parts, or of recorded runs.

    Attributes
    ----------
    recording : Recording
        What a measurement would hold, see `gauging_channels`.
    courses : mapping of str to PartCourse
        Run → what happened to its part; none of recorded runs.
    sizes : FinishedSizes or None
        Of all parts of the file, the recorded ones first; None of recorded runs.
    waveform : GaugeMotion or None
        What the whole chain did before the feed of the first part stopped, times from the start of that part.
    findings : tuple of Finding
        What is odd about the model, and about these parts.
    """

    recording: Recording
    courses: Mapping[str, PartCourse]
    sizes: FinishedSizes | None
    waveform: GaugeMotion | None = None
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True)
class GaugingModel:
    """The gauging that a model file describes; made by `gauging_model`.

    Attributes
    ----------
    file : GaugingFile
        The file's content.
    """

    file: GaugingFile

    @property
    def name(self) -> str:
        """What the file calls it."""
        return self.file.model.name

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what acts on the gauge."""
        return (ALLOWANCE.name,)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Channels that it gives."""
        return (*PART_CHANNELS, *(WAVEFORM_CHANNELS if self.file.run.waveform_s > 0 else ()))

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Named numbers with units and bounds, see `parameters.parameters`."""
        return parameters(self.file)

    @property
    def places(self) -> tuple[str, ...]:
        """Where an effect may be added."""
        return ("probe", "filter", "relay", "wheel", "surface")

    @property
    def runs(self) -> tuple[str, ...]:
        """Runs of `simulation`, one a recorded part; a single one has an empty name, for any name."""
        recorded = min(self.file.run.parts, MOST_RECORDED)
        more = (WAVEFORM_RUN,) if self.file.run.waveform_s > 0 else ()
        return ("",) if recorded == 1 and not more else (*(f"part {n + 1}" for n in range(recorded)), *more)

    @cached_property
    def values(self) -> FileParts:
        """Gauge, grinding, surface, noise and tolerance of the file."""
        return file_parts(self.file)

    @property
    def period_s(self) -> float:
        """Time between samples [s]."""
        return sampling_s(self.file, self.values)

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
        made, last = self.values, len(self.stage_gauges) - 1
        return tuple(
            threshold_v(
                gauge,
                stage.until_um,
                removal_rate_um_per_s(stage.feed_um_per_s, wear_share(made.grinding)),
                made.relay.delay_s + (made.grinding.lag_s if number == last else 0.0),
            )
            for number, (gauge, stage) in enumerate(zip(self.stage_gauges, made.grinding.stages, strict=True))
        )

    @cached_property
    def setup(self) -> GaugedGrinding:
        """What is ground and gauged, with the thresholds of the file or, left out, those of eq. 23."""
        made, said = self.values, self.file.thresholds
        volts = self.advised_thresholds_v if said is None else said.volts
        return GaugedGrinding(
            self.stage_gauges[-1],
            made.grinding,
            made.relay,
            made.surface,
            made.noise,
            self.characteristic,
            volts,
            self.crest,
        )

    def with_parameters(self, values: Mapping[str, float]) -> GaugingModel:
        """The same model with other values of some parameters; errors as in `parameters.with_parameters`."""
        return gauging_model(with_parameters(self.file, values))

    def measured_um(self, voltage_v: Vector) -> Vector:
        """Allowances that the gauge shows for smoothed voltages; beyond what it can give, those of its ends [µm]."""
        linear = self.values.linear
        if linear is not None:
            return (voltage_v - linear.bias_v) / linear.gain_v_per_um
        curve = self._curve
        least, most = curve.monotone_um
        high, low = (float(curve.voltage_at(end)) for end in (least, most))
        return curve.allowance_at(np.clip(voltage_v, low, high))

    def simulate(self, *, run: str = "simulation", seed: int | None = None) -> Recording:
        """The recording of `simulation`."""
        return self.simulation(run=run, seed=seed).recording

    def simulation(
        self, *, run: str = "simulation", seed: int | None = None, progress: Progress | None = None
    ) -> GaugingSimulation:
        """The parts of the file, ground and gauged one after the other.

        Parameters
        ----------
        run : str
            Name of the run if there is one; several are called ``"part 1"`` and so on, and ``"waveform"``.
        seed : int, optional
            Of noise and spread; default: that of the file.
        progress : callable, optional
            Told how many parts of how many are done, and what is being done.

        Raises
        ------
        InputError
            The parts would take too many steps, or the probe reaches a core.
        """
        from selector.physics.gauging.model_findings import model_findings

        random = self.file.run.seed if seed is None else seed
        setup, parts = self.setup, self.file.run.parts

        def told(done: int, of: int) -> None:
            if progress is not None:
                progress(done, of, "parts")

        sizes = finished_sizes(setup, parts, seed=random, progress=told)
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


def gauging_model(file: GaugingFile, columns: Mapping[str, Any] | None = None) -> GaugingModel:
    """The gauging that a model file describes, ready to run; `columns` is for models that refer to some, this does not.

    Raises
    ------
    ModelFileError
        ``[bounds]`` names what is no parameter or excludes the value of one, a stage ends or a threshold lies where the
        gauge shows nothing.
    InputError
        The probe reaches a core, or the voltage falls nowhere.
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
                    advice=f"write {1e-3 * volts:g} if {volts:g} mV was meant"
                    if low < 1e-3 * volts < high
                    else "set it within, or leave [thresholds] out: they are then calculated (eq. 23)",
                )
    return model


@lru_cache(maxsize=8)
def _characteristic(transducer: Transducer) -> Characteristic:
    return characteristic(transducer)
