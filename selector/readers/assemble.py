"""Runs and the plan of channels → one Recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from selector.errors import ReadError
from selector.findings import Finding, Where
from selector.readers.plan import Plan, Planned
from selector.readers.runs import TimedRun
from selector.recording import Channel, Recording
from selector.units import CANONICAL_UNITS, to_canonical


def assembled(runs: Sequence[TimedRun], planned: Plan) -> tuple[Recording, list[Finding]]:
    """The recording in canonical units, and what there is to say about values.

    Raises
    ------
    ReadError
        A run has no value in any channel.
    """
    channels = [channel_of(p) for p in planned.channels]
    names = [c.name for c in channels]
    findings: list[Finding] = []
    parts: list[NDArray[np.float64]] = []
    provenance: dict[str, Any] = {}
    for run in runs:
        by_header = {column.header: column.values for column in run.columns}
        values = np.full((len(run.time_s), len(channels)), np.nan)
        for k, channel in enumerate(planned.channels):
            header = channel.headers.get(run.name)
            if header is None:
                continue
            with np.errstate(all="ignore"):
                values[:, k] = to_canonical(by_header[header], channel.units[run.name], channel.role)
        values[~np.isfinite(values)] = np.nan
        empty = np.isnan(values).all(axis=0)
        if empty.all():
            raise ReadError(
                f"no value in any of the channels {', '.join(names[:10])}",
                expected="numbers in at least one channel",
                where=run.file.name,
                advice="check the decimal mark and the columns, or leave this file out",
            )
        findings += [
            _empty_channel(name, run.name)
            for name, channel, nothing in zip(names, planned.channels, empty, strict=True)
            if nothing and run.name in channel.headers
        ]
        parts.append(values)
        provenance[run.name] = _provenance(run)
    frame = pd.DataFrame(
        np.concatenate(parts),
        columns=names,
        index=pd.MultiIndex.from_arrays(
            [
                np.repeat(np.array([run.name for run in runs], dtype=object), [len(p) for p in parts]),
                np.concatenate([run.time_s for run in runs]),
            ],
            names=["run", "time_s"],
        ),
    )
    return Recording(frame, tuple(channels), {"runs": provenance}), findings


def channel_of(planned: Planned) -> Channel:
    """The channel as the recording holds it."""
    return Channel(
        planned.name, planned.role, CANONICAL_UNITS[planned.role], planned.place, planned.axis, planned.xyz_m
    )


def _provenance(run: TimedRun) -> dict[str, Any]:
    return {
        "file": str(run.file),
        "sha256": run.sha256,
        "start": run.start,
        "first_stamp_s": run.first_s,
        "time_columns": list(run.clock.columns),
        "time_unit": run.clock.unit,
        "time_guessed": list(run.clock.guessed),
        "reading": dict(run.table.reading),
    }


def _empty_channel(name: str, run: str) -> Finding:
    return Finding(
        "empty-channel",
        "warning",
        f"Channel {name!r} has no value in run {run!r}.",
        Where(channel=name, run=run),
        {},
        "leave the channel or the run out",
        "leave-out-stretch",
    )


def placed(runs: Sequence[TimedRun], planned: Plan) -> list[Finding]:
    """Findings of all runs with the names of run and channel; those about columns that were not read are left away."""
    out: list[Finding] = []
    for run in runs:
        channel_of_header = {p.headers[run.name]: p.name for p in planned.channels if run.name in p.headers}
        for finding in run.findings:
            header = finding.where.channel
            if header is not None and header not in channel_of_header and header not in run.clock.columns:
                continue
            channel = channel_of_header.get(header) if header is not None else None
            where = replace(finding.where, channel=channel or header, run=run.name, file=run.file.name)
            out.append(replace(finding, where=where))
    return out


def condensed(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """One finding in place of many that say the same of more than three runs, the first to be worst."""
    groups: dict[tuple[str, str, str | None], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.id, finding.level, finding.where.channel), []).append(finding)
    out: list[Finding] = []
    for members in groups.values():
        runs = list(dict.fromkeys(m.where.run for m in members if m.where.run is not None))
        timed = any(m.where.from_s is not None for m in members)
        if len(runs) <= 3 or timed or len(runs) < len(members):
            out += members
            continue
        first = members[0]
        more = f" The same holds for {len(runs) - 1} more runs ({', '.join(runs[1:5])}{' …' if len(runs) > 5 else ''})."
        out.append(
            replace(
                first,
                statement=first.statement + more,
                where=replace(first.where, run=None, file=None),
                evidence={**first.evidence, "runs": runs},
            )
        )
    rank = {"error": 0, "warning": 1, "info": 2}
    return tuple(sorted(out, key=lambda finding: rank[finding.level]))
