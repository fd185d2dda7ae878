"""How does a true machine with a model file become a case: sizes of effects, wrong parameters, noise, truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from proving_ground.case import Case, HeldOut, Kind, Scenario, TrueEffect, Truth
from selector.diagnosis.open_model.runnable import OwnModel
from selector.errors import InputError
from selector.physics.simulation_kind import simulation_kinds
from selector.recording import Channel, Recording
from selector.types import Matrix, Vector

Courses = Mapping[str, Vector]
RUNS = ("r1", "r2", "r3")
_LEAST, _MOST = 1.0, 5.0
"""Between what an effect lies that the parameters of the model do not take in, in parts of the noise."""
_SLIGHTLY, _WRONG = 0.05, 0.2
"""By what share parameters are off at most: where an effect is missing, and where they are what is wrong."""
_STEP = 0.02
_PROBED = 1e-2


@dataclass(frozen=True, eq=False)
class Machine:
    """A true machine, what it was told to do, and a model file that lacks what `effects` are."""

    kind: str  #: Of simulation
    plain: Mapping[str, Any]  #: The model file, its parameters right
    period_s: float  #: Of the recording
    inputs: tuple[Channel, ...]
    responses: Mapping[Channel, float]  #: Channel → standard deviation of its noise
    programmes: Mapping[str, Courses]  #: Run → input → course
    #: (inputs, sizes of the effects) → every response without noise, and what inputs become while it runs
    read: Callable[[Courses, Sequence[float]], Courses]
    first: tuple[float, ...] = ()  #: A size of every effect, of the order of what matters

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Of the recording."""
        return (*self.inputs, *self.responses)

    def recorded(
        self, programmes: Mapping[str, Courses], sizes: Sequence[float], generator: np.random.Generator | None
    ) -> Recording:
        """What is recorded of these runs; without a generator there is no noise."""
        tables = {}
        for run, told in programmes.items():
            courses = {**told, **self.read(told, sizes)}
            if generator is not None:
                for channel, sd in self.responses.items():
                    noisy = courses[channel.name] + sd * generator.standard_normal(len(courses[channel.name]))
                    courses[channel.name] = np.round(noisy / (0.1 * sd)) * (0.1 * sd)
            n = len(courses[self.channels[0].name])
            index = pd.Index(self.period_s * np.arange(n), name="time_s")
            tables[run] = pd.DataFrame({one.name: courses[one.name] for one in self.channels}, index)
        return Recording.from_runs(tables, self.channels, {})

    def model(self, recording: Recording, off: Mapping[str, float] | None = None) -> OwnModel:
        """The model of the file, driven by a recording; parameters are `off` by these factors."""
        kind = simulation_kinds()[self.kind]
        made = OwnModel(self.kind, kind.checked(self.plain, where="proof"), recording)
        return made.with_values({name: made.parameters[name].value * by for name, by in (off or {}).items()})


@dataclass(frozen=True)
class Concealed:
    """A scenario of an open model: who is right about it, and the machine that a generator draws."""

    name: str
    kind: Kind
    verdicts: tuple[str, ...]
    machine: Callable[[np.random.Generator], Machine]
    effects: tuple[TrueEffect, ...] = ()
    tolerated: tuple[str, ...] = ()
    note: str = ""
    larger: float = 1.0  #: What no catalogue knows is larger than what it knows

    @property
    def scenario(self) -> Scenario:
        """Cases of it: their strength is drawn, since a model is true up to a misfit only."""
        return Scenario(self.name, "open_model", self.kind, self._build, self.note, has_strength=False)

    def _build(self, seed: int, wanted: float | None) -> Case:
        generator = np.random.default_rng([seed, *self.name.encode()])
        machine = self.machine(generator)
        ratios = self.larger * np.exp(generator.uniform(np.log(_LEAST), np.log(_MOST), len(machine.first)))
        return concealed_case(self, machine, ratios.tolist(), generator)


def concealed_case(told: Concealed, machine: Machine, ratios: Sequence[float], generator: np.random.Generator) -> Case:
    """A case whose effects are these many times the noise, beside all that parameters of the model can take in."""
    plain = machine.recorded(machine.programmes, [0.0] * len(machine.first), None)
    right = machine.model(plain)
    names = [name for name in right.refitted if name.rpartition(".")[2] not in ("exponent", "phase_rad")]
    off = _WRONG if told.kind == "miscalibrated" else _SLIGHTLY if machine.first else 0.0
    factors = {name: 1.0 + off * generator.uniform(-1.0, 1.0) for name in names if name not in right.bounded}
    tangents = _tangents(machine, right, names)
    sizes, d_prime = _sizes(machine, plain, tangents, ratios) if len(ratios) else ([], None)
    recording = machine.recorded(machine.programmes, sizes, generator)
    model = machine.model(recording, factors if off else None)
    simulation = _simulated(model, recording)
    quiet = machine.recorded(machine.programmes, sizes, None)
    held_out = _held_out(machine, simulation, right.simulated({}), tangents, quiet)
    truth = Truth(told.verdicts, told.effects, told.tolerated, d_prime, held_out=held_out)
    responses = tuple(channel.name for channel in machine.responses)
    return Case(told.name, "open_model", told.kind, recording, simulation, responses, truth, model)


