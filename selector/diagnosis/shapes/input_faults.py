"""Which recorded channels beside the responses are at fault, by their own course and by their siblings."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant
from selector.diagnosis.shapes.signals import excited
from selector.findings import Finding, Where
from selector.quality import inspect
from selector.quality.finding_table import CLOCK_JUMP, DRIFTS_FROM_GROUP, SATURATED, STEP, STUCK, SWAPPED_CHANNELS
from selector.recording import Recording
from selector.types import Vector

#: Findings about recordings → ids of the catalogue.
_IDS = {
    STUCK: "data.stuck",
    STEP: "data.step",
    DRIFTS_FROM_GROUP: "data.drift",
    SWAPPED_CHANNELS: "data.swapped",
    CLOCK_JUMP: "data.clock",
}
_ALWAYS_TOLD = (STUCK, SATURATED)  #: Findings that are told even if they may have another cause.
_LEAP = 2.5  #: Steps of the resolution.
_BEFORE = 20  #: Samples before a fault from which the level is taken that the channel had beside its siblings.
_RIDGE = 1e-3
_LOOK = "Check the sensor, its cable and the logger. The diagnosis used its readings as they are."


@dataclass(frozen=True, eq=False)
class InputFault:
    """A recorded channel that is no response and is at fault."""

    id: str  #: Of the catalogue, ``"data.…"``
    channel: str | None  #: None: all channels of the run, as with a clock
    run: str
    #: from_s and to_s: From the start of the run [s]
    from_s: float
    to_s: float
    statement: str  #: What was found, with numbers and units
    sure: bool  #: Whether nothing else was found that may explain it
    evidence: Mapping[str, Any]  #: Numbers behind the statement
    #: (n_rows,): What the reading has too much [unit of the channel]; 0 outside the window. Of a clock: how late it is
    #: [s].
    course: Vector


@lru_cache(maxsize=8)
def input_faults(comparison: Comparison) -> tuple[InputFault, ...]:
    """Faults of the recorded channels that are no responses, in fitted and in held-out runs; see `selector.quality`."""
    faults: list[InputFault] = []
    for finding in _inspected(comparison):
        known = finding.id in _IDS and finding.level != "info" and finding.where.run is not None
        if known and not _told_already(finding, faults):
            faults.append(_fault(comparison, finding))
    return tuple(faults)


def told_of_inputs(comparison: Comparison, named: Collection[str] = ()) -> tuple[Finding, ...]:
    """What is wrong with channels beside the responses, but for those that are named as faults already.

    Nothing is left out because of it: effects made of these channels are tested as they were recorded.
    """
    return tuple(
        replace(finding, level="warning", action="none", suggestion=_LOOK)
        for finding in _inspected(comparison)
        if finding.where.channel is not None
        and finding.where.channel not in named
        and (finding.level == "error" or (finding.id in _ALWAYS_TOLD and finding.level == "warning"))
    )


@lru_cache(maxsize=8)
def _inspected(comparison: Comparison) -> tuple[Finding, ...]:
    inputs = [channel.name for channel in comparison.channels if channel.name not in comparison.responses]
    return inspect(_recording(comparison), inputs) if inputs else ()


def fault_variants(comparison: Comparison, response: str, id: str) -> Iterator[Variant]:  # noqa: A002 - as in Effect
    """What faults of inputs would do to a response whose simulation was computed from these inputs."""
    for fault in input_faults(comparison):
        if fault.id != id or fault.channel is None or not excited(fault.course):
            continue
        yield Variant(
            columns=fault.course[:, None],
            names=(_name(fault.channel),),
            shape={"from_s": Quantity(fault.from_s, "s"), "to_s": Quantity(fault.to_s, "s")},
            place=comparison.channel(fault.channel).place,
            sources=(fault.channel,),
            run=fault.run,
            regime=f"run {fault.run}",
        )


def or_of_input(reading: Callable[[Fitted, Comparison], Reading]) -> Callable[[Fitted, Comparison], Reading]:
    """The `reading` of an effect, with words of its own for the shapes that `fault_variants` has made."""

    def either(fitted: Fitted, comparison: Comparison) -> Reading:
        variant = fitted.variant
        if not variant.sources or variant.names != (_name(variant.sources[0]),):
            return reading(fitted, comparison)
        channel = comparison.channel(variant.sources[0])
        key = channel.name, variant.run, variant.shape["from_s"].value
        fault = next(one for one in input_faults(comparison) if (one.channel, one.run, one.from_s) == key)
        unit = f"{fitted.unit}/{'K' if channel.unit == 'degC' else channel.unit}"
        return Reading(
            f"{fault.statement} The simulation of {fitted.response} follows that reading.",
            {**variant.shape, "sensitivity": fitted.coefficient(unit)},
        )

    return either


def _name(channel: str) -> str:
    return f"what {channel} reads too much"


def _recording(comparison: Comparison) -> Recording:
    names = [channel.name for channel in comparison.channels]
    tables = {
        run: pd.DataFrame(
            {name: comparison.recorded[name][rows] for name in names}, index=pd.Index(comparison.time_s[rows])
        )
        for run, rows in comparison.rows_of_runs()
    }
    return Recording.from_runs(tables, comparison.channels)


def _told_already(finding: Finding, faults: list[InputFault]) -> bool:
    """Whether a jump was told of which this drift is the consequence, or the exchange from its other side."""
    channel, there = finding.where.channel, [fault for fault in faults if fault.run == finding.where.run]
    if finding.id == DRIFTS_FROM_GROUP:
        return any(fault.channel == channel for fault in there)
    return any(
        fault.id == _IDS[finding.id] == "data.swapped" and fault.evidence.get("other") == channel for fault in there
    )


def _fault(comparison: Comparison, finding: Finding) -> InputFault:
    where = finding.where
    rows = dict(comparison.rows_of_runs())[str(where.run)]
    time = comparison.time_s[rows]
    from_s = float(time[0]) if where.from_s is None else where.from_s
    to_s = float(time[-1]) if where.to_s is None or finding.id == CLOCK_JUMP else where.to_s
    if finding.id == CLOCK_JUMP and where.to_s is not None:
        from_s = where.to_s
    here = np.zeros(len(comparison.time_s), dtype=bool)
    here[rows] = (time >= from_s) & (time <= to_s)
    return InputFault(
        id=_IDS[finding.id],
        channel=where.channel,
        run=str(where.run),
        from_s=from_s,
        to_s=to_s,
        statement=finding.statement,
        sure=finding.level == "error" and not (_IDS[finding.id] == "data.stuck" and _goes_on(comparison, where, here)),
        evidence=finding.evidence,
        course=np.where(here, _excess(comparison, finding, here, rows), 0.0),
    )


def _goes_on(comparison: Comparison, where: Where, here: NDArray[np.bool_]) -> bool:
    """Whether a channel that stood still moves on from there: what it measures may have rested.

    A sensor that wakes up leaps to where it should have been.
    """
    last = int(np.flatnonzero(here)[-1])
    after = comparison.recorded[str(where.channel)][last + 1 : last + 2]
    if len(after) == 0 or comparison.run_index[last + 1] != comparison.run_index[last]:
        return False
    leap = abs(float(after[0]) - float(comparison.recorded[str(where.channel)][last]))
    return not leap > _LEAP * comparison.resolution.get(str(where.channel), 0.0)


def _excess(comparison: Comparison, finding: Finding, here: NDArray[np.bool_], rows: slice) -> Vector:
    n = len(comparison.time_s)
    if finding.id == CLOCK_JUMP:
        return np.full(n, float(finding.evidence["leap_s"]))
    name = str(finding.where.channel)
    recorded = comparison.filled(comparison.recorded[name])
    if finding.id == STEP:
        return np.full(n, float(finding.evidence["height"]))
    if finding.id == SWAPPED_CHANNELS:
        return recorded - comparison.filled(comparison.recorded[str(finding.evidence["other"])])
    return recorded - _as_siblings_say(comparison, name, recorded, here, rows)


def _as_siblings_say(
    comparison: Comparison, name: str, recorded: Vector, here: NDArray[np.bool_], rows: slice
) -> Vector:
    """The course that a channel should have had, by the others of its kind; without them a line across the fault."""
    others = [c.name for c in comparison.channels if c.role in ("temperature", "ambient") and c.name != name]
    others = [other for other in others if other not in comparison.responses]
    index = np.arange(len(recorded))
    if not others or (~here).sum() < 3 * len(others):
        return np.interp(index, index[~here], recorded[~here])
    courses = np.column_stack([comparison.filled(comparison.recorded[other]) for other in others])
    middle = courses[~here].mean(axis=0)
    x, y = courses[~here] - middle, recorded[~here] - recorded[~here].mean()
    gram = x.T @ x + _RIDGE * max(float(np.trace(x.T @ x)), 1e-12) / len(others) * np.eye(len(others))
    said = recorded[~here].mean() + (courses - middle) @ np.linalg.solve(gram, x.T @ y)
    # the level of the day: what it was before the fault began
    before = np.flatnonzero(~here[rows])[: int(np.argmax(here[rows]))][-_BEFORE:] + rows.start
    level = float(np.mean((recorded - said)[before])) if len(before) else 0.0
    return np.asarray(said + level)
