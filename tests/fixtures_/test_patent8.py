"""The reconstruction of the patent's recording has the printed results, and the generator makes the shipped file."""

import csv
import importlib.util
import tomllib
from pathlib import Path

import numpy as np
import pytest

from selector.audit import checks
from selector.sensors.similarity import correlation_similarity
from selector.shipped import shipped

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def table():
    with (shipped("patent8") / "recording.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


@pytest.fixture(scope="module")
def rises(table):
    return np.column_stack([table[name] - table[name][0] for name in checks.SENSORS])


def coefficients(model, rises, response):
    columns = model.columns(rises[:, 0], rises[:, 2], rises[:, 4])
    return np.linalg.lstsq(columns, response, rcond=None)[0]


def test_generator_makes_the_shipped_file(table):
    spec = importlib.util.spec_from_file_location("make_patent8", ROOT / "fixtures" / "make" / "patent8.py")
    make = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(make)
    made = make.recording()
    assert list(made) == list(table)
    for name, values in made.items():
        # ten decimals are stored; 1e-9 leaves room for another linear-algebra library
        np.testing.assert_allclose(values, table[name], rtol=0, atol=1e-9, err_msg=name)


def test_every_correlation_rounds_to_the_printed_one(rises):
    assert np.array_equal(np.round(correlation_similarity(rises).matrix, 4), checks.SIMILARITY)


@pytest.mark.parametrize(
    ("model", "column"),
    [
        (checks.Z_TWO_SENSORS, "Z"),
        (checks.Y_TWO_SENSORS, "Y"),
        (checks.Y_THREE_SENSORS, "Y"),
        (checks.Z_THREE_SENSORS, "Z_embodiment2"),
    ],
)
def test_regressions_give_the_printed_models(model, column, table, rises):
    # 1e-7: rounding at ten decimals, times a condition number of about 1e3; the models are printed with 1e-4
    np.testing.assert_allclose(coefficients(model, rises, table[column]), model.coefficients, rtol=0, atol=1e-7)


def test_the_first_z_does_not_give_the_three_sensor_model(table, rises):
    # README says so; should a generator ever meet all four models, it must be rewritten
    found = coefficients(checks.Z_THREE_SENSORS, rises, table["Z"])
    assert np.abs(found / checks.Z_THREE_SENSORS.coefficients - 1).max() > 0.5


def test_is_a_warm_up_from_rest(table, rises):
    assert (rises[0] == 0).all()
    assert rises.min() >= 0
    assert 6 <= rises[-1, 0] <= 10  # bearings "6–10 °C"
    assert 6 <= rises[-1, 2] <= 10.01  # "10" in whole degrees
    for name in ("Y_lower", "Y_upper", "Y", "Z", "Z_embodiment2"):
        assert table[name][0] == 0
    assert 6 * 60 <= table["t_min"][-1] <= 8 * 60
    # both are rounded to ten decimals
    np.testing.assert_allclose((table["Y_lower"] + table["Y_upper"]) / 2, table["Y"], rtol=0, atol=2e-10)


def test_machine_file_describes_every_column_and_says_reconstruction(table):
    text = (shipped("patent8") / "machine.toml").read_text(encoding="utf-8")
    machine = tomllib.loads(text)
    assert {machine["time"]["column"], *machine["channels"]} == set(table)
    assert "reconstruction" in machine["machine"]["name"]
    assert "RECONSTRUCTION" in (shipped("patent8") / "README.md").read_text(encoding="utf-8")
