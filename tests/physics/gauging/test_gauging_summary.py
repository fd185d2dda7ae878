"""What gauging amounts to: formula beside Monte Carlo, capability, filters, and what is told of sizes that are off."""

from __future__ import annotations

import copy
import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from selector.physics.gauging.gauged_grinding import FEWEST_SIZES, GaugedGrinding, finished_sizes
from selector.physics.gauging.gauging_model import gauging_model
from selector.physics.gauging.gauging_summary import gauging_summary
from selector.physics.gauging.model_file import checked_model_file, read_model_file
from selector.physics.gauging.sizes import sizes_by_formula
from selector.physics.gauging.transducer import Grinding, LinearGauge, Noise, Relay, Stage
from selector.physics.model_text import plain_values
from tests.physics.gauging.quick_trials import shorten_trials
from tests.physics.gauging.test_model_file import LINEAR, changed

FIXTURES = Path(__file__).resolve().parents[3] / "fixtures" / "gauging"
SLOW_NOISE = changed(LINEAR, ("noise", {"sd_um": 0.3, "rate_per_s": 0.2}))
TOLERANCE = ("tolerance", {"lower_um": -2.0, "upper_um": 2.0})


@pytest.fixture(scope="module", autouse=True)
def _quick_trials():
    with pytest.MonkeyPatch.context() as patch:
        shorten_trials(patch)
        yield


@cache
def example(name):
    built = gauging_model(read_model_file(FIXTURES / f"{name}.toml"))
    return built, gauging_summary(built, built.simulation())


def of(values, *changes):
    return _summary_of(json.dumps(changed(values, *changes)))


@cache
def _summary_of(text):
    return gauging_summary(gauging_model(checked_model_file(json.loads(text))))


def told(summary):
    return {one.id: one for one in summary.findings}


@pytest.mark.parametrize("name", ["linear", "grind-to-size", "wear"])
def test_formula_and_monte_carlo_agree_within_the_error_of_the_latter(name):
    _, summary = example(name)
    sizes, formula = summary.sizes, summary.formula
    assert len(sizes.size_um) >= FEWEST_SIZES
    # 4 standard errors of mean and of standard deviation of 2000 parts, 2 and 1.6 % of the latter each
    assert abs(sizes.mean_um - formula.mean_um - formula.curvature_um) < 4.0 * sizes.mean_error_um
    assert abs(sizes.sd_um - formula.sd_um) < 4.0 * sizes.sd_error_um
    assert "formula-differs" not in told(summary)


def test_what_the_examples_are_made_to_show():
    assert set(told(example("linear")[1])) == {"better-filter"}
    assert set(told(example("grind-to-size")[1])) == set()
    assert example("grind-to-size")[1].capability.cpk > 1.33
    built, worn = example("wear")
    assert set(told(worn)) == {"sizes-off-what-is-wanted", "low-capability"}
    assert "dress" in told(worn)["low-capability"].suggestion
    batches = worn.sizes.size_um.reshape(-1, built.file.run.parts).mean(axis=0)
    # wear of the wheel: 0.71 s · (3.33 − 2.45 µm/s) until it is dressed; of the tip 0.01 µm a part for good
    assert batches[35:40].mean() - batches[:5].mean() == pytest.approx(0.6 + 0.35, abs=0.25)
    assert batches[40:45].mean() - batches[:5].mean() == pytest.approx(0.4, abs=0.25)


def test_a_keyway_trips_early_and_a_moved_threshold_and_more_filter_help():
    built, summary = example("interrupted")
    findings = told(summary)
    assert set(findings) >= {"surface-trips-early", "sizes-off-what-is-wanted", "low-capability", "better-filter"}
    assert 3.0 < summary.sizes.mean_um < 6.0
    # the filter that is advised, centred
    present, *_, best = summary.settings
    assert best.rms_um < 0.95 * present.sd_um
    assert best.time_constant_s > built.values.filter_s


