"""Readings of an axis that are wrong: current, error of position, their clocks; alone or beside missing physics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from proving_ground.case import TrueEffect
from proving_ground.data import faults
from proving_ground.data.faults import Fault
from proving_ground.data.on_heat import fault_plan
from proving_ground.drive.recorded import Drive
from proving_ground.drive.servo import Part, together
from proving_ground.drive.true_axis import LENGTH_S, Bench
from proving_ground.world import Plan, plus, scenarios_of

Drawing = Callable[[np.random.Generator], Fault]


def misread(drawing: Drawing, channel: str, accept: tuple[str, ...] = ()) -> Any:
    """What `Drive.prepared` needs: a fault of one channel in one of the fitted runs."""

    def prepared(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
        run, fault = int(generator.integers(0, 2)), drawing(generator)
        read = fault.read(bench.stamps, (channel,), (run,))

        def effects(size: float) -> tuple[TrueEffect, ...]:
            return (TrueEffect(fault.id, accept or (fault.id,), (channel,), None, fault.windows((run,), size)),)

        found: dict[str, Any] = {"recorded_as": read, "effects": effects}
        return found | ({"distorted": read} if fault.id == "data.stuck" else {})

    return prepared


def _moment(generator: np.random.Generator) -> float:
    return float(generator.uniform(0.2, 0.6) * LENGTH_S)


def _entry(plan: Plan, prepared: Any, bench: Mapping[str, Any] | None = None, first: float = 1.0) -> Drive:
    return Drive(plan, "data", None, bench or {}, world={"first": first}, prepared=prepared)


def _fault(id: str, drawing: Drawing, channel: str) -> Part:  # noqa: A002 - the word of the contract
    return Part(id, first=0.3, channels=(channel,), place=None, drawing=drawing)


_END_S = LENGTH_S - 0.05
_absorbed = partial(fault_plan, hidden=("absorbed",))
DRIVES = (
    _entry(_absorbed("data.clock/current"), misread(lambda g: faults.late(_END_S, 1e-4), "I")),
    _entry(_absorbed("data.clock/error-jumps"), misread(lambda g: faults.late(_END_S, 1e-4, _moment(g)), "E")),
    _entry(
        _absorbed("data.gain/current-run"), misread(lambda g: faults.stretched(_END_S, 0.01), "I"), {"colour": "ar"}
    ),
    _entry(_absorbed("data.gain/error-run"), misread(lambda g: faults.stretched(_END_S, 0.01), "E")),
    _entry(
        _absorbed("data.zero/current-run", verdicts=("data-fault", "missing-physics"), kind="undecidable"),
        misread(lambda g: faults.moved(_END_S, 0.01), "I", ("data.zero", "drive.offset_force")),
    ),
    _entry(
        _absorbed("data.zero/error-run"), misread(lambda g: faults.moved(_END_S, 0.05), "E"), {"colour": "heavy-tailed"}
    ),
    _entry(_absorbed("data.drift/error"), misread(lambda g: faults.running_away(_END_S, 0.3, _moment(g)), "E")),
    _entry(
        _absorbed("data.step/error"),
        misread(lambda g: faults.jumped(_END_S, 0.1, _moment(g)), "E"),
        {"on_scale": False},
    ),
    _entry(
        fault_plan("data.stuck/error", size=1.0, note="A third of a second; the axis starts or stops within it."),
        misread(lambda g: faults.frozen(_END_S, 0.3, _moment(g)), "E"),
    ),
    _entry(
        fault_plan("data.several/coulomb+step", kind="several"),
        together(
            Part("drive.coulomb", plus("coulomb_n"), place=None),
            _fault("data.step", lambda g: faults.jumped(_END_S, 0.1, _moment(g)), "E"),
        ),
        {"friction": False},
        0.3,
    ),
    _entry(
        fault_plan("data.several/ripple+gain", kind="several"),
        together(
            Part("drive.ripple", plus("ripple_n"), 4.0, place=None),
            _fault("data.gain", lambda g: faults.stretched(_END_S, 0.01), "I"),
        ),
        {},
        0.3,
    ),
)
SCENARIOS = scenarios_of(drive.case for drive in DRIVES)
