"""A vibrating structure that runs: its file in, a recording of tool and workpiece out, its parameters open to a fit."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd

from selector.findings import Finding
from selector.physics.model_fields import ModelOfFile
from selector.physics.simulation_kind import Progress, unheard
from selector.physics.vibration import final_motion
from selector.physics.vibration.chains import Chain
from selector.physics.vibration.model_file import (
    FAMILY,
    VibrationFile,
    file_shafts,
    file_structure,
    mean_rpm,
    source_of,
)
from selector.physics.vibration.periodic_error import Cutting, Surface, split_frequency_hz
from selector.physics.vibration.structure import ShaftCourse, Source, Structure, excitation
from selector.recording import Channel, Recording
from selector.types import Vector

FINALS = ("tool", "workpiece")  #: Names of the finals, whatever members they are.
RELATIVE = "tool_workpiece"  #: Motion of the tool against the workpiece, as a name beside those of `FINALS`.
_UM = 1e6


@dataclass(frozen=True)
class VibrationSimulation:
    """A simulation of one or more runs."""

    #: What a measurement would hold: `VibrationModel.outputs`, forces of the sources, speeds of the shafts
    recording: Recording
    #: "coupled", and "chains" where there are any → motion of the finals by every line at the speeds `shaft_rpm`
    motions: Mapping[str, final_motion.FinalMotions]
    shaft_rpm: Mapping[str, float]  #: Mean speed of every shaft over all runs [r/min]
    findings: tuple[Finding, ...] = ()  #: What is odd about the motion in time, or the recorded runs
    matched: Mapping[str, str] = field(default_factory=dict)  #: Name of a channel → that of the recorded one
    inputs: tuple[str, ...] = ()  #: Recorded channels that drove the model


@dataclass(frozen=True)
class VibrationModel(ModelOfFile[VibrationFile]):
    """The vibrating structure that a model file describes; made by `vibration_model`."""

    family = FAMILY

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Channels that it gives: motion of tool and workpiece, and of the one against the other."""
        members = self.finals
        return (
            *(Channel(final, "displacement", "um", member) for final, member in members.items()),
            Channel(RELATIVE, "displacement", "um", f"{members['tool']} against {members['workpiece']}"),
        )

    @cached_property
    def structure(self) -> Structure:
        """Its members and joints."""
        return file_structure(self.file)

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        """What shakes it."""
        return tuple(source_of(name, section) for name, section in self.file.sources.items())

    @cached_property
    def chains(self) -> tuple[Chain, ...]:
        """Its chains; empty where the file has none."""
        return tuple(Chain(**dict(section)) for section in self.file.chains)

    @property
    def finals(self) -> Mapping[str, str]:
        """Name of a final → its member."""
        return {name: getattr(self.file.finals, name) for name in FINALS}

    @cached_property
    def courses(self) -> Mapping[str, ShaftCourse]:
        """Shaft → its speed over the run."""
        return file_shafts(self.file)

    @cached_property
    def shaft_rpm(self) -> Mapping[str, float]:
        """Shaft → its mean speed over the run [r/min]."""
        return {name: mean_rpm(course, 0.0, self.file.run.duration_s) for name, course in self.courses.items()}

    @property
    def surface(self) -> Surface:
        """Where one kind of periodic error ends and the next begins."""
        return Surface(**dict(self.file.surface))

    def cutting(self, shaft_rpm: Mapping[str, float]) -> Cutting | None:
        """The cut at these speeds of the shafts [r/min]; None where the file has none."""
        section = self.file.cutting
        if section is None:
            return None
        return Cutting(workpiece_rpm=shaft_rpm[section.shaft], **section.model_dump(exclude={"shaft"}))

    def split_hz(self, shaft_rpm: Mapping[str, float]) -> float | None:
        """Frequency up to which the low chains hold, and above it the high ones [Hz]; None without a cut."""
        cut = self.cutting(shaft_rpm)
        return None if cut is None else split_frequency_hz(cut, self.surface)

    def chain_method(self, shaft_rpm: Mapping[str, float]) -> final_motion.ChainMethod | None:
        """Its chains at these speeds of the shafts [r/min]; None where it has none."""
        return final_motion.ChainMethod(self.chains, self.split_hz(shaft_rpm)) if self.chains else None

    def method(self, shaft_rpm: Mapping[str, float]) -> final_motion.ChainMethod | None:
        """The chains at these speeds of the shafts [r/min], if its run is made by them; None: the coupled structure."""
        return self.chain_method(shaft_rpm) if self.file.run.method == "chains" else None

    @property
    def line_ranges_hz(self) -> tuple[tuple[str, float, float], ...]:
        """Source, lowest and highest frequency of every line during the run [Hz]."""
        found = []
        for source in self.sources:
            course = None if source.shaft is None else self.courses[source.shaft]
            slow, fast = (0.0, 0.0) if course is None else course.range_rpm(0.0, self.file.run.duration_s)
            for line in source.lines:
                fixed, order = line.frequency_hz, line.order or 0.0
                span = (order * slow / 60.0, order * fast / 60.0) if fixed is None else (fixed, fixed)
                found.append((source.name, *span))
        return tuple(found)

    def motions(self, shaft_rpm: Mapping[str, float]) -> dict[str, final_motion.FinalMotions]:
        """Method → motion of the finals by every line at these speeds [r/min]; the chains where there are any."""
        lines, chains = excitation(self.sources, shaft_rpm), self.chain_method(shaft_rpm)
        found = {"coupled": final_motion.final_motions(self.structure, self.sources, lines, self.finals)}
        if chains is not None:
            found["chains"] = final_motion.final_motions(self.structure, self.sources, lines, self.finals, chains)
        return found

    def simulation(
        self, *, run: str = "simulation", seed: int | None = None, progress: Progress = unheard
    ) -> VibrationSimulation:
        """What tool and workpiece do in the run of the file.

        Without a `seed` of the shifts of the sources and of the noise, that of the file counts; `progress` is told how
        many runs of how many are done.

        InputError: a line meets a resonance that nothing damps.
        """
        progress(0, 1, run)
        noise = self.file.run.seed if seed is None else seed
        signal = self.signal(self.times_s, self.courses, self.phases_rad(noise))
        recording, motions = self.recorded({run: signal}, noise), self.motions(self.shaft_rpm)
        return VibrationSimulation(recording, motions, self.shaft_rpm, signal.findings)

    @property
    def times_s(self) -> Vector:
        """Times of the run's samples [s]."""
        run = self.file.run
        # a duration that is a multiple of the period but for rounding has its last sample
        return np.arange(int(run.duration_s / run.period_s * (1.0 + 1e-12)) + 1, dtype=np.float64) * run.period_s

    def phases_rad(self, seed: int) -> dict[str, float]:
        """Source → shift of all its lines that this seed draws [rad]."""
        return final_motion.source_phases_rad(self.sources, seed=seed, phases=self.file.realisations.phases)

    def signal(
        self,
        time_s: Vector,
        courses: Mapping[str, ShaftCourse],
        phases_rad: Mapping[str, float],
        *,
        sources: tuple[Source, ...] | None = None,
        leave_out: bool = False,
    ) -> final_motion.MotionSignal:
        """Motion and forces at these times, see `motion_signal`.

        By default all sources shake. With `leave_out` lines that the times cannot carry are left out, with a finding,
        instead of refused.
        """
        speeds = {name: mean_rpm(course, float(time_s[0]), float(time_s[-1])) for name, course in courses.items()}
        return final_motion.motion_signal(
            self.structure,
            self.sources if sources is None else sources,
            courses,
            self.finals,
            time_s,
            phase_rad=phases_rad,
            chains=self.method(speeds),
            beyond="leave-out" if leave_out else "refuse",
        )

    def recorded(self, signals: Mapping[str, final_motion.MotionSignal], seed: int | None) -> Recording:
        """Run → signal, as a recording with the noise of the file, drawn by the seed; without one there is none."""
        tables, noise_um = {}, self.file.sensing.noise_um
        for number, (run, signal) in enumerate(signals.items()):
            motion_um = _UM * signal.motion_m
            if seed is not None and noise_um > 0:
                drawn = np.random.default_rng([seed, number])
                motion_um = motion_um + noise_um * drawn.standard_normal(motion_um.shape)
            columns = dict(zip(signal.finals, motion_um, strict=True))
            columns[RELATIVE] = columns["tool"] - columns["workpiece"]
            columns |= {force_name(name): force for name, force in zip(signal.sources, signal.force_n, strict=True)}
            columns |= {speed_name(name): rpm for name, rpm in signal.shaft_rpm.items()}
            tables[run] = pd.DataFrame(columns, index=pd.Index(signal.time_s, name="time_s"))
        made = {"model": self.name, "kind": self.file.model.kind, "seed": seed, "instruments": seed is not None}
        provenance = {"simulated": made, "runs": {run: {"method": self.file.run.method} for run in signals}}
        return Recording.from_runs(tables, (*self.outputs, *self._input_channels()), provenance)

    def _input_channels(self) -> tuple[Channel, ...]:
        forces = (
            Channel(
                force_name(one.name), "force", "N", f"{one.member}{f' against {one.against}' if one.against else ''}"
            )
            for one in self.sources
        )
        return (*forces, *(Channel(speed_name(name), "spindle_speed", "rpm", name) for name in self.file.shafts))


def vibration_model(file: VibrationFile) -> VibrationModel:
    """The vibrating structure that a model file describes, ready to run.

    ModelFileError: ``[bounds]`` names what is no parameter, or excludes the value of one.
    """
    model = VibrationModel(file)
    _ = model.parameters  # the bounds are checked here, not when a fit asks for them
    return model


def force_name(source: str) -> str:
    """Channel of the force of a source."""
    return f"{source}_force"


def speed_name(shaft: str) -> str:
    """Channel of the speed of a shaft."""
    return f"{shaft}_speed"
