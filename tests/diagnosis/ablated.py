"""Models of our own with a term deleted, and recordings of the whole model: cases of mode C whose answer is known."""

from __future__ import annotations

import copy

import numpy as np
import pandas as pd

from selector.diagnosis.open_model.runnable import OwnModel
from selector.physics.drive.drive_model import drive_model
from selector.physics.drive.model_file import checked_model_file as drive_file
from selector.physics.thermal.model_file import checked_model_file as heat_file
from selector.physics.thermal.schedule import scheduled
from selector.physics.thermal.thermal_model import thermal_model
from selector.recording import Recording

AXIS = {
    "model": {"kind": "drive", "name": "axis"},
    "run": {"period_s": 0.002},
    "motion": {
        "kind": "moves", "targets_mm": [80.0, 20.0, 0.0], "feed_mm_per_min": 9000.0, "acceleration_m_per_s2": 2.0,
        "jerk_m_per_s3": 60.0, "dwell_s": 0.1,
    },
    "axes": {"X": {
        "output": "voltage",
        "mechanics": {"kind": "rigid", "mass_kg": 95.0, "guide_damping_ns_per_m": 200.0},
        "friction": {"coulomb_n": 20.0, "offset_n": -3.0},
        "servo": {"position_gain_per_s": 160.0, "velocity_gain": 240.0, "actuator_gain": 35.0, "sample_s": 0.002},
        "sensing": {"current_noise": 0.02},
    }},
}  # fmt: skip
WAYS = (([80.0, 20.0, 0.0], 9000.0), ([60.0, 0.0], 4000.0), ([70.0, 10.0, 40.0, 0.0], 7000.0))

HEATED = {
    "model": {"kind": "network", "name": "headstock on a column"},
    "run": {"duration_min": 300, "period_s": 60, "step_s": 60, "start_degc": 20.0},
    "conditions": {"spindle_speed_rpm": [[0, 1500], [120, 3000], [220, 0]], "ambient_degc": 20.0},
    "nodes": {
        "spindle": {"heat_capacity_j_per_k": 2.0e4, "expansion_um_per_k": {"Z": 2.0}},
        "headstock": {"heat_capacity_j_per_k": 8.0e4, "expansion_um_per_k": {"Z": 1.5}},
        "column": {"heat_capacity_j_per_k": 2.0e5, "expansion_um_per_k": {"Z": 3.0}},
    },
    "links": [
        {"between": ["spindle", "headstock"], "conductance_w_per_k": 20.0},
        {"between": ["headstock", "column"], "conductance_w_per_k": 15.0},
    ],
    "films": {"hall": {"area_m2": {"headstock": 1.0, "column": 2.0}, "still_w_per_m2_k": 8.0}},
    "sources": {
        "bearings": {"shares": {"spindle": 1.0}, "speed_w": 200.0, "reference_rpm": 3000, "exponent": 1.5},
        "pump": {"shares": {"column": 1.0}, "on_w": 60.0},
    },
    "sensors": [
        {"name": "T1", "at": "headstock", "noise_k": 0.02, "resolution_k": 0.01},
        {"name": "T2", "at": "column", "noise_k": 0.02, "resolution_k": 0.01},
    ],
    "gauges": [{"name": "Z", "axis": "Z", "noise_um": 0.3, "resolution_um": 0.1}],
}
DUTIES = (
    [[0, 1500], [120, 3000], [220, 0]],
    [[0, 2500], [60, 0], [120, 2000], [200, 3000]],
    [[0, 800], [90, 2600], [180, 1200]],
)


def axis_recording(plain=AXIS, ways=WAYS) -> Recording:
    """The axis on several ways, with noise."""
    tables = {}
    for number, (targets, feed) in enumerate(ways):
        changed = copy.deepcopy(plain)
        changed["motion"] |= {"targets_mm": targets, "feed_mm_per_min": feed}
        done = drive_model(drive_file(changed)).simulation(run="r", seed=number).recording
        names = ["X_command", "X_position", "X_voltage"]
        tables[f"r{number}"] = pd.DataFrame(done.values("r", names), pd.Index(done.time_s("r"), name="time_s"), names)
    return Recording.from_runs(tables, tuple(done.channel(name) for name in names), {})


def heat_recording(plain=HEATED, duties=DUTIES) -> Recording:
    """The headstock under several duties, with noise."""
    runs, channels = {}, ()
    for number, duty in enumerate(duties):
        changed = copy.deepcopy(plain)
        changed["conditions"]["spindle_speed_rpm"] = duty
        file = heat_file(changed)
        conditions = scheduled(file.conditions, {}, duration_s=18_000.0, period_s=60.0)
        done = thermal_model(file).simulate(conditions, run="r", seed=number)
        index = pd.Index(np.asarray(done.time_s("r")), name="time_s")
        runs[f"r{number}"] = pd.DataFrame(done.values("r", done.names), index, list(done.names))
        channels = done.channels
    return Recording.from_runs(runs, channels, {})


def axis_without(*keys: str, **mechanics: float) -> dict:
    """The axis with these numbers of its friction deleted, others of its mechanics changed."""
    plain = copy.deepcopy(AXIS)
    for key in keys:
        del plain["axes"]["X"]["friction"][key]
    plain["axes"]["X"]["mechanics"] |= mechanics
    return plain


def heat_without(source: str) -> dict:
    """The headstock without a source of heat."""
    plain = copy.deepcopy(HEATED)
    del plain["sources"][source]
    return plain


def axis_model(plain: dict, recording: Recording) -> OwnModel:
    """What the recordings of an axis drive."""
    return OwnModel("drive", drive_file(plain), recording)


def heat_model(plain: dict, recording: Recording) -> OwnModel:
    """What the recordings of a headstock drive."""
    return OwnModel("thermal", heat_file(plain), recording)
