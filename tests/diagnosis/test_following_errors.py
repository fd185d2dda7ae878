"""What an axis is behind its command is no position, whatever the machine file says; a position stays one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from selector.diagnosis.matching.alignment import with_following_errors
from selector.diagnosis.open_model.refitting import simulated_rows
from selector.recording import Channel, Recording
from tests.diagnosis.effects.drive_axis import PAIRS, compared


@pytest.fixture(scope="module")
def axis():
    return compared(*PAIRS["drive.coulomb"])


def declared(comparison, name, values, **fields):
    """The comparison with another channel, a position [m]."""
    return replace(
        comparison,
        channels=(*comparison.channels, Channel(name, "position", "m", **fields)),
        recorded={**comparison.recorded, name: values},
    )


def test_an_error_declared_as_a_position_is_the_same_as_one_declared_as_a_displacement(axis):
    as_position = replace(
        axis,
        channels=tuple(replace(c, role="position", unit="m") if c.name == "E" else c for c in axis.channels),
        recorded={**axis.recorded, "E": 1e-6 * axis.recorded["E"]},
        simulated={**axis.simulated, "E": 1e-6 * axis.simulated["E"]},
    )
    found = with_following_errors(as_position)
    assert found.channels == axis.channels
    for part in ("recorded", "simulated"):
        for name, values in getattr(axis, part).items():
            np.testing.assert_allclose(getattr(found, part)[name], values, rtol=1e-12)
    assert [(finding.id, finding.where.channel) for finding in found.findings] == [("following-error", "E")]


def test_of_either_sign_with_missing_samples_and_beside_another_axis(axis):
    error = np.where(np.arange(len(axis.time_s)) % 50 == 0, np.nan, -1e-6 * axis.recorded["E"])
    assert with_following_errors(declared(axis, "e", error, axis="X")).channel("e").role == "displacement"
    assert with_following_errors(declared(axis, "e", error, axis="Y")).channel("e").role == "position"


@pytest.mark.parametrize("kind", ["late", "counted backwards", "stands", "other axis", "geared", "never read"])
def test_a_position_stays_one(axis, kind):
    command, noise = axis.recorded["r"], np.random.default_rng(1).normal(scale=1e-6, size=len(axis.time_s))
    values = {
        "late": np.roll(command, 20),
        "counted backwards": 1.0 - command,
        "stands": noise,
        "other axis": 0.01 * np.sin(axis.time_s) + noise,
        "geared": 0.05 * command,
        "never read": np.full(len(command), np.nan),
    }[kind]
    found = with_following_errors(declared(axis, "x", values))
    assert found.channel("x").role == "position"
    assert not found.findings


def test_a_model_that_is_run_again_is_compared_in_the_same_unit(axis):
    runs = {
        run: pd.DataFrame({"E": 1e-6 * axis.simulated["E"][rows]}, index=axis.time_s[rows])
        for run, rows in axis.rows_of_runs()
    }
    simulation = Recording.from_runs(runs, [Channel("E", "position", "m", axis="X")])
    found = simulated_rows(replace(axis, responses=("E",)), simulation)
    np.testing.assert_allclose(found["E"], axis.simulated["E"], rtol=1e-12)
