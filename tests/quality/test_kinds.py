"""Every kind of fault on one plain machine: which finding, where, with which numbers, and what it leaves out."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.quality import inspect
from selector.recording import Channel, Recording
from tests.quality.workshop import plain_recording, plain_tables


@pytest.fixture
def tables():
    return plain_tables()


def the_one(tables, kind):
    """The finding of this kind; it must be the only one of its kind, and nothing else may leave anything out."""
    findings = inspect(plain_recording(tables))
    hits = [finding for finding in findings if finding.id == kind and finding.level != "info"]
    assert len(hits) == 1, [finding.statement for finding in findings]
    assert [f.statement for f in findings if f.action != "none" and f is not hits[0]] == []
    return hits[0]


def test_the_plain_machine_has_no_fault(tables):
    assert [finding.statement for finding in inspect(plain_recording(tables)) if finding.level != "info"] == []


def test_stuck_while_its_noise_is_gone(tables):
    tables["r2"].iloc[300:400, tables["r2"].columns.get_loc("T3")] = tables["r2"]["T3"].iloc[300]
    found = the_one(tables, "stuck")
    assert (found.where.channel, found.where.run) == ("T3", "r2")
    # noise repeats the frozen value before and after with a few per cent: the borders may be off by a sample or two
    assert found.where.from_s == pytest.approx(6000, abs=40)
    assert found.where.to_s == pytest.approx(7980, abs=40)
    assert found.action == "leave-out-stretch"
    # planted noise 0.03 K; the estimate of 48 samples scatters by a fifth, and the lower fifth is taken
    assert found.evidence["noise"] == pytest.approx(0.03, rel=0.4)


def test_stuck_at_a_coarse_resolution_is_told_by_the_siblings(tables):
    for table in tables.values():
        table["T2"] = table["T2"].round(0)
    assert not [f for f in inspect(plain_recording(tables)) if f.action != "none"], "standing still is lawful here"
    tables["r3"].iloc[40:250, tables["r3"].columns.get_loc("T2")] = tables["r3"]["T2"].iloc[40]
    found = the_one(tables, "stuck")
    assert (found.where.channel, found.where.run) == ("T2", "r3")
    assert found.evidence["expected_movement"] > 4.0  # it rises by 5 K there
    assert found.evidence["resolution"] == 1.0


def test_a_single_run_that_is_frozen_most_of_the_time_has_noise_enough_before(tables):
    tables = {"r1": tables["r1"].iloc[:240].copy()}
    tables["r1"].iloc[75:, tables["r1"].columns.get_loc("T3")] = tables["r1"]["T3"].iloc[75]
    found = the_one(tables, "stuck")
    assert (found.where.channel, found.where.to_s) == ("T3", tables["r1"].index[-1])
    assert found.evidence["samples"] == pytest.approx(165, abs=1)


def test_a_frozen_end_of_a_run_says_so(tables):
    tables["r1"].iloc[600:, tables["r1"].columns.get_loc("Z")] = tables["r1"]["Z"].iloc[600]
    found = the_one(tables, "stuck")
    assert found.where.to_s == tables["r1"].index[-1]
    assert "the end" in found.statement


def test_pinned_at_the_end_of_the_range(tables):
    for table in tables.values():
        table["Z"] = np.minimum(table["Z"], 40.0)
    findings = [f for f in inspect(plain_recording(tables)) if f.action != "none"]
    assert {(f.id, f.where.channel) for f in findings} == {("saturated", "Z")}
    assert {f.evidence["rail"] for f in findings} == {40.0}
    pinned = sum(f.evidence["samples"] for f in findings)
    # single samples at the rail are not told from noise
    assert pinned > 0.9 * sum((table["Z"] == 40.0).sum() for table in tables.values())


def test_step_of_one_sensor(tables):
    tables["r4"].loc[5000:, "T5"] -= 1.5
    found = the_one(tables, "step")
    assert (found.where.channel, found.where.run) == ("T5", "r4")
    assert (found.where.from_s, found.where.to_s) == (5000.0, tables["r4"].index[-1])
    assert found.evidence["height"] == pytest.approx(-1.5, abs=4 * found.evidence["standard_error"])


def test_a_step_and_the_step_back_are_not_left_out(tables):
    tables["r4"].loc[5000:8000, "T5"] -= 1.5
    findings = [f for f in inspect(plain_recording(tables)) if f.id == "step" and f.where.channel == "T5"]
    assert [(f.level, f.action, f.where.from_s, f.where.to_s) for f in findings] == [
        ("warning", "none", 5000.0, 8000.0)
    ]


def test_growth_at_once_with_the_speed_is_not_worth_a_word(tables):
    for table in tables.values():
        table["Z"] += 20.0 * table["n"] / 2500
    assert not [f for f in inspect(plain_recording(tables)) if f.where.channel == "Z"]


def test_step_of_a_gauge_without_a_recorded_speed_is_a_warning(tables):
    tables = {run: table.drop(columns="n") for run, table in tables.items()}
    tables["r2"].loc[7000:, "Z"] += 15.0
    found = the_one(tables, "step")
    assert (found.level, found.action) == ("warning", "none")
    assert "spindle speed" in found.statement


def test_a_step_that_several_channels_share_is_no_fault(tables):
    tables["r2"].loc[7000:, ["T1", "T2", "Z"]] += [4.0, 4.0, 20.0]
    steps = [f for f in inspect(plain_recording(tables)) if f.id == "step"]
    assert {f.where.channel for f in steps} == {"T1", "T2", "Z"}
    assert {f.action for f in steps} == {"none"}
    assert not [f for f in inspect(plain_recording(tables)) if f.action != "none"]


@pytest.mark.parametrize("width", [1, 2, 3])
def test_spike(tables, width):
    tables["r1"].iloc[333 : 333 + width, tables["r1"].columns.get_loc("T4")] += 3.0
    found = the_one(tables, "spike")
    assert (found.where.from_s, found.where.to_s) == (333 * 20.0, (332 + width) * 20.0)
    assert found.evidence["largest"] == pytest.approx(3.0, abs=0.2)  # 5 sigma of the noise, there and beside


def test_many_spikes_are_one_finding_that_lists_them(tables):
    at = np.arange(50, 700, 65)
    tables["r1"].iloc[at, tables["r1"].columns.get_loc("T4")] += 3.0
    found = the_one(tables, "spike")
    assert found.evidence["windows_s"] == [[t, t] for t in (at * 20.0).tolist()]


def test_interference_on_every_channel_is_a_spike_on_each(tables):
    measured = [name for name in tables["r1"].columns if name != "n"]
    tables["r1"].loc[3000.0, measured] += 40.0
    spikes = [f for f in inspect(plain_recording(tables)) if f.id == "spike"]
    assert [f.where.channel for f in spikes] == measured


@pytest.mark.parametrize(
    "code", [850.0, -9999.0, 9999.0, -200.0, 3276.7, 32767.0, 327.67, 999.9, 1e30, -127.0, np.inf, 85.0, 0.0]
)
def test_code_of_a_broken_sensor(tables, code):
    tables["r3"].iloc[100:110, tables["r3"].columns.get_loc("T1")] = code
    found = the_one(tables, "sensor-break")
    assert (found.where.channel, found.where.run) == ("T1", "r3")
    assert (found.where.from_s, found.where.to_s) == (2000.0, 2180.0)
    assert found.evidence["samples"] == 10


def test_code_in_another_unit_is_still_a_code(tables):
    tables["r3"].iloc[100, tables["r3"].columns.get_loc("T1")] = (850.0 - 32) / 1.8
    assert the_one(tables, "sensor-break").evidence["samples"] == 1


def test_a_reading_that_passes_a_code_is_none():
    time = np.arange(400.0)
    hot = pd.DataFrame({"T1": np.round(20 + 65 * time / 300, 1), "T2": np.round(20 + 60 * time / 300, 1)}, time)
    assert 85.0 in set(hot["T1"])
    assert not [f for f in inspect(plain_recording({"r1": hot})) if f.id == "sensor-break"]


def test_a_channel_that_is_broken_for_most_of_a_run_is_left_out_of_it(tables):
    tables["r3"].iloc[100:, tables["r3"].columns.get_loc("T1")] = 850.0
    assert the_one(tables, "sensor-break").action == "leave-out-channel"


def test_out_of_range(tables):
    tables["r3"].iloc[100:110, tables["r3"].columns.get_loc("T1")] = np.linspace(300, 400, 10)
    found = the_one(tables, "out-of-range")
    assert (found.where.from_s, found.where.to_s) == (2000.0, 2180.0)


def test_a_unit_that_explains_what_is_out_of_range_stands_beside_it(tables):
    for table in tables.values():
        table["T1"] -= 273.15
    findings = [one for one in inspect(plain_recording(tables)) if one.where.channel == "T1"]
    units = [one for one in findings if one.id == "wrong-unit"]
    ranges = [one for one in findings if one.id == "out-of-range"]
    assert units
    assert ranges
    assert all("Nothing is left out" not in one.suggestion for one in units)
    assert all("−2" in one.statement and "−60 to 250" in one.statement for one in ranges)
    tables["r3"].iloc[100:110, tables["r3"].columns.get_loc("T2")] = np.linspace(300, 400, 10)
    (other,) = [one for one in inspect(plain_recording(tables), ["T2"]) if one.id == "out-of-range"]
    assert "400 °C" in other.statement


def test_a_sensor_that_comes_off(tables):
    table = tables["r2"]
    off = (table.index > 4000).astype(float) * np.clip((table.index - 4000) / 3000, 0, 1)
    table["T2"] -= 4.0 * off
    found = the_one(tables, "drifts-from-group")
    assert (found.where.channel, found.where.run, found.action) == ("T2", "r2", "leave-out-stretch")
    # seen when it exceeds what is usual (some tenths of a kelvin of 4 K in 3000 s)
    assert 4000 < found.where.from_s < 5500
    assert found.evidence["departure_at_end"] == pytest.approx(-4.0, abs=0.5)


def test_three_runs_do_not_prove_that_a_sensor_came_off(tables):
    del tables["r4"]
    tables["r2"]["T2"] -= 4.0 * np.clip((tables["r2"].index - 4000) / 3000, 0, 1)
    assert the_one(tables, "drifts-from-group").action == "none"


def test_swapped_in_one_run(tables):
    tables["r3"][["T1", "T4"]] = tables["r3"][["T4", "T1"]].to_numpy()
    findings = [f for f in inspect(plain_recording(tables)) if f.action != "none"]
    assert [(f.id, f.where.channel, f.where.run, f.action) for f in findings] == [
        ("swapped-channels", "T1", "r3", "leave-out-channel"),
        ("swapped-channels", "T4", "r3", "leave-out-channel"),
    ]
    # a wrong repair looks the same
    assert all("If it says so already, take that out" in f.suggestion for f in findings)


def test_siblings_that_are_nearly_the_same_are_not_called_swapped(tables):
    for table in tables.values():
        table["T2"] = table["T1"] + np.random.default_rng(len(table)).normal(0, 0.03, len(table))
    tables["r3"][["T1", "T2"]] = tables["r3"][["T2", "T1"]].to_numpy()
    assert not [f for f in inspect(plain_recording(tables)) if f.id == "swapped-channels"]


@pytest.mark.parametrize(
    ("change", "gain", "offset"),
    [
        (lambda t: 1.8 * t + 32, 1.8, 32.0),
        (lambda t: t + 273.15, 1.0, 273.15),
        (lambda t: 10 * t, 10.0, 0.0),
        (lambda t: (t - 32) / 1.8, 1 / 1.8, -32 / 1.8),
    ],
)
def test_wrong_unit_of_a_temperature_in_one_run(tables, change, gain, offset):
    tables["r2"]["T3"] = change(tables["r2"]["T3"])
    found = the_one(tables, "wrong-unit")
    assert (found.where.channel, found.where.run, found.action) == ("T3", "r2", "leave-out-channel")
    assert (found.evidence["gain"], found.evidence["offset"]) == (gain, offset)


def test_a_hot_part_is_not_called_fahrenheit(tables):
    tables["r2"]["T3"] += 48.0
    assert not [f for f in inspect(plain_recording(tables)) if f.id == "wrong-unit" and f.action != "none"]


def test_a_part_that_is_hot_in_every_run_is_not_called_fahrenheit(tables):
    for table, start in zip(tables.values(), (48.0, 50.5, 44.0, 52.0), strict=True):
        table["T3"] += start
    assert not [f for f in inspect(plain_recording(tables)) if f.id == "wrong-unit"]


@pytest.mark.parametrize("value", [85.0, 293.15])
def test_a_dead_channel_is_not_called_one_in_another_unit(tables, value):
    for run in ("r1", "r2", "r3", "r4"):
        tables[run]["T3"] = value
        found = inspect(plain_recording(tables))
        assert not [f for f in found if f.id == "wrong-unit"]
        assert [f.id for f in found if f.where.channel == "T3"]


@pytest.mark.parametrize("warm_k", [0.0, 6.0], ids=["cold starts", "one warm start"])
def test_one_channel_in_fahrenheit_in_every_run_is_told(tables, warm_k):
    # what its movement is learned from has the same mistake, so that only the cold starts can tell it
    tables["r2"]["T3"] += warm_k
    for table in tables.values():
        table["T3"] = 1.8 * table["T3"] + 32
    found = [f for f in inspect(plain_recording(tables)) if f.id == "wrong-unit"]
    assert [(f.where.channel, f.where.run, f.level, f.action) for f in found] == [
        ("T3", run, "warning", "none") for run in tables
    ]
    assert all('unit = "degF"' in f.suggestion for f in found)


def test_all_runs_in_fahrenheit_is_only_a_warning(tables):
    for table in tables.values():
        for name in ("Tamb", "T1", "T2", "T3", "T4", "T5"):
            table[name] = 1.8 * table[name] + 32
    found = the_one(tables, "wrong-unit")
    assert (found.level, found.action, found.where.channel) == ("warning", "none", None)


def test_millimetres_in_one_run_and_in_all(tables):
    tables["r2"]["Z"] /= 1000
    found = the_one(tables, "wrong-unit")
    assert (found.where.channel, found.where.run, found.evidence["gain"]) == ("Z", "r2", 1e-3)
    assert found.action == "leave-out-channel"
    for run in ("r1", "r3", "r4"):
        tables[run]["Z"] /= 1000
    found = the_one(tables, "wrong-unit")
    assert (found.where.run, found.action) == (None, "none")


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (1.8, 32.0), (-2.0, 5.0)])
def test_a_copy_of_another_channel(tables, gain, offset):
    for table in tables.values():
        table["T4"] = gain * table["T1"] + offset
    hits = [f for f in inspect(plain_recording(tables)) if f.id == "duplicate-channel"]
    assert [(f.where.channel, f.where.run, f.action) for f in hits] == [("T4", None, "none")]
    assert hits[0].evidence["other"] == "T1"
    # a least-squares line through numbers that lie on it to rounding
    assert (hits[0].evidence["gain"], hits[0].evidence["offset"]) == pytest.approx((gain, offset), rel=1e-6, abs=1e-6)


def test_the_same_column_twice_in_one_run(tables):
    tables["r2"]["T4"] = tables["r2"]["T1"]
    hits = [f for f in inspect(plain_recording(tables)) if f.id == "duplicate-channel"]
    assert [(f.where.channel, f.where.run) for f in hits] == [("T4", "r2")]


def test_gaps_of_rows_and_of_a_channel(tables):
    tables["r1"] = tables["r1"].drop(tables["r1"].index[200:300])
    tables["r2"].iloc[50:150, tables["r2"].columns.get_loc("T3")] = np.nan
    hits = [f for f in inspect(plain_recording(tables)) if f.id == "gap"]
    assert [(f.where.channel, f.where.run, f.where.from_s, f.where.to_s) for f in hits] == [
        (None, "r1", 3980.0, 6000.0),
        ("T3", "r2", 1000.0, 3000.0),
    ]


@pytest.mark.parametrize(("pause_s", "is_pause"), [(1800.0, False), (50_000.0, True)])
def test_of_a_long_pause_it_is_told_that_it_makes_two_runs(tables, pause_s, is_pause):
    table = tables["r1"]
    table.index = table.index + np.where(np.arange(len(table)) < 200, 0.0, pause_s)
    table.iloc[200:] -= 5.0  # the machine has cooled down
    (hit,) = [f for f in inspect(plain_recording(tables)) if f.id == "gap"]
    assert ("2 runs, r1 1 to r1 2" in hit.suggestion) == is_pause


def test_single_samples_that_are_lost_last_a_period_each(tables):
    table = tables["r1"]
    table.iloc[np.arange(len(table)) % 25 == 7, table.columns.get_loc("T3")] = np.nan
    (hit,) = [f for f in inspect(plain_recording(tables)) if f.id == "gap"]
    period_s = table.index[1] - table.index[0]
    assert hit.evidence["longest_s"] == period_s
    assert hit.evidence["total_s"] == pytest.approx(hit.evidence["samples"] * period_s)


def test_a_channel_that_is_sampled_more_seldom_has_no_gaps(tables):
    for table in tables.values():
        table.iloc[np.arange(len(table)) % 10 != 0, table.columns.get_loc("Tamb")] = np.nan
    assert not [f for f in inspect(plain_recording(tables)) if f.id == "gap"]


def test_clock_that_leaps_and_a_pause_that_does_not(tables):
    clock = tables["r1"].copy()
    clock.index = np.where(clock.index > 2000, clock.index + 3000, clock.index)
    pause = tables["r2"].drop(tables["r2"].index[100:250])
    findings = inspect(plain_recording({**tables, "r1": clock, "r2": pause}))
    hits = [f for f in findings if f.id == "clock-jump"]
    assert [(f.where.run, f.where.from_s, f.evidence["leap_s"]) for f in hits] == [("r1", 2000.0, 3000.0)]
    assert {f.where.run for f in findings if f.id == "gap"} == {"r2"}


def test_an_hour_or_a_night_is_told_once(tables):
    leap, night = tables["r1"].copy(), tables["r2"].copy()
    leap.index = np.where(leap.index > 2000, leap.index + 3600, leap.index)
    # little cooler in the morning, and noise hides how it moved in the evening
    night.index = np.where(night.index > 2000, night.index + 57_600, night.index)
    night.loc[night.index > 2000, night.columns != "Tamb"] -= 0.8
    found = [f for f in inspect(plain_recording({**tables, "r1": leap, "r2": night})) if f.id in ("gap", "clock-jump")]
    assert [(f.id, f.where.run) for f in found] == [("clock-jump", "r1"), ("gap", "r2")]
    assert "cut here" in found[0].suggestion
    assert "r2 1 to r2 2" in found[1].suggestion


def test_few_values_constant_and_empty(tables):
    for table in tables.values():
        table["T4"] = 2.0 * (table["T4"] / 2.0).round(0)
        table["T5"] = 21.5
        table["Y"] = np.nan
    findings = inspect(plain_recording(tables))
    told = {(f.id, f.where.channel, f.level) for f in findings if f.where.channel in ("T4", "T5", "Y")}
    assert told == {
        ("few-values", "T4", "warning"),
        ("constant-channel", "T5", "warning"),
        ("empty-channel", "Y", "warning"),
    }


def test_short_run_and_warm_start(tables):
    tables["r4"] = tables["r4"].iloc[:10]
    warm = tables["r2"].iloc[200:]
    warm.index = warm.index - warm.index[0]
    findings = inspect(plain_recording({**tables, "r2": warm}))
    assert [(f.where.run, f.evidence["samples"]) for f in findings if f.id == "short-run"] == [("r4", 10)]
    hits = [f for f in findings if f.id == "run-starts-warm"]
    assert [f.where.run for f in hits] == ["r2"]
    assert {"T1", "T2"} <= set(hits[0].evidence["channels"])
    assert {f.level for f in hits} == {"info"}


def test_a_quick_machine_that_is_seldom_sampled_starts_like_the_others(tables):
    for k, run in enumerate(tables):
        table = tables[run] = tables[run].iloc[::10]
        table["Z"] = 15.0 * (k + 1) * (1.0 - np.exp(-np.arange(len(table)) / 3.0))
    assert [f for f in inspect(plain_recording(tables)) if f.id == "run-starts-warm"] == []
    tables["r2"].iloc[0, tables["r2"].columns.get_loc("Z")] = 40.0
    assert [f for f in inspect(plain_recording(tables)) if f.id == "run-starts-warm"] == []
    tables["r2"]["Z"] += 25.0
    hits = [f for f in inspect(plain_recording(tables)) if f.id == "run-starts-warm"]
    assert [(f.where.run, list(f.evidence["channels"])) for f in hits] == [("r2", ["Z"])]


@pytest.mark.parametrize(("rows", "ids"), [(14, {"gap"}), (200, {"gauge-begins-late"})])
def test_a_gauge_that_begins_late_is_told_once(tables, rows, ids):
    tables["r2"].iloc[:rows, tables["r2"].columns.get_loc("Z")] = np.nan
    found = [
        one
        for one in inspect(plain_recording(tables))
        if one.where.channel == "Z" and one.id in ("gap", "gauge-begins-late")
    ]
    assert {one.id for one in found} == ids
    late = [(one.where.run, one.evidence["begins_s"]) for one in found if one.id == "gauge-begins-late"]
    assert late == [("r2", tables["r2"].index[rows])][: rows // 15]


def test_commands_may_stand_still_and_jump(tables):
    assert not [f for f in inspect(plain_recording(tables)) if f.where.channel == "n"]


def test_means_of_readings_on_a_grid_stand_still_lawfully(tables):
    draw = np.random.default_rng(8)
    for table in tables.values():
        smooth = table["T3"].rolling(60, 1).mean().to_numpy()
        # thermometers of 1/16 K, written to 0.001 K
        noise = np.where(np.arange(len(smooth)) < 0.7 * len(smooth), 0.03, 0.008)
        codes = [np.round((smooth + noise * draw.standard_normal(len(smooth))) * 16.0) for _ in range(2)]
        table["T3"] = np.mean([np.floor(code * 62.5) / 1000.0 for code in codes], axis=0)
    assert [f.statement for f in inspect(plain_recording(tables)) if f.id == "stuck"] == []
    # and still stuck is stuck, where it takes longer than chance
    tables["r2"].iloc[100:700, tables["r2"].columns.get_loc("T3")] = tables["r2"]["T3"].iloc[100]
    assert {f.where.run for f in inspect(plain_recording(tables)) if f.id == "stuck"} == {"r2"}


def test_one_hot_part_beside_one_cold_part_is_no_wrong_unit():
    time_s = 60.0 * np.arange(300)
    noise = 0.02 * np.random.default_rng(1).standard_normal((300, 3))
    warm = 1.0 - np.exp(-time_s / 3000.0)
    parts = {"T1": 24.0 + warm, "T2": 75.0 + 2.0 * warm, "T3": 23.0 + warm}
    told = {}
    for names in (("T1", "T2"), ("T1", "T2", "T3")):
        table = pd.DataFrame({name: parts[name] + noise[:, k] for k, name in enumerate(names)}, index=time_s)
        channels = [Channel(name, "temperature", "degC") for name in names]
        found = inspect(Recording.from_runs({"r": table}, channels))
        told[len(names)] = [one.where.channel for one in found if one.id == "wrong-unit"]
    assert told == {2: [], 3: ["T2"]}


@pytest.mark.parametrize(("axis", "is_told"), [("X", False), ("Y", True)])
def test_a_following_error_of_a_slow_run_is_not_called_mil(axis, is_told):
    time_s = np.arange(400.0)
    runs = {}
    for k, feed in enumerate((1.0, 25.4, 25.4, 25.4)):
        way = np.sin(0.02 * time_s + k)
        runs[f"f{k}"] = pd.DataFrame({"at": 0.1 * way, "E": 20.0 * feed * np.cos(0.02 * time_s + k)}, index=time_s)
    channels = [Channel("at", "position_command", "m", axis=axis), Channel("E", "displacement", "um", axis="X")]
    found = [one for one in inspect(Recording.from_runs(runs, channels)) if one.id == "wrong-unit"]
    assert [(one.where.channel, one.where.run) for one in found] == [("E", "f0")] * is_told


@pytest.mark.parametrize("wrong", [1, 4, 5])
def test_a_unit_that_is_wrong_in_most_runs_is_told_in_these(wrong):
    time_s, draw, runs = 60.0 * np.arange(300), np.random.default_rng(4), {}
    for k in range(6):
        warm = 15.0 * (1.0 - np.exp(-time_s / 3000.0)) * draw.uniform(0.5, 1.5)
        table = pd.DataFrame({"T1": 19.0 + k + warm, "T2": 19.0 + k + 0.5 * warm, "Z": 3.0 * warm}, index=time_s)
        table += draw.normal(0, 0.05, table.shape)
        runs[f"r{k}"] = table * [1.8, 1.8, 1e-3] + [32.0, 32.0, 0.0] if k < wrong else table
    channels = [Channel(name, "temperature", "degC") for name in ("T1", "T2")] + [Channel("Z", "displacement", "um")]
    found = [one for one in inspect(Recording.from_runs(runs, channels)) if one.id == "wrong-unit"]
    told = {(one.where.channel, one.where.run): one.evidence["unit"] for one in found}
    units = {"T1": "degF", "T2": "degF", "Z": "mm"}
    assert told == {(name, f"r{k}"): unit for name, unit in units.items() for k in range(wrong)}
    assert all(one.action == "leave-out-channel" for one in found)
