"""A Reading as the `selector.description/1` contract."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from selector.readers.reading import ChannelInfo, Reading


def description(reading: Reading) -> dict[str, Any]:
    """JSON values only.

    `place`, `axis` and `xyz` of a channel appear where they are known, `unit_per_run` where its runs have different
    units.
    """
    return {
        "schema": "selector.description/1",
        "runs": [
            {
                "run": run.name,
                "file": run.file,
                "sha256": run.sha256,
                "rows": run.rows,
                "duration_s": run.duration_s,
                "period_s": run.period_s,
                "start": run.start,
            }
            for run in reading.runs
        ],
        "channels": [_channel(channel) for channel in reading.channels],
        "reading": dict(reading.reading),
        "findings": [finding.as_dict() for finding in reading.findings],
    }


def _channel(channel: ChannelInfo) -> dict[str, Any]:
    out: dict[str, Any] = {
        "name": channel.name,
        "column": channel.column,
        "role": channel.role,
        "unit": channel.unit,
        "unit_in_file": channel.unit_in_file,
        "guessed": list(channel.guessed),
    }
    if channel.units_of_runs:
        out["unit_per_run"] = dict(channel.units_of_runs)
    if channel.place is not None:
        out["place"] = channel.place
    if channel.axis is not None:
        out["axis"] = channel.axis
    if channel.xyz_m is not None:
        out["xyz"] = list(channel.xyz_m)
    return out
