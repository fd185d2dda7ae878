"""A simulation whose result is told, and what every account has: what acted, parameters, origin, what is recorded."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from selector.findings import Finding
from selector.json_text import fields_of
from selector.number_text import number_text, span_text
from selector.physics.channel_differences import ChannelDifference
from selector.physics.model_text import plain_values
from selector.physics.simulation_kind import Simulated
from selector.recording import Recording
from selector.telling import account, origin
from selector.telling.numbers import NONE, beside_text, given_text

if TYPE_CHECKING:
    import plotly.graph_objects as go

MOST_PARAMETERS = 200
SAID = "model file"
THINNED = "Long courses are drawn with the lowest and highest sample of each of 300 stretches; the file has them all."
LEFT_OUT = "left out: default"
_UNITS = {"degC": "°C", "um": "µm", "rpm": "r/min", "1": NONE}
_SIMULATED = "SIMULATED: all of this comes from a computer model, nothing was measured."

MOST_DRAWN = 6
MOST_ROWS = 60

WHAT = {
    "position": "position",
    "table": "position of the table",
    "error": "tracking error",
    "output": "output of the control",
    "total": "output of the control with what is added",
    "force": "force of the drive",
}
_FIRST = (("position", "table"), ("error",), ("total", "output"), ("force",))  #: What is told first of an axis.
_CHANNEL_UNITS = {"um": "µm", "urad": "µrad", "degC": "°C", "rpm": "r/min", "1": ""}
_EQUAL = 1e-9  #: Difference, as a share of what was recorded, below which it is rounding.

Drawings = Mapping[str, Sequence[account.Block]]  #: Section of an account → its drawings; empty unless a page is made.
Origins = tuple[tuple[str, float, str, str], ...]  #: (name, value, unit, where it is from) of every number of a model.


@dataclass(frozen=True, eq=False)
class SimulationResult:
    """A simulation with its numbers and what is to be said of it."""

    kind: str  #: The word behind `selector simulate`
    simulated: Simulated
    summary: Any  #: What the `summary` of its kind gives
    findings: tuple[Finding, ...]
    path: Path  #: The model file
    asked: Mapping[str, Any] = field(default_factory=dict)  #: Options of its kind

    @property
    def recording(self) -> Recording:
        """What was simulated."""
        return self.simulated.recording


def simulation_account(
    result: SimulationResult,
    sentences: Sequence[str],
    own: Sequence[account.Section | None],
    *,
    drawings: Drawings,
    facts: Mapping[str, Any],
    data: Mapping[str, Any],
    verdict: account.Verdict = "good",
    parameters: Origins | None = None,
) -> account.Account:
    """The account of a simulation: what its kind says, between what all of them say.

    `sentences` and `own` are of its kind, the most important first; `facts` stand in its origin beside the model file
    and the seed; `data` is what the JSON says under the name of its kind, beside the comparison, nothing if it is
    empty. Drawings of the comparison are made here if there are any of its sections. `parameters` are by default those
    of the model, each from the file or left out there.
    """
    done = result.simulated
    differences = done.differences or ()
    told_data = {result.kind: {**data, "comparison": comparison_data(done.differences)}} if data else {}
    rows = parameters_with_origin(done.model) if parameters is None else parameters
    return account.Account(
        title=f"Simulation: {done.model.name}",
        sentences=(*comparison_sentences(differences), *sentences),
        sections=account.sections(
            comparison_section(differences, drawn=bool(drawings)),
            *own,
            account.section("findings", "Findings", account.remarks_of(result.findings)),
            account.section("channels", "Channels", account.Captioned("", channels_table(done.recording, done.inputs))),
            account.section("parameters", "Parameters", _parameters(rows)),
            account.section("origin", "Origin", _origin(result, facts)),
        ),
        label=account.legend("simulated.compared") if differences else _SIMULATED,
        verdict=verdict,
        data=told_data,
        footer="The same model and options give the same bytes.",
    )


def parameters_with_origin(model: Any) -> Origins:
    """Every number of a model; names are the keys of its file."""
    values = plain_values(model.file)
    return tuple(
        (name, one.value, one.unit, SAID if is_said(values, name.split(".")) else LEFT_OUT)
        for name, one in model.parameters.items()
    )


def is_said(values: Any, path: list[str]) -> bool:
    """Whether plain values of a model file have this key; entries of lists count from 1 in its parts."""
    for part in path:
        if isinstance(values, Mapping) and part in values:
            values = values[part]
        elif isinstance(values, list | tuple) and part.isdigit() and 0 < int(part) <= len(values):
            values = values[int(part) - 1]
        else:
            return False
    return True


def channels_table(recording: Recording, inputs: Sequence[str]) -> account.Table:
    """The channels of a simulated recording with their ranges; `inputs` names those that act."""
    rows = []
    for channel in recording.channels:
        values = recording.frame[channel.name]
        low, high = float(values.min()), float(values.max())
        rows.append(
            (
                channel.name,
                "input" if channel.name in inputs else "output",
                channel.role.replace("_", " "),
                channel.place or channel.axis or NONE,
                beside_text(low, high - low),
                beside_text(high, high - low),
                _UNITS.get(channel.unit, channel.unit),
            )
        )
    return account.table(["channel", "", "role", "place or axis", ">lowest", ">highest", "unit"], rows)


def _parameters(rows: Origins) -> account.Captioned | None:
    cells = [(name, given_text(value), NONE if unit in ("", "1") else unit, said) for name, value, unit, said in rows]
    more = f"{len(cells) - MOST_PARAMETERS} more are in the model file." if len(cells) > MOST_PARAMETERS else ""
    shown = account.table(["parameter", ">value", "unit", "from"], cells[:MOST_PARAMETERS], more)
    return account.captioned("", shown, on_screen=False)


def _origin(result: SimulationResult, facts: Mapping[str, Any]) -> account.Captioned | None:
    path, simulated = result.path, result.recording.provenance["simulated"]
    told = origin.remaining_table(
        {
            "model file": path.name,
            "SHA-256 of the model file": hashlib.sha256(path.read_bytes()).hexdigest(),
            "note": result.simulated.model.file.model.note,
            **facts,
            "seed": simulated["seed"],
        }
    )
    return account.captioned("", told, on_screen=False)


def simulation_document(
    result: SimulationResult, targets: Mapping[str, Path], machine_path: Path, report: Path | None
) -> dict[str, Any]:
    """The contract `selector.simulation/1` but for what its kind adds; `targets` are the files of the runs."""
    done, recording = result.simulated, result.recording
    runs = []
    for run in recording.runs:
        time_s = recording.time_s(run)
        runs.append(
            {
                "run": run,
                "file": targets[run],
                "rows": len(time_s),
                "duration_s": time_s[-1] - time_s[0],
                **done.per_run.get(run, {}),
            }
        )
    channels = []
    for channel in recording.channels:
        values, told = recording.frame[channel.name], fields_of(channel, "name", "role", "unit", "place", "axis")
        channels.append({**told, "min": float(values.min()), "max": float(values.max())})
    return {
        "schema": "selector.simulation/1",
        "kind": result.kind,
        "model": {"file": result.path, "kind": done.model.file.model.kind, "name": done.model.file.model.name},
        "seed": done.seed,
        "files": [*targets.values(), machine_path],
        "machine_file": machine_path,
        "report": report,
        "runs": runs,
        "channels": channels,
        "findings": list(result.findings),
    }


def main_difference(differences: Sequence[ChannelDifference]) -> ChannelDifference | None:
    """The one to be told first: of axes the worst position, else the worst channel for the size of its course."""
    for kinds in _FIRST:
        ones = [one for one in differences if one.kind in kinds]
        if ones:
            return max(ones, key=lambda one: one.rms if math.isfinite(one.rms) else math.inf)
    return max(differences, key=lambda one: -1.0 if one.relative is None else one.relative, default=None)


def comparison_sentences(differences: Sequence[ChannelDifference]) -> list[str]:
    """How far simulated and recorded are apart where that matters most."""
    first = main_difference(differences)
    if first is None:
        return []
    what = first.channel
    if first.kind:
        what = WHAT[first.kind] + ("" if first.channel == WHAT[first.kind] else f" ({first.channel})")
        what += f" of {first.axis}" if len({one.axis for one in differences}) > 1 else ""
    what += f" in {first.run}, the worst run," if len({one.run for one in differences}) > 1 else ""
    told = (
        f"Simulated and recorded {what} differ by {_amount(first.rms, first)} rms, at most by "
        f"{_amount(first.largest, first)} after {span_text(first.largest_at_s)}"
    )
    share = f"; that is {relative_text(first)} of what was recorded, about its mean" if first.relative else ""
    return [f"{told}{share}."]


def comparison_section(differences: Sequence[ChannelDifference], *, drawn: bool) -> account.Section | None:
    """All numbers as a table, and drawings of the first channels that differ; None if nothing was recorded."""
    if not differences:
        return None
    several = len({one.run for one in differences}) > 1
    telling = [one for one in differences if one.kind or one.largest > _EQUAL * float(np.abs(one.recorded).max())]
    drawings = [
        account.Drawing(
            _drawn(one, f"{one.channel}, {one.run}" if several else one.channel), account.legend("simulated.difference")
        )
        for one in telling[: MOST_DRAWN if drawn else 0]
    ]
    more = len(telling) - MOST_DRAWN
    note = account.Note(f"{more} more channels were compared and are not drawn.") if drawn and more > 0 else None
    numbers = account.Captioned("Simulated minus recorded", comparison_table(differences))
    return account.section("comparison", "Simulated and recorded", *drawings, note, numbers)


def comparison_table(differences: Sequence[ChannelDifference]) -> account.Table:
    """Every channel in every run."""
    axes = any(one.axis for one in differences)
    rows = [
        (
            one.run,
            *((one.axis,) if axes else ()),
            one.channel,
            *((WHAT[one.kind],) if axes else ()),
            one.rms,
            one.largest,
            number_text(one.largest_at_s, 4),
            _CHANNEL_UNITS.get(one.unit, one.unit) or NONE,
            relative_text(one),
        )
        for one in differences[:MOST_ROWS]
    ]
    more = len(differences) - MOST_ROWS
    note = account.legend("simulated.relative") + (f" {more} more are in the JSON." if more > 0 else "")
    heads = ["run", "axis", "channel", "what"] if axes else ["run", "channel"]
    return account.table([*heads, ">rms", ">largest", ">at [s]", "unit", ">relative"], rows, note)


def comparison_data(differences: Sequence[ChannelDifference] | None) -> list[dict[str, Any]] | None:
    """`comparison` of `selector.simulation/1`."""
    if differences is None:
        return None
    return [
        {
            "run": one.run,
            **({"axis": one.axis} if one.axis else {}),
            "channel": one.channel,
            **({"kind": one.kind} if one.kind else {}),
            **fields_of(one, "unit", "rms", "largest", "largest_at_s", "relative"),
            "samples": len(one.time_s),
        }
        for one in differences
    ]


def relative_text(one: ChannelDifference) -> str:
    """The relative difference as a percentage, a dash for none."""
    return NONE if one.relative is None else f"{number_text(100 * one.relative)} %"


def _drawn(one: ChannelDifference, name: str) -> go.Figure:
    from selector.figures.simulated.drive import recorded_and_simulated

    # courses of axes are drawn in mm, vibrations in µm
    unit = one.unit if one.kind else _CHANNEL_UNITS.get(one.unit, one.unit)
    return recorded_and_simulated(one.time_s, one.recorded, one.simulated, name, unit)


def _amount(value: float, one: ChannelDifference) -> str:
    return f"{number_text(value)} {_CHANNEL_UNITS.get(one.unit, one.unit)}".rstrip()
