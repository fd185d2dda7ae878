"""A thermal model that runs, by its own conditions or those of recorded runs; its parameters are open to be fitted."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.model_fields import ModelOfFile, file_with
from selector.physics.simulation_kind import Progress, unheard
from selector.physics.thermal import model_file
from selector.physics.thermal.finding_table import FINDINGS
from selector.physics.thermal.modes.modes import Cyclogram, ModalModel, SpeedLaw
from selector.physics.thermal.network import heat_system
from selector.physics.thermal.network.transient import simulate_heat
from selector.physics.thermal.schedule import CONDITIONS, condensed, driven, held_at, lagged, read_out, seed_of_run
from selector.recording import Channel, Recording
from selector.types import Vector
from selector.units import CANONICAL_UNITS

Point = tuple[float, float, float]


@dataclass(frozen=True)
class HeatMachine:
    """A body with its laws, and where its probes sit."""

    system: heat_system.HeatSystem  #: The body
    laws: heat_system.Laws  #: How it is heated and cooled
    probes: tuple[str, ...]  #: Probes that are read where the file names no thermometers
    #: place_of_probe and xyz_of_probe: In words, and on the machine, where it is known
    place_of_probe: Mapping[str, str] = field(default_factory=dict)
    xyz_of_probe: Mapping[str, Point] = field(default_factory=dict)


def machine_of(file: model_file.ModelFile, built: HeatMachine | None = None) -> HeatMachine | ModalModel:
    """The modes, or the body and the laws of a network or of the field machine.

    `built` is the machine of a file that differs in its laws only; a field machine is then not built again.

    Raises ModelFileError: the file names a source, film, place or length that the field machine does not have.
    """
    if isinstance(file, model_file.ModesFile):
        return modal_machine(file)
    if isinstance(file, model_file.NetworkFile):
        return network_machine(file)
    # scikit-fem comes in with the field machine, which most model files do not need
    from selector.physics.thermal import field_model
    from selector.physics.thermal.field.machine import SENSORS

    laws = field_model.laws_of(file) if isinstance(file, model_file.FieldFile) else model_file.stated_laws(file)
    if built is not None:
        return replace(built, laws=laws)
    if isinstance(file, model_file.MeshFile):
        return HeatMachine(field_model.meshed(file, laws).system, laws, ())
    return HeatMachine(
        field_model.system_of(file, laws),
        laws,
        tuple(SENSORS),
        {name: sensor.place for name, sensor in SENSORS.items()},
        {name: sensor.xyz_m for name, sensor in SENSORS.items()},
    )


def network_machine(file: model_file.NetworkFile) -> HeatMachine:
    """The network of a model file: one probe a node, one displacement for every name among the expansions."""
    network = heat_system.Network(
        {name: node.heat_capacity_j_per_k for name, node in file.nodes.items()},
        [(*link.between, link.conductance_w_per_k) for link in file.links],
        {name: film.area_m2 for name, film in file.films.items()},
        {name: source.shares for name, source in file.sources.items()},
        {name: node.expansion_um_per_k for name, node in file.nodes.items()},
    )
    return HeatMachine(
        network.heat_system(),
        model_file.stated_laws(file),
        tuple(file.nodes),
        {name: node.place for name, node in file.nodes.items() if node.place is not None},
        {name: node.xyz for name, node in file.nodes.items() if node.xyz is not None},
    )


def modal_machine(file: model_file.ModesFile) -> ModalModel:
    """The modes of a model file; between tested speeds a gain is n^exponent times a factor that is interpolated."""
    modes = file.modes
    speed = np.array(modes.speed_rpm)
    law = SpeedLaw((modes.exponent,), reference_rpm=float(speed[-1]), knots_rpm=tuple(modes.speed_rpm))
    steady = np.stack([np.array(rows, dtype=np.float64) for rows in modes.gains_um.values()], axis=-1)
    factor = (speed / speed[-1]) ** modes.exponent
    return ModalModel(
        responses=tuple(modes.gains_um),
        tau_s=np.array(modes.tau_s),
        gains_um=steady / factor[:, None, None],
        law=law,
        fastest_rpm=float(speed[-1]),
        cooling_growth=np.zeros(len(modes.tau_s)),
    )


SLOWEST = 6


def slowest_time_constants(machine: HeatMachine | ModalModel, conditions: heat_system.Conditions) -> dict[str, Vector]:
    """What is held → the slowest time constants [s] then, longest first; infinite for a part that no fluid reaches.

    The machine stands without coolant, turns at the fastest speed of the conditions, and does so with coolant if that
    is ever on; states that have the same films are told once. Those of a reduced system are its slowest ones, which the
    reduction keeps. Thermal modes say theirs themselves.
    """
    if isinstance(machine, ModalModel):
        return {"standing": machine.tau_s[::-1][:SLOWEST]}
    fastest = float(conditions.spindle_speed.max())
    corners = {"standing": (0.0, 0.0), f"at {fastest:g} r/min": (fastest, 0.0)}
    if conditions.coolant_on.any():
        corners[f"at {fastest:g} r/min with coolant"] = (fastest, 1.0)
    found: dict[str, Vector] = {}
    seen = []
    for name, (speed, coolant) in corners.items():
        films = _films(machine.laws, conditions, speed, coolant)
        if films not in seen:
            found[name] = heat_system.time_constants_s(machine.system, films)[:SLOWEST]
        seen.append(films)
    return found


def _films(
    laws: heat_system.Laws, conditions: heat_system.Conditions, speed_rpm: float, coolant_on: float
) -> dict[str, float]:
    """Film → coefficient [W/(m²·K)] while this is held."""
    count = len(conditions.time_s)
    held = replace(conditions, spindle_speed=np.full(count, speed_rpm), coolant_on=np.full(count, coolant_on))
    return heat_system.summed([law.film for law in laws.films], heat_system.film_coefficients(laws, held)[0])


#: Conditions that a simulated recording holds even if they do not change.
ALWAYS_RECORDED = ("spindle_speed", "ambient")
_COLD_DEGC, _HOT_DEGC = -50.0, 200.0
_AXES = ("X", "Y", "Z", "A", "B", "C")


@dataclass(frozen=True)
class FileModel(ModelOfFile[model_file.ModelFile]):
    """The model that a model file describes; made by `thermal_model`."""

    family = model_file.FAMILY
    machine: HeatMachine | ModalModel  #: The equations that were built from it

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the conditions that act on it, of `schedule.CONDITIONS`."""
        if isinstance(self.machine, ModalModel):
            return ("spindle_speed",)
        laws = self.machine.laws
        used = {
            "spindle_speed": True,
            "torque": any(law.torque_share for law in laws.heat),
            "ambient": True,
            "coolant_on": any(law.while_coolant for law in laws.films) or any(law.coolant_w for law in laws.heat),
            "coolant": any(law.fluid == "coolant" for law in laws.films),
            "machine_on": any(law.on_w for law in laws.heat),
        }
        return tuple(name for name, is_used in used.items() if is_used)

    @property
    def outputs(self) -> tuple[Channel, ...]:
        """Thermometers, then displacements."""
        xyz, unit = (
            {} if isinstance(self.machine, ModalModel) else self.machine.xyz_of_probe,
            CANONICAL_UNITS["temperature"],
        )
        thermometers = [
            Channel(s.name, "temperature", unit, self._place(s), xyz_m=s.xyz or xyz.get(s.at or s.name))
            for s in self._sensors
        ]
        gauges = [Channel(g.name, "displacement", CANONICAL_UNITS["displacement"], axis=_axis(g)) for g in self._gauges]
        return (*thermometers, *gauges)

    def with_parameters(self, values: Mapping[str, float]) -> "FileModel":
        """The same model with other values of some parameters; errors as `file_with`.

        A body whose parameters are all in its laws is not built again.
        """
        file = file_with(
            self.file,
            values,
            model_file.numbers(self.file),
            model_file.checked_model_file,
            model_file.complete_values(self.file),
        )
        built = self.machine if isinstance(self.machine, HeatMachine) else None
        return FileModel(file, machine_of(file, built))

    def simulate(
        self,
        conditions: heat_system.Conditions,
        *,
        time_s: Vector | None = None,
        run: str = "simulation",
        seed: int | None = None,
        instruments: bool = True,
    ) -> Recording:
        """The conditions that act on the model and its outputs, as a recording of one run.

        `time_s`, shape (n_times,), is of the samples [s]; default: every `period_s` of the file. `seed` is of the
        instruments' noise; default: that of the file. Without `instruments` there is neither noise nor resolution, only
        the lag of the thermometers.

        Raises InputError: the spindle is faster than a model of thermal modes knows, or a time is outside the
        conditions.
        """
        settings = self.file.run
        if time_s is None:
            last = conditions.time_s[-1] * (1.0 + 1e-12)  # a step that ends there up to rounding is the last one
            time_s = np.minimum(np.arange(0.0, last, settings.period_s), conditions.time_s[-1])
        read, provenance = self.readings(conditions, time_s, run=run, seed=seed, instruments=instruments)
        acting = {name: held_at(conditions, name, time_s) for name in self.inputs}
        # a coolant that is never switched on, or a machine that is never switched off, needs no channel
        said = {n: course for n, course in acting.items() if n in ALWAYS_RECORDED or np.ptp(course) > 0}
        table = pd.DataFrame(said | read, index=pd.Index(time_s, name="time_s"))
        return Recording.from_runs({run: table}, (*map(input_channel, said), *self.outputs), provenance)

    def readings(
        self, conditions: heat_system.Conditions, time_s: Vector, *, run: str, seed: int | None, instruments: bool
    ) -> tuple[dict[str, Vector], dict[str, Any]]:
        """Outputs by name, each (n_times,), and their provenance; arguments as in `simulate`."""
        seed = self.file.run.seed if seed is None else seed
        degc, um, balance = self._courses(conditions, time_s)
        read: list[tuple[str, Vector, float, float]] = []
        for sensor in self._sensors:
            true = lagged(time_s, degc[sensor.at or sensor.name], sensor.lag_s)
            read.append((sensor.name, true, sensor.noise_k, sensor.resolution_k))
        for gauge in self._gauges:
            true = um[gauge.of or gauge.name]
            zero = true[0] if gauge.zeroed else 0.0
            read.append((gauge.name, true - zero, gauge.noise_um, gauge.resolution_um))
        columns: dict[str, Vector] = {}
        for name, true, noise, resolution in read:
            if instruments:
                true = read_out(true, noise=noise, resolution=resolution, seed=seed, channel=name)
            columns[name] = true
        about = {"model": self.name, "kind": self.file.model.kind, "seed": seed, "instruments": instruments}
        return columns, {"simulated": about, "runs": {run: balance}}

    def _courses(
        self, conditions: heat_system.Conditions, time_s: Vector
    ) -> tuple[dict[str, Vector], dict[str, Vector], dict[str, Any]]:
        """True temperatures [°C] and displacements [µm] by name, and the heat balance."""
        if isinstance(self.machine, ModalModel):
            changes = np.flatnonzero(np.r_[True, np.diff(conditions.spindle_speed[:-1]) != 0])
            start = conditions.time_s[changes] - conditions.time_s[0]
            end = float(conditions.time_s[-1] - conditions.time_s[0])
            um = self.machine.displacement_um(
                Cyclogram(start, conditions.spindle_speed[changes], end), time_s - conditions.time_s[0]
            )
            return {}, {name: um[:, k] for k, name in enumerate(self.machine.responses)}, {}
        settings = self.file.run
        history = simulate_heat(
            self.machine.system,
            self.machine.laws,
            condensed(conditions, settings.step_s),
            time_s=time_s,
            step_s=settings.step_s,
            start_degc=float(conditions.ambient_degc[0]) if settings.start_degc is None else settings.start_degc,
        )
        balance = {
            "stored_j": history.balance.stored_j,
            "sources_j": dict(history.balance.sources_j),
            "films_j": dict(history.balance.films_j),
            "missing_share": history.balance.missing_share,
        }
        return (
            {name: history.probe_degc[:, k] for k, name in enumerate(history.probes)},
            {name: history.displacement_um[:, k] for k, name in enumerate(history.displacements)},
            balance,
        )

    @property
    def _sensors(self) -> tuple[model_file.Sensor, ...]:
        if isinstance(self.machine, ModalModel) or isinstance(self.file, model_file.ModesFile):
            return ()
        return self.file.sensors or tuple(model_file.Sensor(name=name) for name in self.machine.probes)

    @property
    def _gauges(self) -> tuple[model_file.Gauge, ...]:
        machine = self.machine
        known = machine.responses if isinstance(machine, ModalModel) else tuple(machine.system.displacements)
        return self.file.gauges or tuple(model_file.Gauge(name=name) for name in known)

    def _place(self, sensor: model_file.Sensor) -> str | None:
        probe = sensor.at or sensor.name
        known = {} if isinstance(self.machine, ModalModel) else self.machine.place_of_probe
        return sensor.place or known.get(probe, probe)


