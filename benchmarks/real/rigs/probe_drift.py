"""Probes of printers that measure the height of a bed while it is heated."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.real.case import Pair, RealCase, least_squares, pair, table
from selector.recording import Channel

_FIT = 0.7
_CHANNELS = (
    Channel("bed", "temperature", "degC", place="heated bed"),
    Channel("nozzle", "temperature", "degC", place="nozzle"),
    Channel("z", "displacement", "um", place="probe over the bed", axis="Z"),
)


def _heated(folder: Path, *, probe: str) -> Pair:
    text = (folder / "z-probe_benchmark" / "data" / f"probe_accuracy_{probe}.json").read_text(encoding="utf-8")
    rows = [json.loads(line) for line in text.splitlines() if line.strip()]
    heights = np.array([(row["ts"], 1e3 * row["z"]) for row in rows if "z" in row])
    warm = np.array([(row["ts"], row["btemp"], row["etemp"]) for row in rows if "btemp" in row])
    heights = heights[np.r_[True, np.diff(heights[:, 0]) > 0]]
    bed, nozzle = (np.interp(heights[:, 0], warm[:, 0], warm[:, k]) for k in (1, 2))
    z = heights[:, 1] - heights[0, 1]
    fitted = slice(0, int(_FIT * len(z)))
    (slope,) = least_squares([bed[fitted] - bed[0]], z[fitted])
    frame = table(heights[:, 0], bed=bed, nozzle=nozzle, z=z, z_simulated=slope * (bed - bed[0]))
    return pair({probe: frame}, _CHANNELS)


def _case(probe: str) -> RealCase:
    return RealCase(
        name=f"probe_drift/{probe}",
        kind="positive",
        build=partial(_heated, probe=probe),
        model="height = k x rise of the bed, without delay, k fitted to the first 70 %; the rest is held out",
        truth="z-probe_benchmark/ReadMe.md: 'Inductive sensors are highly susceptible to thermal drift'",
        right=("thermal.memory",),
        tolerated=("thermal.second_source", "thermal.convection"),
        reading="a height every 1.94 s in steps of 1.25 um; temperatures every 20 s, along lines",
    )


CASES = tuple(_case(probe) for probe in ("TL-Q5MC1-Z", "GX-H8A", "superpinda"))