def _simulated(model: OwnModel, recording: Recording) -> Recording:
    """The recorded channels alone: a model may say more, which nobody gives away."""
    done = model.simulated({})
    names = [name for name in done.names if name in recording.names]
    return Recording(done.frame[names], tuple(done.channel(name) for name in names), {})


def _white(machine: Machine, recording: Recording, run: str) -> Matrix:
    """Responses of a run in units of their noise, shape (n_rows, n_responses)."""
    names = [channel.name for channel in machine.responses]
    return np.asarray(recording.values(run, names) / np.array(list(machine.responses.values())))


def _fitted_runs(machine: Machine, recording: Recording) -> Matrix:
    return np.concatenate([_white(machine, recording, run) for run in RUNS[:-1]])


def _tangents(machine: Machine, model: OwnModel, names: Sequence[str]) -> dict[str, Matrix]:
    """Run → change of its responses with every parameter, per share of it; shape (n_rows, n_responses, n_parameters).

    A parameter that lets the model run away is left out.
    """
    base, moved = model.simulated({}), []
    for name in names:
        with suppress(InputError):
            moved.append(model.simulated({name: (1.0 + _STEP) * model.parameters[name].value}))
    return {
        run: np.stack([(_white(machine, one, run) - _white(machine, base, run)) / _STEP for one in moved], axis=2)
        for run in RUNS
    }


def _without(tangents: Mapping[str, Matrix], target: Matrix) -> tuple[Matrix, Vector]:
    """What parameters leave of courses in the fitted runs, and their shares; none goes much beyond its nameplate."""
    columns = np.concatenate([tangents[run] for run in RUNS[:-1]])
    flat = columns.reshape(-1, columns.shape[2])
    inner = flat.T @ flat + np.eye(flat.shape[1]) / _WRONG**2
    shares = np.linalg.solve(inner, flat.T @ target.ravel())
    return target - columns @ shares, shares


def _sizes(
    machine: Machine, plain: Recording, tangents: Mapping[str, Matrix], ratios: Sequence[float]
) -> tuple[list[float], float]:
    """Sizes that leave these many times the noise where they show most, and the d′ of the least clear effect.

    Effects are a little more or less than proportional to their size: twice it is scaled.
    """
    base = _fitted_runs(machine, plain)

    def left(sizes: Sequence[float]) -> Matrix:
        programmes = {run: machine.programmes[run] for run in RUNS[:-1]}
        return _without(tangents, _fitted_runs(machine, machine.recorded(programmes, sizes, None)) - base)[0]

    sizes, clear = list(machine.first), np.inf
    for k, ratio in enumerate(ratios):
        for _ in range(2):
            rest = left([size if j == k else 0.0 for j, size in enumerate(sizes)])
            by = float(np.clip(ratio / np.sqrt(np.mean(rest**2, axis=0)).max(), _PROBED, 1.0 / _PROBED))
            sizes[k] *= by
        clear = min(clear, by * float(np.linalg.norm(rest)))
    return sizes, clear


def _held_out(
    machine: Machine, given: Recording, right: Recording, tangents: Mapping[str, Matrix], truth: Recording
) -> dict[str, HeldOut]:
    """Errors of the last run: as given, with parameters fitted to the others, and noise alone, which an oracle has."""
    last = RUNS[-1]
    shares = _without(tangents, _fitted_runs(machine, truth) - _fitted_runs(machine, right))[1]
    again = _white(machine, right, last) + tangents[last] @ shares
    missed = [_white(machine, truth, last) - one for one in (_white(machine, given, last), again)]
    before, recalibrated = (np.sqrt(np.mean(one**2, axis=0) + 1.0) for one in missed)
    return {
        channel.name: HeldOut(sd * float(before[k]), sd * float(recalibrated[k]), sd, sd)
        for k, (channel, sd) in enumerate(machine.responses.items())
    }


def effect(id_: str, *channels: str, accept: tuple[str, ...] = (), place: str | None = None) -> TrueEffect:
    """A concealed effect that shows in these channels."""
    return TrueEffect(id_, (id_, *accept), channels, place)
