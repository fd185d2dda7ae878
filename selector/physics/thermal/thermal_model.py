"""A thermal model that runs: conditions in, a recording out, its parameters open to be fitted again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.model_parameters import Parameter
from selector.physics.thermal.file.model_file import FieldFile, Gauge, ModelFile, ModesFile, Sensor
from selector.physics.thermal.file.parameters import parameters, with_parameters
from selector.physics.thermal.file.systems import HeatMachine, heat_machine, modal_machine
from selector.physics.thermal.finding_table import FINDINGS
from selector.physics.thermal.modes.cyclogram import Cyclogram
from selector.physics.thermal.modes.modes import ModalModel
from selector.physics.thermal.network.laws import Conditions
from selector.physics.thermal.network.transient import simulate_heat
from selector.physics.thermal.schedule import CONDITIONS, condensed, held_at, lagged, read_out
from selector.recording import Channel, Recording
from selector.types import Vector
from selector.units import CANONICAL_UNITS

ALWAYS_RECORDED = ("spindle_speed", "ambient")
"""Conditions that a simulated recording holds even if they do not change."""

_COLD_DEGC, _HOT_DEGC = -50.0, 200.0
_AXES = ("X", "Y", "Z", "A", "B", "C")


@dataclass(frozen=True)
class FileModel:
    """The model that a model file describes; made by `thermal_model`."""

    file: ModelFile  #: The file's content
    machine: HeatMachine | ModalModel  #: The equations that were built from it

    @property
    def name(self) -> str:
        """What the file calls it."""
        return self.file.model.name

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
        thermometers = [
            Channel(s.name, "temperature", CANONICAL_UNITS["temperature"], self._place(s), xyz_m=self._xyz(s))
            for s in self._sensors
        ]
        gauges = [Channel(g.name, "displacement", CANONICAL_UNITS["displacement"], axis=_axis(g)) for g in self._gauges]
        return (*thermometers, *gauges)

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Named numbers with units and bounds, see `parameters.parameters`."""
        return parameters(self.file)

    def with_parameters(self, values: Mapping[str, float]) -> FileModel:
        """The same model with other values of some parameters; errors as in `parameters.with_parameters`.

        A body whose parameters are all in its laws is not built again.
        """
        file = with_parameters(self.file, values)
        built = self.machine if isinstance(self.machine, HeatMachine) else None
        return FileModel(file, _machine(file, built))

    def simulate(
        self,
        conditions: Conditions,
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
        seed = settings.seed if seed is None else seed
        degc, um, balance = self._courses(conditions, time_s)
        acting = {name: held_at(conditions, name, time_s) for name in self.inputs}
        # a coolant that is never switched on, or a machine that is never switched off, needs no channel
        said = {n: course for n, course in acting.items() if n in ALWAYS_RECORDED or np.ptp(course) > 0}
        columns: dict[str, Vector] = dict(said)
        for sensor in self._sensors:
            true = lagged(time_s, degc[sensor.at or sensor.name], sensor.lag_s)
            columns[sensor.name] = read_out(
                true,
                noise=sensor.noise_k * instruments,
                resolution=sensor.resolution_k * instruments,
                seed=seed,
                channel=sensor.name,
            )
        for gauge in self._gauges:
            true = um[gauge.of or gauge.name]
            columns[gauge.name] = read_out(
                true - (true[0] if gauge.zeroed else 0.0),
                noise=gauge.noise_um * instruments,
                resolution=gauge.resolution_um * instruments,
                seed=seed,
                channel=gauge.name,
            )
        table = pd.DataFrame(columns, index=pd.Index(time_s, name="time_s"))
        provenance = {
            "simulated": {"model": self.name, "kind": self.file.model.kind, "seed": seed, "instruments": instruments},
            "runs": {run: balance},
        }
        return Recording.from_runs({run: table}, (*map(input_channel, said), *self.outputs), provenance)

    def _courses(
        self, conditions: Conditions, time_s: Vector
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
    def _sensors(self) -> tuple[Sensor, ...]:
        if isinstance(self.machine, ModalModel) or isinstance(self.file, ModesFile):
            return ()
        return self.file.sensors or tuple(Sensor(name=name) for name in self.machine.probes)

    @property
    def _gauges(self) -> tuple[Gauge, ...]:
        machine = self.machine
        known = machine.responses if isinstance(machine, ModalModel) else tuple(machine.system.displacements)
        return self.file.gauges or tuple(Gauge(name=name) for name in known)

    def _place(self, sensor: Sensor) -> str | None:
        probe = sensor.at or sensor.name
        known = {} if isinstance(self.machine, ModalModel) else self.machine.place_of_probe
        return sensor.place or known.get(probe, probe)

    def _xyz(self, sensor: Sensor) -> tuple[float, float, float] | None:
        known = {} if isinstance(self.machine, ModalModel) else self.machine.xyz_of_probe
        return sensor.xyz or known.get(sensor.at or sensor.name)


def thermal_model(file: ModelFile) -> FileModel:
    """The model that a model file describes, ready to run.

    Raises ModelFileError: a part of the file contradicts the machine that it describes.
    """
    if isinstance(file, FieldFile) and file.candidates is not None:
        # scikit-fem comes in with the surfaces of the machine
        from selector.physics.thermal.field_model import with_candidates

        file = with_candidates(file)
    model = FileModel(file, _machine(file))
    _ = model.parameters  # the bounds are checked here, not when a fit asks for them
    return model


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
    values = simulated.frame[list(names)]
    odd = [name for name in names if values[name].max() > _HOT_DEGC or values[name].min() < _COLD_DEGC]
    if not odd:
        return ()
    low, high = float(values[odd].min().min()), float(values[odd].max().max())
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


def _machine(file: ModelFile, built: HeatMachine | None = None) -> HeatMachine | ModalModel:
    return modal_machine(file) if isinstance(file, ModesFile) else heat_machine(file, built)


def _axis(gauge: Gauge) -> str | None:
    """The axis that the file says, or the one after which the displacement is called: Z, Z_lower, Y upper."""
    letter = (gauge.of or gauge.name)[:1].upper()
    rest = (gauge.of or gauge.name)[1:2]
    return gauge.axis or (letter if letter in _AXES and not rest.isalnum() else None)
