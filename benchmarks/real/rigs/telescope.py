"""A telescope on a worm gear, guided by a camera over a night: the error that the guiding took away, put together."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair, table, thinned
from selector.recording import Channel

_LOG = "web/agp/public/data/PHD2_GuideLog_2022-03-18_210258.txt"
_ARCSEC_PER_PX = 6.04
_SIDEREAL_ARCSEC_PER_S = 15.041
_LEVER_M = 0.20626481
_LEAD_M = 2.0 * np.pi / 144 * _LEVER_M
"""At this lever an arc second is a micrometre."""
_LONG, _SIDE = 1000, "Pier side = West"
"""Long sessions after the mount was turned over: between them it was not moved, so that the worm goes on evenly."""
_MEAN_OF = 3
_CHANNELS = (
    Channel("hour_axis", "position", "m", place="hour axis, turned at the sidereal rate", axis="RA"),
    Channel("error", "displacement", "um", place="hour axis, camera and pulses together", axis="RA"),
)


def _sessions(folder: Path, *, worm: bool = False) -> Pair:
    runs: dict[str, pd.DataFrame] = {}
    for text in (folder / _LOG).read_text(encoding="utf-8").split("Guiding Begins at ")[1:]:
        rows = [line.split(",") for line in text.splitlines() if re.match(r'\d+,[\d.]+,"Mount"', line)]
        rows = [row for row in rows if row[5] and row[9]]
        if len(rows) >= _LONG and _SIDE in text:
            begin = pd.Timestamp(text[:19])
            runs[f"{begin:%H.%M}"] = _session(text, rows, (begin - pd.Timestamp("2022-03-18")).total_seconds())
    if worm:
        _put_worm_in(runs)
    return pair(runs, _CHANNELS)


def _put_worm_in(runs: dict[str, pd.DataFrame]) -> None:
    """Two harmonics of the worm, the same in all sessions, fitted to all but the last."""

    def waves(frame: pd.DataFrame) -> list[Vector]:
        turned = 2.0 * np.pi * frame["hour_axis"].to_numpy() / _LEAD_M
        return [part for k in (1, 2) for part in (np.sin(k * turned), np.cos(k * turned))]

    fitted = pd.concat(list(runs.values())[:-1])
    factors = least_squares(waves(fitted), (fitted["error"] - fitted["error" + SIMULATED]).to_numpy())
    for frame in runs.values():
        frame["error" + SIMULATED] += np.column_stack(waves(frame)) @ factors


def _session(text: str, rows: list[list[str]], begin_s: float) -> pd.DataFrame:
    per_s = float(re.search(r"xRate = ([\d.]+)", text)[1])  # type: ignore[index]
    declination = np.deg2rad(float(re.search(r"Dec = ([-\d.]+) deg", text)[1]))  # type: ignore[index]
    seconds, seen, guided, pulse_ms = (np.array([float(row[k]) for row in rows]) for k in (1, 5, 7, 9))
    moved = 1e-3 * pulse_ms * per_s * np.sign(guided)
    taken = np.r_[0.0, np.cumsum(moved)[:-1]]
    error = _ARCSEC_PER_PX * (seen + taken) / np.cos(declination)
    drift = np.column_stack([seconds, np.ones(len(seconds))]) @ least_squares([seconds, 1.0], error)
    turned = 1e-6 * _SIDEREAL_ARCSEC_PER_S * (begin_s + seconds)
    return thinned(table(seconds, hour_axis=turned, error=error, error_simulated=drift), _MEAN_OF)


CASES = (
    RealCase(
        name="telescope/worm",
        kind="positive",
        build=_sessions,
        model="a constant rate: level and drift of each session; the third of a night is held out",
        truth="header: 'Mount = Celestron AVX/CGE/CGEM/CGX'; a wheel of 144 teeth turns its worm in 598 s; peaks at "
        "604, 596, 604, 606 s in the sessions (read off)",
        right=("drive.pitch_error",),
        tolerated=("drive.ripple", "vibration.line", "data.drift"),
        reading="camera reading plus the pulses before it, over the cosine of the declination; an arc second is "
        f"written as 1 um (lever {_LEVER_M} m); means of three rows (1.1 s)",
    ),
    RealCase(
        name="telescope/worm in",
        kind="control",
        build=partial(_sessions, worm=True),
        model="the same with two harmonics of the worm, fitted to two sessions; the third is held out",
        truth="the worm is in: its phase is the same in the three sessions to 8 degrees (read off)",
        tolerated=("drive.pitch_error", "data.drift"),
        verdicts=("nothing-missing", "miscalibrated"),
        reading="as the positive",
    ),
)