def thermal_model(file: model_file.ModelFile) -> FileModel:
    """The model that a model file describes, ready to run.

    Raises ModelFileError: a part of the file contradicts the machine that it describes.
    """
    if isinstance(file, model_file.FieldFile | model_file.MeshFile) and file.candidates is not None:
        # scikit-fem comes in with the surfaces of the machine
        from selector.physics.thermal.field_model import with_candidates

        file = with_candidates(file)
    model = FileModel(file, machine_of(file))
    _ = model.parameters  # the bounds are checked here, not when a fit asks for them
    return model


def model_findings(file: model_file.ModelFile) -> tuple[Finding, ...]:
    """A warning for every group of linked nodes without any film; none for models of other kinds.

    Heat that enters such a group stays in it; a single node that nothing heats keeps its temperature for ever.
    """
    if not isinstance(file, model_file.NetworkFile):
        return ()
    row = {name: number for number, name in enumerate(file.nodes)}
    ends = np.array([[row[name] for name in link.between] for link in file.links], dtype=np.int64).reshape(-1, 2)
    linked = sparse.coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(row), len(row)))
    count, group = connected_components(linked, directed=False)
    wetted = {node for film in file.films.values() for node in film.area_m2}
    heated = {node for source in file.sources.values() for node in source.shares}
    groups = ([name for name in row if group[row[name]] == number] for number in range(count))
    return tuple(_closed(nodes, bool(heated & set(nodes))) for nodes in groups if not wetted & set(nodes))