@pytest.mark.parametrize("name", ["linear", "interrupted", "grind-to-size"])
def test_every_setting_is_what_a_run_with_it_gives(name):
    built, summary = example(name)
    assert [one.name for one in summary.settings] == ["present", "centred", "best-filter-centred"]
    for one in summary.settings:
        plain = copy.deepcopy(plain_values(built.file)) | {"thresholds": {"volts": list(one.thresholds_v)}}
        gauge = plain["transducer"]["smoothing"] if "transducer" in plain else plain["linear"]
        gauge["time_constant_s"] = one.time_constant_s
        again = finished_sizes(gauging_model(checked_model_file(plain)).setup, 2000, seed=77)
        # 4 standard errors of each of two means, and of two standard deviations
        error_um = np.hypot(one.bias_error_um, again.mean_error_um)
        assert abs(again.mean_um - built.setup.wanted_um - one.bias_um) < 4.0 * error_um
        assert abs(again.sd_um - one.sd_um) < 4.0 * np.sqrt(2.0) * again.sd_error_um
    for one in summary.settings:
        if one.name.endswith("centred"):
            # to less than the error of the mean
            assert abs(one.bias_um) < one.bias_error_um


def test_volts_that_centre_a_keyway_are_those_of_a_run_with_them():
    built, summary = example("interrupted")
    (centred,) = [one for one in summary.settings if one.name == "centred"]
    # the line says 2.1074 V + 17.7 mV/µm · 4.7 µm, which is half a µm too far
    volts = ("thresholds", {"volts": list(centred.thresholds_v)})
    moved = gauging_model(checked_model_file(changed(plain_values(built.file), volts)))
    sizes = finished_sizes(moved.setup, centred.parts, seed=moved.file.run.seed)
    # the same parts as in the advice
    assert sizes.mean_um == pytest.approx(centred.bias_um, abs=1e-12)


def test_a_filter_at_the_end_of_what_was_looked_at_is_said_to_be():
    _, summary = example("linear")
    best = summary.settings[-1]
    assert best.at_limit
    assert best.time_constant_s == summary.filters[-1].time_constant_s
    assert told(summary)["better-filter"].evidence["settings"][0]["at_limit"]


def test_the_summary_says_where_everything_is_from():
    built, summary = example("grind-to-size")
    np.testing.assert_array_equal(summary.characteristic.voltage_v, built.characteristic.voltage_v)
    assert [stage.threshold_v for stage in summary.stages] == list(built.setup.thresholds_v)
    assert [(stage.until_um, stage.feed_um_per_s, stage.rate_um_per_s) for stage in summary.stages] == [
        (30.0, 25.0, 25.0),
        (0.0, 5.0, 5.0),
    ]
    low, high = summary.linear_range_um
    assert low < 0.0 < high
    for end in (low, high):
        line = summary.gauge.bias_v + summary.gauge.gain_v_per_um * end
        off_um = (float(summary.characteristic.voltage_at(end)) - line) / summary.gauge.gain_v_per_um
        # a tenth of the tolerance of 6 µm
        assert abs(off_um) == pytest.approx(0.6, rel=0.02)
    # the recorded parts are the first of the Monte Carlo
    np.testing.assert_array_equal(summary.sizes.size_um[:50], built.simulation().sizes.size_um)


def test_without_tolerance_there_is_no_capability():
    assert of(SLOW_NOISE).capability is None
    known = of(SLOW_NOISE, TOLERANCE).capability
    # sd of eq. 25 is 0.3/√1.02
    assert known.cp == pytest.approx(2.0 / (3.0 * 0.3 / np.sqrt(1.02)), rel=0.07)


def test_of_a_linear_gauge_the_line_holds_wherever_is_ground():
    summary = of(SLOW_NOISE)
    assert summary.characteristic is None
    assert summary.linear_range_um == (0.0, 60.0)


def test_quick_noise_trips_early_and_is_told():
    quick = of(LINEAR, ("noise", {"sd_um": 1.0, "rate_per_s": 50.0}), TOLERANCE)
    early = told(quick)["noise-trips-early"]
    # σ_ẏ/(|K|·a) = 1 µm · √(50/(0.1 · 6)) / 2 µm/s
    assert early.evidence["restlessness"] == pytest.approx(np.sqrt(50 / 0.6) / 2.0)
    assert quick.sizes.mean_um == pytest.approx(early.evidence["early_um"], abs=0.15)
    assert early.level == "info"  # less than a tenth of the tolerance
    tight = ("tolerance", {"lower_um": -1.0, "upper_um": 1.0})
    assert (
        told(of(LINEAR, ("noise", {"sd_um": 1.0, "rate_per_s": 50.0}), tight))["noise-trips-early"].level == "warning"
    )
    assert "noise-trips-early" not in told(of(SLOW_NOISE))


