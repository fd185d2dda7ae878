"""Cases whose simulation lacks what surrounds the machine: hall (`thermal.ambient`), coolant (`thermal.coolant`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from selector.proof.thermal import hiding
from selector.proof.thermal.duty import BOTH, STEP_S, Duty, Maker, Omission, gated, with_bath
from selector.proof.thermal.machine import Heat
from selector.proof.thermal.scene import Scene, of, scenarios_of, thermal_case, warmed
from selector.types import Vector

Change = Callable[[np.random.Generator, Sequence[Duty]], Sequence[Duty]]


def hall(axes: Mapping[str, float] = BOTH, *, accept: tuple[str, ...] = (), brief: bool = False) -> Maker:
    """The hall acts on the machine; the simulation has it constant."""

    def heated(heat: Heat, one: Duty, size: float) -> Heat:
        start = one["hall"][0]
        return with_bath(heat, "hall", start + size * (one["hall"] - start), np.ones(len(one.time_s)))

    omission = Omission("thermal.ambient", accept, place="structure", heated=heated, axes=axes, brief=brief)
    return lambda _generator, _tool, _duties: omission


def jets(
    by: Callable[[Duty], Vector] = lambda one: one["coolant"],
    axes: Mapping[str, float] = BOTH,
    *,
    accept: tuple[str, ...] = (),
    brief: bool = False,
) -> Maker:
    """Coolant on nose, headstock and column foot while it runs."""

    def heated(heat: Heat, one: Duty, size: float) -> Heat:
        return with_bath(heat, "coolant", one["coolant_degc"], size * by(one))

    omission = Omission("thermal.coolant", accept, place="headstock nose", heated=heated, axes=axes, brief=brief)
    return lambda _generator, _tool, _duties: omission


def changed(**courses: Callable[[np.random.Generator, Duty], Vector]) -> Change:
    """Duties with other courses, each drawn from the generator and the duty as it is."""

    def change(generator: np.random.Generator, duties: Sequence[Duty]) -> list[Duty]:
        result = []
        for one in duties:
            for name, course in courses.items():
                one = one.having(**{name: course(generator, one)})
            result.append(one)
        return result

    return change


def _load(one: Duty) -> Vector:
    return one["speed"] / max(1.0, float(one["speed"].max()))


def _heated_hall(_generator: np.random.Generator, one: Duty) -> Vector:
    return one["hall"][0] + 3.0 * warmed(_load(one), 1500.0) if one.run == "r1" else one["hall"]


def _gate(generator: np.random.Generator, one: Duty) -> Vector:
    course = np.array(one["hall"])
    if one.run != "r1":
        at = int(len(course) * generator.uniform(0.3, 0.7))
        course[at : at + int(60.0 * generator.uniform(13.0, 17.0) / STEP_S)] -= generator.uniform(5.0, 7.0)
    return warmed(course, 90.0)


def _seldom_on(generator: np.random.Generator, one: Duty) -> Vector:
    course = np.zeros(len(one.time_s))
    if one.run != "r1":
        at = int(len(course) * generator.uniform(0.25, 0.65))
        course[at : at + int(60.0 * generator.uniform(18.0, 26.0) / STEP_S)] = 1.0
    return course


def _with_spindle(generator: np.random.Generator, one: Duty) -> Vector:
    if one.run == "r1":
        return (one["speed"] > 0.0).astype(np.float64)
    return gated(generator, len(one.time_s), (200.0, 500.0), (150.0, 500.0))


def chilled(generator: np.random.Generator, one: Duty) -> Vector:
    """Coolant that a chiller keeps some kelvins below the hall."""
    return np.full(len(one.time_s), one["hall"][0] - float(generator.uniform(3.0, 6.0)))


_DRIFT = (21.0, 0.8, 1.3)
_N = (of("n"),)
_CASES = (
    thermal_case(
        "thermal.ambient/absorbed",
        "The hall drifts by a few kelvins; offset and gain of the simulation were fitted to that.",
        Scene(
            (hall(),),
            ("warm-up", "steps", "intermittent"),
            _N,
            knows=("constant hall",),
            hall=_DRIFT,
            refitted=True,
            noise="white",
            periods_s=(20.0,),
        ),
        hidden=("absorbed",),
    ),
    thermal_case(
        "thermal.ambient/one axis",
        "The hall bends Y alone; coolant and feed are there and known.",
        Scene(
            (hall({"Y": 1.0}),),
            ("steps", "intermittent", "cooling"),
            (of("n"), of("M8"), of("T8"), of("f")),
            knows=("constant hall", "coolant", "feed"),
            hall=_DRIFT,
            noise="white",
            periods_s=(15.0, 20.0),
        ),
        hidden=("small",),
        measures=(hiding.one_axis("Y"),),
    ),
    thermal_case(
        "thermal.ambient/warmed by the machine",
        "In the first run the hall warms up with the machine; in the others it goes its own way.",
        Scene(
            (hall(),),
            ("warm-up", "steps", "intermittent"),
            _N,
            knows=("constant hall",),
            hall=(21.0, 0.3, 0.8),
            duties=changed(hall=_heated_hall),
        ),
        measures=(hiding.like_in_first_run(),),
    ),
    thermal_case(
        "thermal.ambient/gate",
        "A gate lets cold air in for a quarter of an hour; the hall is steady otherwise.",
        Scene(
            (hall(brief=True),),
            ("warm-up", "steps", "steps"),
            _N,
            knows=("constant hall",),
            hall=(21.0, 0.15, 0.02),
            duties=changed(hall=_gate),
        ),
        measures=(hiding.cold_spells,),
    ),
    thermal_case(
        "thermal.coolant/small",
        "Chilled coolant; only the state of its pump is recorded.",
        Scene(
            (jets(),),
            ("steps", "intermittent", "steps"),
            (of("n"), of("M8")),
            noise="white",
            periods_s=(15.0, 20.0),
            duties=changed(coolant_degc=chilled),
        ),
        hidden=("small",),
    ),
    thermal_case(
        "thermal.coolant/flow",
        "Flow and tank temperature are recorded; the film goes with flow to the power of 0.6.",
        Scene(
            (jets(lambda one: (one["flow"] / 20.0) ** 0.6),),
            ("steps", "warm-up", "intermittent"),
            (of("n"), of("Q"), of("T8")),
            refitted=True,
            noise="white",
            periods_s=(20.0,),
        ),
        hidden=("absorbed",),
    ),
    thermal_case(
        "thermal.coolant/seldom",
        "Coolant for some twenty minutes once in a run, not at all in the first.",
        Scene(
            (jets(brief=True),),
            ("steps", "intermittent", "steps"),
            (of("n"), of("M8"), of("T8")),
            duties=changed(coolant=_seldom_on, coolant_degc=chilled),
        ),
        measures=(hiding.seldom("M8"),),
    ),
    thermal_case(
        "thermal.coolant/with the spindle",
        "In the first run coolant is on whenever the spindle turns; in the others it has its own programme.",
        Scene(
            (jets(),),
            ("intermittent", "steps", "steps"),
            (of("n"), of("M8")),
            duties=changed(coolant=_with_spindle, coolant_degc=chilled),
        ),
        measures=(hiding.like_in_first_run(),),
    ),
)
SCENARIOS = scenarios_of(_CASES, 0, 4)
