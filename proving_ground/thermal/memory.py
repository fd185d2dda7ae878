"""Cases whose simulation follows a temperature at once where the machine follows it late: `thermal.memory`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.signal import lfilter

from proving_ground.concealment import opposed
from proving_ground.thermal.duty import BOTH, Duty, Omission
from proving_ground.thermal.machine import Machine
from proving_ground.thermal.scene import GRID_S, WHITE, of, thermal_case
from proving_ground.world import scenarios_of
from selector.types import Matrix, Vector

QUIET_HALL = (21.0, 0.2, 0.03)


def member_by(
    sensor: str, member: str = "bed", axes: Mapping[str, float] = BOTH, hours: float | None = None, behind: bool = False
) -> Omission:
    """A member that the simulation has as a constant times one temperature, fitted to the first run (its first hours).

    With `behind` the simulation has that temperature behind the first-order lag that fits best.
    """

    def shifted(tool: Machine, rises: Matrix, _duty: Duty) -> dict[str, Vector]:
        row = tool.displacement((member,))
        return {axis: rises @ row[axis] for axis in BOTH}

    def stand_in(tool: Machine, rises: Sequence[Matrix]) -> list[dict[str, Vector]]:
        row, felt = tool.displacement((member,)), tool.sensors[sensor][1]
        stop = len(rises[0]) if hours is None else int(3600.0 * hours / GRID_S)
        result: list[dict[str, Vector]] = [{} for _ in rises]
        for axis in BOTH:
            truth = (rises[0] @ row[axis])[:stop]
            errors = []
            for lag_s in np.geomspace(300.0, 20000.0, 40) if behind else (0.0,):
                source = _behind(rises[0] @ felt, lag_s)[:stop]
                factor = float(source @ truth) / float(source @ source)
                errors.append((float(np.sum((truth - factor * source) ** 2)), lag_s, factor))
            _, lag_s, factor = min(errors)
            for run, part in enumerate(rises):
                result[run][axis] = factor * _behind(part @ felt, lag_s)
        return result

    return Omission("thermal.memory", place="column", shifted=shifted, stand_in=stand_in, axes=axes)


def _behind(course: Vector, lag_s: float) -> Vector:
    if lag_s == 0.0:
        return course
    e = float(np.exp(-GRID_S / lag_s))
    return np.asarray(lfilter([1.0 - e], [1.0, -e], course))


_CASES = (
    thermal_case(
        "thermal.memory/static",
        "A part of the machine is a constant times the temperature of the front bearing, fitted to one warm-up.",
        (member_by("T1"),),
        ("warm-up", "intermittent", "steps"),
        (),
        hidden=("absorbed",),
        hall=QUIET_HALL,
        **WHITE,
    ),
    thermal_case(
        "thermal.memory/tail",
        "One lag, fitted to the first hours of a warm-up; the slower one shows in the long cooling.",
        (member_by("T1", hours=2.5, behind=True),),
        ("warm-up", "cooling", "steps"),
        hidden=("absorbed",),
        hall=QUIET_HALL,
        hours=(6.0, 8.0),
    ),
    thermal_case(
        "thermal.memory/one axis",
        "Only Y bends late; noise is white.",
        (member_by("T6", "scale", {"Y": 1.0}),),
        ("steps", "warm-up", "intermittent"),
        hidden=("absorbed",),
        noise="white",
        hall=QUIET_HALL,
    ),
    thermal_case(
        "thermal.memory/opposed",
        "The late member acts against the rest in Z and with it in Y; coolant, feed and a cabinet do nothing.",
        (member_by("T6", "scale", {"Z": -1.0, "Y": 0.6}),),
        ("intermittent", "steps", "cooling"),
        (of("n"), of("M8"), of("f"), of("T10")),
        hidden=(opposed,),
        hall=QUIET_HALL,
        refitted=True,
    ),
)
SCENARIOS = scenarios_of(_CASES, "thermal.memory/static", "thermal.memory/opposed")