def _closed(nodes: list[str], heated: bool) -> Finding:
    effect = "heat that enters stays there for ever" if heated else "nothing outside ever changes their temperature"
    return FINDINGS.finding(
        "no-way-for-heat",
        f"{', '.join(nodes[:8])}{' …' if len(nodes) > 8 else ''}: no film, and no link to what has one, so {effect}.",
        Where(channel=nodes[0] if len(nodes) == 1 else None),
        {"nodes": nodes, "heated": heated},
    )


def simulation_findings(simulated: Recording) -> tuple[Finding, ...]:
    """What is odd about a simulation: temperatures that no machine tool survives.

    Raises InputError: the numbers left all bounds: heat that grows with the temperature it makes.
    """
    if not np.isfinite(simulated.frame.to_numpy()).all():
        raise InputError(
            "a simulation whose temperatures grow beyond all bounds",
            expected="heat that the films can carry away",
            where="simulation",
            advice="check the signs and sizes of the sources, and give every part a way to a fluid",
        )
    names = simulated.with_role("temperature")
    values = simulated.frame[list(names)].to_numpy()
    ends = {name: (low, high) for name, low, high in zip(names, values.min(axis=0), values.max(axis=0), strict=True)}
    odd = [name for name, (low, high) in ends.items() if high > _HOT_DEGC or low < _COLD_DEGC]
    if not odd:
        return ()
    low, high = (float(end([ends[name][k] for name in odd])) for k, end in enumerate((min, max)))
    return (
        FINDINGS.finding(
            "unlikely-temperature",
            f"{', '.join(odd[:8])}: {low:.4g} to {high:.4g} °C, which no machine tool survives.",
            Where(channel=odd[0] if len(odd) == 1 else None),
            {"channels": odd, "lowest_degc": low, "highest_degc": high},
        ),
    )


