"""A steel beam on a shaker that gets three tones, over and over."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair
from benchmarks.real.rigs.second.common import folded
from benchmarks.real.rigs.third.common import SILENT
from selector.recording import Channel

_CHANNELS = (
    Channel("F", "force", "N", place="load cell between shaker and beam"),
    Channel("a", "acceleration", "m/s^2", place="end of the beam"),
)
_PERIOD_S = 0.1


def _read(path: Path) -> pd.DataFrame:
    lines = path.read_text(encoding="latin-1").split("\n")
    first = next(k for k, line in enumerate(lines) if line.startswith("X_Value")) + 1
    values = np.array(
        [[float(cell) for cell in line.split("\t")[:4]] for line in lines[first:] if line.count("\t") > 2]
    )
    columns = {"F": 4.448 * values[:, 2], "a": 9.81 * values[:, 3]}
    return pd.DataFrame(columns, index=pd.Index(values[:, 0] - values[0, 0], name="time_s"))


def _again(folder: Path, *, name: str) -> Pair:
    frame = _read(folder / "data/data_I/test_1/data_set_1_downsampled_by_32.lvm")
    return pair({"test 1": folded(frame, (name,), _PERIOD_S, 6.0, 320).iloc[:12000]}, _CHANNELS, "0.3")


def _rigid(folder: Path) -> Pair:
    """Acceleration by force, as of one mass, fitted to the first two tests."""
    where = folder / "data/data_I"
    runs = {f"test {k}": _read(where / f"test_{k}/data_set_{k}_downsampled_by_32.lvm").iloc[:8000] for k in (1, 2, 3)}
    known = pd.concat(list(runs.values())[:2])
    factor, zero = least_squares([known["F"].to_numpy(), 1.0], known["a"].to_numpy())
    for frame in runs.values():
        frame["a" + SIMULATED] = factor * frame["F"] + zero
    return pair(runs, _CHANNELS)


_README = "README.md: 'Test 1: One sine wave signal built from 100, 120, and 150 Hz frequencies with no nonstationary'"

CASES = (
    RealCase(
        name="driven_beam/rigid",
        kind="positive",
        build=_rigid,
        model="acceleration = force / mass + constant, fitted to two tests; the third is held out",
        truth="modal_analysis/README.md: 'mode 1: natural frequency is 6.62 Hz', '41.4 Hz', '117.5 Hz'",
        right=("vibration.mode",),
        tolerated=("drive.elasticity", "vibration.back_reaction", "vibration.hardening", "vibration.line"),
        reading="every 32nd row (0.625 ms), the first 5 s; pounds as N, g as m/s^2",
    ),
    RealCase(
        name="driven_beam/force again",
        kind="control",
        build=partial(_again, name="F"),
        model="the mean cycle of the first 6 s; the last 30 % of the 7.5 s behind are held out",
        truth=_README,
        verdicts=SILENT,
        reading="every 32nd row (0.625 ms); pounds as N, g as m/s^2; the three tones repeat after 0.1 s",
    ),
    RealCase(
        name="driven_beam/motion again",
        kind="control",
        build=partial(_again, name="a"),
        model="the same of the acceleration",
        truth=_README,
        verdicts=SILENT,
        reading="every 32nd row (0.625 ms); pounds as N, g as m/s^2; the three tones repeat after 0.1 s",
    ),
)
