"""The shipped 37-sensor runs are what their generator makes, look like a machine, and say that they are simulated."""

import csv
import importlib.util
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from selector.physics.thermal import field_model
from selector.physics.thermal.field.geometry import MachineGeometry
from selector.shipped import shipped

ROOT = Path(__file__).parents[2]
RUNS = tuple(f"r{i}" for i in range(1, 9))
SENSORS = tuple(f"T{i:02d}" for i in range(1, 38))


@pytest.fixture(scope="module")
def tables():
    found = {}
    for run in RUNS:
        with (shipped("vmc37") / f"{run}.csv").open(encoding="utf-8", newline="") as stream:
            rows = list(csv.reader(stream))
        values = np.array(rows[1:], dtype=np.float64)
        found[run] = dict(zip(rows[0], values.T, strict=True))
    return found


@pytest.fixture(scope="module")
def make():
    spec = importlib.util.spec_from_file_location("make_vmc37", ROOT / "fixtures" / "make" / "vmc37.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["make_vmc37"] = module  # its dataclasses look their module up
    spec.loader.exec_module(module)
    yield module
    del sys.modules["make_vmc37"]


@pytest.fixture(scope="module")
def machine(shared_machines):
    # 8 000 nodes in place of 20 000, made by other files of tests, too; with all nodes: benchmarks/bench_vmc37.py
    return field_model.virtual_machining_centre("everything", geometry=MachineGeometry(), refinement=0.2)


@pytest.mark.parametrize("number", [1, 5, 8])
def test_generator_makes_the_shipped_run(number, make, machine, tables):
    made = make.recorded(make.runs()[number - 1], number, machine)
    assert list(made) == list(tables[f"r{number}"])
    gaps = {name: np.abs(np.array(texts, float) - tables[f"r{number}"][name]).max() for name, texts in made.items()}
    assert [gaps[name] for name in ("t_min", "spindle_speed", "Tamb")] == [0.0, 0.0, 0.0]
    # the coarser mesh: 0.43 K at worst, 0.6 µm; other noise of a gauge would be 2 µm apart, of a thermometer 0.2 K
    assert max(gaps[name] for name in SENSORS) < 0.5
    assert np.median([gaps[name] for name in SENSORS]) < 0.1
    assert max(gaps[name] for name in ("Y_lower", "Y_upper", "Y", "Z")) < 0.8


def test_runs_follow_their_stories(make):
    for run in make.runs():
        conditions, start_s = make.conditions_of(run)
        assert conditions.time_s[-1] - start_s == run.hours * 3600
        working = conditions.spindle_speed > 0
        assert (conditions.machine_on[working] == 1).all()
        assert (conditions.machine_on[conditions.time_s < 12 * 3600] == 0).all()  # a night at rest
        assert (conditions.coolant_on[conditions.time_s < start_s] == 0).all()
        # the pump adds 7.5 K at most, the hall moves by 5 K at most
        assert np.abs(conditions.coolant_degc - conditions.ambient_degc.mean()).max() < 12.5
    cycle, start_s = make.conditions_of(make.runs()[4])
    of_part = (cycle.time_s >= start_s) & (cycle.time_s < start_s + 720)
    speeds = cycle.spindle_speed[of_part]
    assert [speeds[0], *speeds[1:][np.diff(speeds) != 0]] == [3000, 0, 2400, 3000, 1800]


def test_size_labels_and_machine_file(tables):
    folder = shipped("vmc37")
    assert sum(path.stat().st_size for path in folder.iterdir()) < 2_500_000
    machine = tomllib.loads((folder / "machine.toml").read_text(encoding="utf-8"))
    assert "simulated" in machine["machine"]["name"]
    assert "SIMULATED" in (folder / "README.md").read_text(encoding="utf-8").splitlines()[0]
    channels = machine["channels"]
    for table in tables.values():
        assert {machine["time"]["column"], *channels} == set(table)
    assert [name for name in channels if channels[name]["role"] == "temperature"] == list(SENSORS)
    assert all(channels[name]["place"] and len(channels[name]["xyz"]) == 3 for name in SENSORS)
    assert len({tuple(channels[name]["xyz"]) for name in SENSORS}) == 37


def test_looks_like_the_machine_of_the_patent(tables):
    largest = {axis: max(table[axis].max() for table in tables.values()) for axis in "ZY"}
    assert 40 < largest["Z"] < 90
    assert 20 < largest["Y"] < 60
    for table in tables.values():
        assert 6 * 60 <= table["t_min"][-1] <= 8 * 60
        assert (np.diff(table["t_min"]) == 1).all()
    assert 10 < np.ptp(tables["r1"]["T01"]) < 20  # what grease-lubricated bearings of this size do


def test_some_sensors_compensate_and_memory_helps(tables):
    sensors, tau_min = ("T01", "T05", "T08", "T13", "T27", "T28", "T36"), 60.0

    def lagged(rise):
        out = np.zeros_like(rise)
        for k in range(1, len(rise)):
            out[k] = out[k - 1] + (1 - np.exp(-1 / tau_min)) * (rise[k] - out[k - 1])
        return out

    def held_out_um(memory):
        parts = []
        for table in tables.values():
            rise = np.column_stack([table[name] - table[name][0] for name in sensors])
            parts.append(np.column_stack([np.ones(len(rise)), rise, *([lagged(rise)] if memory else [])]))
        squares = []
        for i, run in enumerate(RUNS):
            rest = [j for j in range(len(RUNS)) if j != i]
            x, y = np.vstack([parts[j] for j in rest]), np.concatenate([tables[RUNS[j]]["Z"] for j in rest])
            beta = np.linalg.lstsq(x, y, rcond=None)[0]
            squares.append(np.mean((tables[run]["Z"] - parts[i] @ beta) ** 2))
        return np.sqrt(np.mean(squares))

    uncompensated = np.sqrt(np.mean([np.mean(table["Z"] ** 2) for table in tables.values()]))
    static, memory = held_out_um(memory=False), held_out_um(memory=True)
    # the README's numbers
    assert uncompensated == pytest.approx(38.6, abs=0.05)
    assert static == pytest.approx(2.1, abs=0.05)
    assert memory == pytest.approx(1.8, abs=0.05)