def input_channel(name: str) -> Channel:
    """The channel that holds a condition, by its name in `schedule.CONDITIONS`."""
    about = CONDITIONS[name]
    return Channel(name, about.role, CANONICAL_UNITS[about.role], about.place)


def _axis(gauge: model_file.Gauge) -> str | None:
    """The axis that the file says, or the one after which the displacement is called: Z, Z_lower, Y upper."""
    letter = (gauge.of or gauge.name)[:1].upper()
    rest = (gauge.of or gauge.name)[1:2]
    return gauge.axis or (letter if letter in _AXES and not rest.isalnum() else None)


_START_K = 1.0  #: What a machine that stood for a night may differ from its hall.
_START_SAMPLES = 5


def driven_runs(
    model: FileModel,
    recording: Recording,
    *,
    inputs: model_file.InputsSection,
    otherwise: heat_system.Conditions,
    seed: int | None = None,
    progress: Progress = unheard,
) -> tuple[Recording, tuple[Finding, ...]]:
    """A simulation of every run of a recording, driven by what was recorded, and what is to be said about it.

    Samples stand at the time stamps of the recording. An output has the name, place and axis of the recorded channel
    with the same name; a displacement else those of the only one along its axis. `inputs` and `otherwise` are those of
    `schedule.driven`. Without a `seed` thermometers and gauges are free of noise and rounding.

    Raises InputError: the recording cannot drive this model.
    """
    matched = _matched(model.outputs, recording)
    outputs = [channel.name for channel in model.outputs]
    runs: dict[str, pd.DataFrame] = {}
    told: dict[str, Any] = {}
    provenance: dict[str, Any] = {}
    used: dict[str, str] = {}
    missing: dict[str, list[str]] = {}
    for number, run in enumerate(recording.runs):
        progress(number, len(recording.runs), run)
        drive = driven(recording, run, inputs, otherwise)
        names = {channel: name for channel, name in drive.channels.items() if name in model.inputs}
        used |= names
        for name in drive.not_recorded:
            if name in model.inputs:
                missing.setdefault(name, []).append(run)
        time_s = recording.time_s(run)
        of_run = None if seed is None else seed_of_run(seed, run)
        read, about = model.readings(drive.conditions, time_s, run=run, seed=of_run, instruments=seed is not None)
        courses = {matched[name].name: read[name] for name in outputs}
        courses |= {channel: held_at(drive.conditions, name, time_s) for channel, name in names.items()}
        runs[run] = pd.DataFrame(courses, pd.Index(time_s, name="time_s"))
        told[run] = about["runs"][run]
        provenance = {**about, "runs": told}
    acting = ((recording.channel(channel), name) for channel, name in used.items())
    # where a recorded channel has no place, that of the condition
    acted = [replace(channel, place=channel.place or input_channel(name).place) for channel, name in acting]
    channels = (*acted, *(matched[channel.name] for channel in model.outputs))
    answer = Recording.from_runs(runs, channels, provenance)
    return answer, (
        *(_not_recorded(name, lacking, recording, otherwise) for name, lacking in missing.items()),
        *_not_compared(model, matched, recording),
        *_other_start(answer, recording),
        *simulation_findings(answer),
    )


