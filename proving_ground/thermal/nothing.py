"""Cases in which nothing is missing: noise of every kind, distractors, odd recordings; or only parameters are wrong."""

from __future__ import annotations

from typing import Any

import numpy as np

from proving_ground.thermal.duty import Duty, changed, held
from proving_ground.thermal.scene import CABINETS, Gauge, decoy, of, thermal_case
from proving_ground.world import Made, Plan, scenarios_of
from selector.recording import Channel
from selector.types import Vector

_MIXED = ("steps", "warm-up", "intermittent")
_N = of("n")


def _clean(name: str, note: str, *verdicts: str, styles: tuple[str, ...] = _MIXED, **rest: Any) -> tuple[Plan, Made]:
    right = ("nothing-missing", *verdicts)
    return thermal_case(f"clean.thermal/{name}", note, (), styles, kind="clean", verdicts=right, **rest)


def _wrong(name: str, note: str, **rest: Any) -> tuple[Plan, Made]:
    return thermal_case(f"miscalibrated.thermal/{name}", note, (), _MIXED, **{"kind": "miscalibrated", **rest})


def _shut(generator: np.random.Generator, one: Duty) -> Vector:
    """The pump's bit follows the programme of the spindle half of the time; no jet is open."""
    followed = held(generator, len(one.time_s), 20.0, 60.0, np.array([0.0, 1.0]))
    own = held(generator, len(one.time_s), 15.0, 90.0, np.array([0.0, 0.0, 1.0]))
    return np.asarray(np.maximum((one["speed"] > 0.0) * followed, own))


_WANDERERS = tuple(
    Gauge(
        Channel(f"T{20 + k}", "temperature", "degC", place),
        lambda one, generator: 24.0 + 2.0 * np.cumsum(generator.standard_normal(len(one.time_s))) / np.sqrt(2000.0),
        lag_s=120.0,
    )
    for k, place in enumerate(("window frame", "tool magazine", "lamp", "pallet changer", "chip bin", "operator panel"))
)
_NO_NAME: dict[str, Any] = {"verdicts": ("nothing-missing", "miscalibrated", "unexplained"), "is_true": False}
_CASES = (
    _clean("white", "White noise.", noise="white"),
    _clean("ar", "AR(1) noise, 0.85 from sample to sample.", noise="ar"),
    _clean("walk", "Noise that is almost a random walk.", "unexplained", noise="walk"),
    _clean("cycle", "A part of the noise is repeated with every machine cycle.", "unexplained", noise="cycle"),
    _clean("heavy", "Noise with the tails of Student's t, 3 degrees.", noise="heavy"),
    _clean(
        "quantised", "A probe that reads in steps of 0.5 µm.", styles=("warm-up", "steps", "cooling"), noise="quantised"
    ),
    _clean("distractors", "Four cabinets and a feed that wander with the duty.", gauges=(_N, of("f"), *CABINETS)),
    _clean(
        "decoy",
        "Two cabinets that warmed up like the machine in the first run, six random walks.",
        styles=("warm-up", "steps", "intermittent"),
        gauges=(_N, decoy("T10", "control cabinet", 3000.0), decoy("T11", "drive cabinet", 7000.0), *_WANDERERS),
        noise="ar",
    ),
    _clean(
        "dry coolant",
        "The coolant pump's bit toggles, the jets are shut.",
        gauges=(_N, of("M8"), of("T8")),
        duties=changed(coolant=_shut),
    ),
    _clean(
        "all known",
        "Coolant and feed act, and the simulation has them.",
        gauges=(_N, of("M8"), of("T8"), of("f")),
        knows=("coolant", "feed"),
    ),
    _clean(
        "uneven",
        "Uneven sampling, lost rows, the simulation on a clock of its own.",
        lost=0.06,
        sampling="uneven",
        own_clock=True,
    ),
    _clean("jitter", "Stamps that jitter; speed is not recorded.", gauges=(), sampling="jitter", own_clock=True),
    _clean("one run", "A single run of 1.5 to 2 h.", styles=("intermittent",), hours=(1.5, 2.0)),
    _clean(
        "hot hall",
        "30 °C, a hall that drifts by kelvins, a quick programme; five runs.",
        styles=("intermittent", "steps", "intermittent", "warm-up", "steps"),
        gauges=(_N, *CABINETS[:2]),
        hall=(30.0, 1.4, 1.5),
        hours=(3.0, 4.5),
    ),
    _clean("one speed", "All runs at one speed: hardly any excitation.", styles=("one speed", "one speed", "warm-up")),
    _wrong("strong", "20 % too much heat.", gain=1.2),
    _wrong("weak", "20 % too little heat; zero was set elsewhere.", gain=0.8, offset_um=3.0),
    _wrong("late", "The simulation comes 18 s late, with 7 % too little heat.", noise="white", delay_s=18.0, gain=0.93),
    _wrong("parameters/2 %", "Heat, capacities, joints and films are 2 % off.", **_NO_NAME, off=0.02),
    _wrong("parameters/5 %", "Heat, capacities, joints and films are 5 % off.", **_NO_NAME, off=0.05),
    _wrong(
        "strong beside distractors",
        "15 % too much heat; coolant, feed, cabinets are there.",
        gauges=(_N, of("f"), of("M8"), of("T8"), *CABINETS),
        knows=("coolant", "feed"),
        gain=1.15,
        noise="ar",
    ),
)
SCENARIOS = scenarios_of(_CASES)