def test_early_commands_of_the_relay_alone_are_told_with_their_cause():
    relay = of(LINEAR, ("relay", {"noise_v": 0.005}))
    early = told(relay)["noise-trips-early"]
    assert relay.formula.restlessness == 0.0
    assert all(said in early.statement for said in ("relay", "5 mV", "10 ms"))
    assert "gauge" not in early.statement
    assert "relay" in early.suggestion
    assert not relay.formula_holds
    both = of(LINEAR, ("relay", {"noise_v": 0.0015}), ("noise", {"sd_um": 1.0, "rate_per_s": 50.0}))
    statement = told(both)["noise-trips-early"].statement
    assert "gauge" in statement
    assert "relay" in statement


def test_how_often_parts_are_looked_at_changes_no_size():
    noisy = changed(LINEAR, ("relay", {"noise_v": 0.005}), ("noise", {"sd_um": 0.3, "rate_per_s": 20.0}))
    often, seldom = (of(noisy, ("run.period_s", period_s)) for period_s in (0.001, 0.05))
    np.testing.assert_array_equal(often.sizes.size_um, seldom.sizes.size_um)
    assert often.formula == seldom.formula
    assert often.filters == seldom.filters
    rarer = of(noisy, ("relay.noise_hold_s", 0.1))
    assert rarer.sizes.mean_um < often.sizes.mean_um - 4.0 * often.sizes.mean_error_um
    built = gauging_model(checked_model_file(noisy)).with_parameters({"relay.noise_hold_s": 0.05, "noise.sd_um": 0.2})
    assert (
        built.setup.relay.noise_hold_s == built.with_parameters({"noise.sd_um": 0.1}).setup.relay.noise_hold_s == 0.05
    )


def test_the_formula_differs_where_no_noise_explains_it():
    """A last stage that is short against the filter: what the stage before leaves in it makes parts smaller."""
    stages = [{"feed_um_per_s": 20.0, "until_um": 0.3}, {"feed_um_per_s": 2.0, "until_um": 0.0}]
    short = of(LINEAR, ("grinding.stages", stages), ("noise", {"sd_um": 0.05, "rate_per_s": 1.0}))
    differs = told(short)["formula-differs"]
    assert not short.formula_holds
    assert abs(differs.evidence["formula_um"] - short.sizes.mean_um) > 0.15 * short.sizes.sd_um
    assert {"formula-differs", "noise-trips-early"} & set(told(of(SLOW_NOISE))) == set()


def test_filters_are_ground_and_the_best_of_them_is_told():
    """Noise of 0.5 µm, 30/s, and feeds that differ by a tenth: a quick filter trips early, a slow one is late."""
    summary = of(LINEAR, ("noise", {"sd_um": 0.5, "rate_per_s": 30.0}), ("grinding.feed_sd", 0.1))
    times = [one.time_constant_s for one in summary.filters]
    assert times == sorted(times)
    spreads = [one.sd_um for one in summary.filters]
    best = {one.name: one for one in summary.settings}["best-filter-centred"]
    at = times.index(best.time_constant_s)
    assert 0 < at < len(times) - 1
    assert not best.at_limit
    assert spreads[at] == min(spreads)
    # two dozen times the parts, the same to what some hundred can tell
    assert best.sd_um == pytest.approx(spreads[at], rel=0.25)
    assert abs(best.bias_um) < best.bias_error_um < summary.filters[0].bias_um
    steady = of(LINEAR, ("noise", {"sd_um": 0.5, "rate_per_s": 30.0}))
    # a slow filter is late by what the feed of a part makes of it
    assert steady.filters[-1].sd_um < 0.7 * summary.filters[-1].sd_um


def test_capability_is_told_with_what_would_help():
    off_centre = of(SLOW_NOISE, TOLERANCE, ("thresholds.volts", [0.745, 0.7925]))
    low = told(off_centre)["low-capability"]
    assert "centre" in low.suggestion
    assert off_centre.capability.cpk < 1.33 < off_centre.capability.cp
    wide = told(of(SLOW_NOISE, ("noise", {"sd_um": 3.0, "rate_per_s": 0.001}), TOLERANCE))["low-capability"]
    assert wide.evidence["best_cp"] < 1.33
    assert "centre" not in wide.suggestion
    assert "T_Φ" not in wide.suggestion
    assert "low-capability" not in told(of(SLOW_NOISE, TOLERANCE))