def _matched(outputs: tuple[Channel, ...], recording: Recording) -> dict[str, Channel]:
    """Output → the channel of the recording that it is compared with, or itself."""
    recorded = {channel.name: channel for channel in recording.channels}
    matched = {
        output.name: recorded[output.name]
        for output in outputs
        if output.name in recorded and recorded[output.name].role == output.role
    }
    for output in outputs:
        if output.name in matched or output.role != "displacement" or output.axis is None:
            continue
        alike = [c for c in recording.channels if c.role == "displacement" and c.axis == output.axis]
        rivals = [o for o in outputs if o.role == "displacement" and o.axis == output.axis]
        if len(alike) == 1 and len(rivals) == 1 and alike[0] not in matched.values():
            matched[output.name] = alike[0]
    taken = set(recorded)
    for output in outputs:
        if output.name not in matched:
            name = output.name
            while name in taken:  # a name that the recording uses for something else
                name += " (simulated)"
            taken.add(name)
            matched[output.name] = replace(output, name=name)
    return matched


def _not_recorded(name: str, runs: list[str], recording: Recording, otherwise: heat_system.Conditions) -> Finding:
    course = held_at(otherwise, name, otherwise.time_s)
    moves = float(course.max()) > float(course.min())
    value = (
        f"{course.min():g} to {course.max():g}, a course that says nothing of these runs" if moves else f"{course[0]:g}"
    )
    which = "any run" if len(runs) == len(recording.runs) else ", ".join(runs[:6])
    return FINDINGS.finding(
        "input-not-recorded",
        f"{name} was not recorded in {which}; the value of the model file was used ({value}).",
        Where(run=runs[0] if len(runs) == 1 else None),
        {"input": name, "runs": runs},
        f"record it, or name its channel under [inputs]: {name} = \"CHANNEL\"", level="warning" if moves else "info",
    )  # fmt: skip


