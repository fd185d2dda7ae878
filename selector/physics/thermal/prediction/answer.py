"""What a method is asked of a duty cycle, and what it answers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from selector.findings import Finding
from selector.physics.thermal.modes.cyclogram import AmbientCourse, Cyclogram
from selector.physics.thermal.modes.heldout import AT_MOST
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.prediction.tests_judged import RepeatedTest
from selector.types import Vector

Start = Literal["cold", "tests"]


@dataclass(frozen=True)
class Asked:
    """The tests, and the duty cycle that is to be predicted from them."""

    tests: tuple[ThermalTest, ...]
    responses: tuple[str, ...]
    cyclogram: Cyclogram
    hall: AmbientCourse | None  #: Temperatures around the machine during the duty cycle, by name; None: not known
    start: Start | None  #: {"cold", "tests"}: How it begins; None: as is usual for such tests
    units: tuple[str, ...]  #: (n_responses,): µm, or K for a temperature

    def listed(self, values: Vector) -> str:
        """Numbers (n_responses,) with unit and response, for a sentence."""
        told = zip(values, self.units, self.responses, strict=True)
        return ", ".join(f"{value:.2g} {unit} in {name}" for value, unit, name in told)


@dataclass(frozen=True)
class Mode:
    """A time constant [s] with the ends of its 95 % interval, None where the tests do not bound it."""

    tau_s: float
    low: float | None
    high: float | None


def modes_of(tau_s: Vector, low_s: Vector, high_s: Vector) -> tuple[Mode, ...]:
    """Time constants (n_modes,) [s] with their intervals; NaN where the tests do not bound them."""
    ends = [[float(end) if np.isfinite(end) else None for end in ends] for ends in (low_s, high_s)]
    return tuple(Mode(float(tau), low, high) for tau, low, high in zip(tau_s, *ends, strict=True))


@dataclass(frozen=True)
class Answer:
    """What a method says of the duty cycle."""

    #: Duty cycle, times (n_times,) [s] → displacements (n_times, n_responses) [µm]
    course: Callable[[Cyclogram, Vector], Vector]
    findings: tuple[Finding, ...]
    repeats: tuple[RepeatedTest, ...]
    modes: tuple[Mode, ...] = ()
    #: residual_um and heldout_um: (n_responses,): RMS error on the tests that were fitted, and that were left out [µm]
    residual_um: Vector | None = None
    heldout_um: Vector | None = None
    #: Times → standard deviations of the error (n_times, n_responses) [µm]; None: what was left out says all
    error_um: Callable[[Vector], Vector] | None = None
    left_out_um: Mapping[str, Vector] = field(default_factory=dict)
    judged: int = 0  #: Tests that were left out as a whole and predicted by the others
    claim_factor: float = AT_MOST  #: How many times the claimed error it is at most, 19 times in 20
    start: Start = "cold"
    ambients: tuple[str, ...] = ()  #: Temperatures around the machine that drive it
