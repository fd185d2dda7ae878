"""A sensor that dies in every run; and sensors that stand still in every run although nothing is wrong with them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.quality import inspect
from selector.recording import Channel, Recording

SAMPLES, STEP_S = 400, 60.0
RUNS = ("r1", "r2", "r3", "r4")
DIES_AT = dict(zip(RUNS, (60, 210, 120, 170), strict=True))


def tables(resolution_k=0.01, noise_k=0.04, channels=5):
    """Temperatures of a machine that is heated, cools down and is heated again, each day from another level [°C]."""
    found = {}
    for k, run in enumerate(RUNS):
        rng = np.random.default_rng(40 + k)
        time = STEP_S * np.arange(SAMPLES)
        places = {}
        for j in range(channels):
            heat = np.sin(2 * np.pi * time / (9000.0 + 900.0 * j + 400.0 * k)) + time / 9000.0
            course = 19.0 + 1.37 * k + 0.1 * j + (0.3 + 0.15 * j) * heat
            course = course + noise_k * rng.standard_normal(SAMPLES)
            places[f"T{j + 1}"] = np.round(np.round(course / resolution_k) * resolution_k, 6)
        found[run] = pd.DataFrame(places, index=time)
    return found


def still_of(frames):
    names = next(iter(frames.values())).columns
    kinds = {"T": ("temperature", "degC"), "h": ("ambient", "degC"), "Z": ("displacement", "um")}
    recording = Recording.from_runs(frames, [Channel(name, *kinds[name[0]]) for name in names])
    return [found for found in inspect(recording) if found.id in ("stuck", "saturated")]


@pytest.mark.parametrize("runs", [1, 2, 4])
def test_a_sensor_that_dies_in_every_run_is_told_in_every_run(runs):
    frames = dict(list(tables().items())[-runs:])
    for run, frame in frames.items():
        frame.iloc[DIES_AT[run] :, 2] = frame.iloc[DIES_AT[run], 2]
    found = still_of(frames)
    assert [(one.where.channel, one.where.run, one.action) for one in found] == [
        ("T3", run, "leave-out-stretch") for run in frames
    ]
    for one in found:
        # a reading before may have been equal by chance
        assert DIES_AT[one.where.run] - 5 <= one.where.from_s / STEP_S <= DIES_AT[one.where.run]
        assert one.where.to_s == STEP_S * (SAMPLES - 1)


def test_two_sensors_that_die_in_every_run_do_not_hide_each_other():
    frames = tables()
    for run, frame in frames.items():
        frame.iloc[DIES_AT[run] :, 2] = frame.iloc[DIES_AT[run], 2]
        frame.iloc[DIES_AT[run] + 20 :, 4] = frame.iloc[DIES_AT[run] + 20, 4]
    assert {(one.where.channel, one.where.run) for one in still_of(frames)} == {
        (name, run) for name in ("T3", "T5") for run in RUNS
    }


def held_at_rest(frame, rng):
    """Electrical noise while the drives are on: all channels stand still after that, as they are at rest."""
    off = SAMPLES // 2
    for name in frame:
        frame.iloc[off:, frame.columns.get_loc(name)] = frame[name].iloc[off]


def gauge_at_rest(frame, rng):
    """A gauge whose noise is the run-out of the spindle."""
    gauge = 3.0 + 0.5 * rng.standard_normal(SAMPLES)
    gauge[SAMPLES // 2 :] = 3.0
    frame["Z"] = np.round(gauge, 1)


def hall_on_the_edge(frame, rng):
    """A hall that is held: its sensor flickers on the edge of a step of 0.5 K, and is quiet amid the next."""
    level = np.where(np.arange(SAMPLES) < SAMPLES // 2, 21.25, 22.0)
    frame["hall"] = 0.5 * np.round((level + 0.06 * rng.standard_normal(SAMPLES)) / 0.5)


def thermostat(frame, rng):
    """An oil tank that is heated with the machine and held at 30 °C then; whole numbers."""
    frame["T6"] = np.round(np.minimum(20.0 + np.arange(SAMPLES) / 12.0, 30.0) + 0.1 * rng.standard_normal(SAMPLES))


def without_contact(frame, rng):
    """A gauge that reads 0 between two touches in every run, beside one whose noise goes on."""
    frame["Z"] = 0.0
    for at in rng.integers(20, SAMPLES - 60, 2):
        frame.iloc[at : at + 40, -1] = np.round(5.0 * rng.standard_normal(40), 2)
    frame["Z2"] = np.round(rng.standard_normal(SAMPLES), 2)


def deep_in_the_bed(frame, rng):
    """So large a heat capacity that the first digit seldom changes."""
    frame["T6"] = np.round(20.02 + 0.1 * np.arange(SAMPLES) / SAMPLES + 0.005 * rng.standard_normal(SAMPLES), 1)


@pytest.mark.parametrize(
    "quiet", [held_at_rest, gauge_at_rest, hall_on_the_edge, thermostat, without_contact, deep_in_the_bed]
)
@pytest.mark.parametrize("resolution_k", [0.01, 0.1])
def test_what_lawfully_stands_still_in_every_run_is_not_told(quiet, resolution_k):
    frames = tables(resolution_k)
    for k, frame in enumerate(frames.values()):
        quiet(frame, np.random.default_rng(k))
    assert still_of(frames) == []


def test_coarse_readings_that_all_stand_still_are_those_of_a_machine_at_rest():
    frames = {"r1": tables(0.1)["r1"]}
    held_at_rest(frames["r1"], None)
    assert still_of(frames) == []