def _other_start(answer: Recording, recording: Recording) -> Iterator[Finding]:
    """Runs whose recorded thermometers began elsewhere than the model, which starts with one temperature."""
    shared = [name for name in answer.with_role("temperature") if name in recording.with_role("temperature")]
    off_k: dict[str, float] = {}
    for run in answer.runs:
        first = recording.values(run, shared)[:_START_SAMPLES] - answer.values(run, shared)[:_START_SAMPLES]
        there = first[:, np.isfinite(first).any(axis=0)]
        if there.size:
            gaps = np.nanmedian(there, axis=0)
            worst = float(gaps[np.argmax(np.abs(gaps))])
            if abs(worst) > _START_K:
                off_k[run] = worst
    if off_k:
        worst_run = max(off_k, key=lambda run: abs(off_k[run]))
        yield FINDINGS.finding(
            "start-differs",
            f"{len(off_k)} of {len(answer.runs)} runs did not begin at the temperature at which the model starts: in "
            f"{worst_run} a thermometer read {off_k[worst_run]:+.1f} K against it.",
            Where(run=worst_run if len(off_k) == 1 else None),
            {"largest_difference_k": off_k},
        )


def _not_compared(model: FileModel, matched: dict[str, Channel], recording: Recording) -> Iterator[Finding]:
    """What of the simulation has no recorded counterpart, if anything."""
    recorded = set(recording.channels)
    alone = [output.name for output in model.outputs if matched[output.name] not in recorded]
    if alone:
        none = len(alone) == len(model.outputs)
        yield FINDINGS.finding(
            "output-not-recorded",
            ("None" if none else f"{len(alone)}") + f" of the {len(model.outputs)} outputs of the model "
            + ("has a recorded channel of its name or axis." if none else "have no recorded channel: ")
            + ("" if none else ", ".join(alone[:8]) + ("…" if len(alone) > 8 else "") + "."),
            evidence={"outputs": alone},
            suggestion="call sensors and gauges of the model file as the channels of the recording are called",
            level="warning" if none else "info",
        )  # fmt: skip
