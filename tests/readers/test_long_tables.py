"""Tables in which a column says of which sensor each row is."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.readers import read

NAMES, ROWS = ("front", "rear", "table"), 80


def long_table() -> pd.DataFrame:
    parts = []
    for k, name in enumerate(NAMES):
        time_s = 30.0 * np.arange(ROWS) + 0.3 * k
        parts.append(pd.DataFrame({"t [s]": time_s, "sensor": name, "T [degC]": 20.0 + 5.0 * k + 1e-3 * time_s}))
    return pd.concat(parts)


@pytest.mark.parametrize("column", ["sensor", "Kanal", "sensorId"])
@pytest.mark.parametrize("is_sorted", [True, False])
def test_each_sensor_becomes_a_channel(tmp_path, column, is_sorted):
    table = long_table().rename(columns={"sensor": column})
    (table.sort_values("t [s]") if is_sorted else table).to_csv(tmp_path / "long.csv", index=False)
    reading = read([tmp_path / "long.csv"])
    [run] = reading.runs
    assert (run.rows, run.period_s) == (ROWS, 30.0)
    assert [channel.role for channel in reading.channels] == ["temperature"] * 3
    for k, name in enumerate(NAMES):
        [channel] = [one for one in reading.recording.names if one.startswith(name)]
        seen = reading.recording.values("long", (channel,))[:, 0]
        # of a sensor that is read 0.3 s later the reading is taken as it is
        np.testing.assert_allclose(seen, 20.0 + 5.0 * k + 1e-3 * (30.0 * np.arange(ROWS) + 0.3 * k), atol=1e-3)
    [told] = [one for one in reading.findings if one.id == "sensor-column"]
    assert told.evidence["sensors"] == sorted(NAMES)


def test_numbers_are_sensors_only_under_a_heading_that_says_so(tmp_path):
    numbered = (
        long_table().sort_values("t [s]").assign(sensor=lambda one: one.sensor.map({"front": 1, "rear": 2, "table": 3}))
    )
    numbered.to_csv(tmp_path / "numbered.csv", index=False)
    assert len(read([tmp_path / "numbered.csv"]).channels) == 3
    numbered.rename(columns={"sensor": "step"}).to_csv(tmp_path / "steps.csv", index=False)
    assert "sensor-column" not in {one.id for one in read([tmp_path / "steps.csv"]).findings}


def test_a_sensor_without_a_reading_costs_no_other(tmp_path):
    table = long_table()
    table.loc[table.sensor == "rear", "T [degC]"] = np.nan
    table.to_csv(tmp_path / "long.csv", index=False)
    assert [one.split()[0] for one in read([tmp_path / "long.csv"]).recording.names] == ["front", "table"]


def test_codes_of_a_quicker_sensor_are_in_no_mean(tmp_path):
    table = long_table()
    quick = pd.DataFrame({"t [s]": 10.0 * np.arange(3 * ROWS - 2), "sensor": "bed"})
    quick["T [degC]"] = 30.0 + 0.01 * np.random.default_rng(1).standard_normal(len(quick))
    quick.loc[20:60:5, "T [degC]"] = 850.0
    pd.concat([table, quick]).to_csv(tmp_path / "long.csv", index=False)
    seen = read([tmp_path / "long.csv"]).recording
    assert len(seen.names) == 4
    assert np.nanmax(seen.values("long", tuple(one for one in seen.names if one.startswith("bed")))) < 31.0


def test_words_of_a_state_are_no_sensors(tmp_path):
    time_s = 10.0 * np.arange(200)
    words = np.where(time_s % 400 < 200, "heating", "cooling")
    table = pd.DataFrame({"t [s]": time_s, "state": words, "T1 [degC]": 20.0 + 0.01 * time_s})
    table.to_csv(tmp_path / "states.csv", index=False)
    reading = read([tmp_path / "states.csv"])
    assert "sensor-column" not in {one.id for one in reading.findings}
    assert reading.runs[0].rows == 200


@pytest.mark.parametrize("first", ["2026-03-01", "01.03.2026"])
@pytest.mark.parametrize("clock", ["%H:%M:%S", "seconds"])
def test_a_date_beside_a_time_of_day_is_no_sensor(tmp_path, first, clock):
    style = "%Y-%m-%d" if first.startswith("2026") else "%d.%m.%Y"
    stamps = pd.date_range("2026-03-01 23:00", periods=120, freq="60s")
    time = stamps.strftime(clock) if clock != "seconds" else stamps.hour * 3600 + stamps.minute * 60
    falling = 30.0 - 0.01 * np.arange(120)
    pd.DataFrame({"Date": stamps.strftime(style), "Time": time, "T1 [degC]": falling}).to_csv(
        tmp_path / "night.csv", index=False
    )
    reading = read([tmp_path / "night.csv"])
    assert "sensor-column" not in {one.id for one in reading.findings}
    assert reading.runs[0].rows == 120
    if clock != "seconds":
        assert (reading.runs[0].start or "")[:16] == "2026-03-01T23:00"


def test_a_phase_that_changes_once_is_no_sensor(tmp_path):
    phase = np.repeat(["heating", "cooling"], 60)
    table = pd.DataFrame({"t [s]": 60.0 * np.arange(120), "phase": phase, "T1 [degC]": 30.0 - 0.01 * np.arange(120)})
    table.to_csv(tmp_path / "phases.csv", index=False)
    reading = read([tmp_path / "phases.csv"])
    assert "sensor-column" not in {one.id for one in reading.findings}
    assert reading.runs[0].rows == 120


@pytest.mark.parametrize(("beside", "values"), [("speed [rpm]", [3000, 0]), ("mode", ["run", "idle"])])
def test_a_phase_that_changes_with_a_speed_or_another_state_is_no_sensor(tmp_path, beside, values):
    rising = 20.0 + np.sin(np.arange(120) / 15.0)
    phase = np.repeat(["heating", "cooling"], 60)
    table = pd.DataFrame({"t [s]": 60.0 * np.arange(120), "T1 [degC]": rising, "phase": phase})
    table[beside] = np.repeat(values, 60)
    table.to_csv(tmp_path / "phases.csv", index=False)
    assert read([tmp_path / "phases.csv"]).runs[0].rows == 120


def test_two_staircases_under_one_label_are_no_sensors(tmp_path):
    speed = np.tile(np.repeat([1000, 2000, 3000, 4000], 30), 2)
    test = np.repeat(["first", "second"], 120)
    table = pd.DataFrame({"t [s]": 60.0 * np.arange(240), "T1 [degC]": np.cos(np.arange(240)), "speed [rpm]": speed})
    table.assign(part=test).to_csv(tmp_path / "stairs.csv", index=False)
    assert "sensor-column" not in {one.id for one in read([tmp_path / "stairs.csv"]).findings}


def test_sensors_that_follow_each_other_may_have_dates(tmp_path):
    table = long_table()
    table["t [s]"] = (pd.Timestamp("2026-03-01 08:00") + pd.to_timedelta(table["t [s]"].round(), unit="s")).astype(str)
    table.rename(columns={"t [s]": "time"}).to_csv(tmp_path / "long.csv", index=False)
    assert len(read([tmp_path / "long.csv"]).channels) == len(NAMES)