def test_parts_without_any_spread_have_sizes_and_no_capability():
    summary = of(LINEAR, TOLERANCE)
    assert summary.sizes.sd_um == pytest.approx(0.0, abs=1e-9)
    assert summary.capability is None
    assert summary.sizes.mean_um == pytest.approx(0.0, abs=1e-6)
    assert summary.findings == ()


def test_progress_is_told_over_all_batches():
    said = []
    wearing = changed(SLOW_NOISE, ("grinding.probe_wear_um_per_part", 0.01), ("run.parts", 300))
    gauging_summary(gauging_model(checked_model_file(wearing)), progress=lambda *one: said.append(one))
    # 7 batches of 300
    assert {(of, what) for _, of, what in said if what == "sizes"} == {(2100, "sizes")}
    sizes = [done for done, _, what in said if what == "sizes"]
    assert sizes == sorted(sizes)
    assert sizes[-1] == 2100
    assert {what for _, _, what in said} == {"sizes", "settings"}


@pytest.mark.parametrize(("filter_s", "delay_s", "lag_s"), [(150.0, 0.02, 0.5), (0.15, 20.0, 0.5), (0.15, 0.02, 500.0)])
def test_formulas_of_gauges_that_are_far_too_slow_have_numbers(filter_s, delay_s, lag_s):
    # no file may say so; a fit or a caller may
    slow = GaugedGrinding(
        LinearGauge(-0.02, 5.0, filter_s),
        Grinding(120.0, (Stage(20.0, 25.0), Stage(4.0, 0.0)), 8.0, feed_sd=0.06, lag_s=lag_s),
        Relay(delay_s),
        noise=Noise(0.4, 2.0),
    )
    found = sizes_by_formula(slow)
    assert np.isfinite([found.mean_um, found.sd_um, found.curvature_um]).all()


def test_a_correction_is_told_beside_what_the_same_thresholds_give_without_it():
    worn = changed(
        LINEAR,
        ("noise", {"sd_um": 0.1, "rate_per_s": 0.2}),
        ("grinding.probe_wear_um_per_part", 0.02),
        ("run.parts", 60),
    )
    plain, followed = of(worn), of(worn, ("correction", {"share": 0.3, "gauge_sd_um": 0.1}))
    assert "uncorrected" not in {one.name for one in plain.settings}
    by_name = {one.name: one for one in followed.settings}
    without, present = by_name["uncorrected"], by_name["present"]
    # its parts are those of the file without the section: 60 · 0.02 / 2 off on average
    assert without.bias_um == pytest.approx(plain.sizes.mean_um, abs=4 * without.bias_error_um)
    assert without.bias_um == pytest.approx(0.59, abs=0.05)
    # after 60 parts it has come to 0.02/0.3 from 0 with 0.7^n
    assert present.bias_um == pytest.approx(0.02 / 0.3 * (1.0 - (1.0 - 0.7**60) / 60 / 0.3), abs=0.02)
    assert followed.formula_holds
    # the parts are centred by what follows them, no threshold has to be
    assert "centred" not in by_name
    best = by_name["best-filter-centred"]
    # 2 µm/s; a voltage is told to the digit that moves a size by half of what the mean is known to
    eq_23_v = followed.gauge.bias_v + followed.gauge.gain_v_per_um * 2.0 * best.time_constant_s
    assert best.threshold_v == pytest.approx(eq_23_v, abs=1e-4)
    assert len(followed.sizes.size_um) % 60 == 0


def test_of_a_correction_that_follows_too_slowly_a_larger_share_is_advised():
    worn = changed(LINEAR, ("grinding.probe_wear_um_per_part", 0.05), ("run.parts", 60), TOLERANCE)
    off = told(of(worn, ("correction", {"share": 0.02})))["sizes-off-what-is-wanted"]
    # no threshold was looked for, so that none can be said not to be there
    assert off.evidence["centred_v"] is None
    assert "larger share" in off.suggestion
    assert "no last threshold" not in off.suggestion
