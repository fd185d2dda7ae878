"""A gauging model runs: what is recorded of parts, where thresholds come from, what the whole chain adds to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from selector.errors import ModelFileError, OptionError
from selector.physics.gauging.gauging_model import gauging_model, model_findings
from selector.physics.gauging.model_file import checked_model_file, read_model_file
from selector.physics.gauging.transducer import threshold_v
from selector.physics.model_text import plain_values
from tests.physics.gauging.test_model_file import LINEAR, changed

FIXTURES = Path(__file__).resolve().parents[3] / "fixtures" / "gauging"
NAMES = sorted(path.stem for path in FIXTURES.glob("*.toml"))
SET = plain_values(read_model_file(FIXTURES / "grind-to-size.toml"))
CHAIN = changed(SET, ("thresholds", ...))
QUIET = changed(
    CHAIN, ("noise", ...), ("run", {"waveform_s": 0.2}), ("grinding.feed_sd", 0.0), ("grinding.allowance_sd_um", 0.0)
)


def model(values, *changes):
    return gauging_model(checked_model_file(changed(values, *changes)))


def course(recording, run, name):
    return recording.values(run, [name])[:, 0]


def found(built):
    return {one.id: one for one in model_findings(built)}


@pytest.mark.parametrize("name", NAMES)
def test_examples_run_and_tell_what_they_are_made_to_show(name):
    built = gauging_model(read_model_file(FIXTURES / f"{name}.toml"))
    simulation = built.simulation()
    assert simulation.recording.runs == tuple(run or "simulation" for run in built.runs)
    assert simulation.sizes.tripped.all()
    assert not simulation.sizes.at_once.any()
    parts = [run for run in built.runs if run != "waveform"]
    assert len(parts) == min(built.file.run.parts, 50)
    told = {one.id for one in simulation.findings}
    assert "unlikely-value" not in told
    assert (
        told
        == {"linear": set(), "grind-to-size": {"allowance-beyond-reach"}, "interrupted": set(), "wear": set()}[name]
    )


@pytest.mark.parametrize("name", NAMES)
def test_what_is_recorded_of_a_part(name):
    built = gauging_model(read_model_file(FIXTURES / f"{name}.toml"))
    recording = built.simulation(run="part 1").recording
    for run in ("part 1", "part 7")[: built.file.run.parts]:
        values = recording.values(run, ["allowance", "gauge", "measured", "feed", "stage"])
        assert np.isfinite(values).all()
        stages = len(built.file.grinding.stages)
        steps = course(recording, run, "stage")
        assert list(dict.fromkeys(steps)) == [*range(1, stages + 1), 0]
        assert ((course(recording, run, "feed") == 0.0) == (steps == 0)).all()
        # springs relax for 7 lags after the stop: e^(−7) of what they hold, under 3 µm
        end = course(recording, run, "allowance")[-1]
        assert end == pytest.approx(recording.provenance["runs"][run]["size_um"], abs=3e-3)
        assert np.diff(course(recording, run, "allowance")).max() <= 0.0
    feed = built.file.grinding.stages[-1].feed_um_per_s
    last = course(recording, "part 1", "feed")[course(recording, "part 1", "stage") == stages].mean()
    # mm/min; feeds differ by up to 5 % from part to part, three times that is far out
    assert last * 1000.0 / 60.0 == pytest.approx(feed, rel=0.15)


def test_the_size_that_the_gauge_shows_belongs_to_its_voltage():
    built = model(CHAIN, ("run", {"parts": 1}))
    recording = built.simulation(run="r").recording
    shown, voltage = course(recording, "r", "measured"), course(recording, "r", "gauge")
    least, most = built.characteristic.monotone_um
    within = (shown > least + 1e-6) & (shown < most - 1e-6)
    # the inverse is bisected to 2^−52 of a piece of some µm
    np.testing.assert_allclose(built.characteristic.voltage_at(shown[within]), voltage[within], atol=1e-9)
    # the part begins beyond reach, where the gauge shows the end of it
    assert shown[0] == pytest.approx(most)
    assert 0.3 < within.mean() < 1.0


def test_without_noise_a_part_is_to_size_and_the_whole_chain_agrees():
    volts = found(model(QUIET))["ripple-behind-filter"].evidence["clear_v"]
    thresholds = ("thresholds", {"volts": [model(QUIET).setup.thresholds_v[0], volts]})
    built = model(QUIET, ("transducer.relay", {"delay_s": 0.01}), thresholds)
    simulation = built.simulation()
    # what is left is the curvature of the characteristic over a·T_Φ, as GaugedGrinding has it: some hundredths of a µm
    assert simulation.sizes.size_um[0] == pytest.approx(0.0, abs=0.1)
    (part,), wave = simulation.courses.values(), simulation.waveform
    assert wave.time_s[-1] == pytest.approx(part.duration_s)
    assert wave.time_s[-1] - wave.time_s[0] == pytest.approx(0.2, abs=1e-9)
    difference_um = (
        wave.smoothed_v - np.interp(wave.time_s, part.time_s, part.voltage_v)
    ) / built.setup.gauge.gain_v_per_um
    # the ripple of ±0.8 µm is over after one swing of 0.01 s, and the quasi-steady course is its mean: the swing
    # follows some milliseconds late, at 5 µm/s some hundredths of a µm
    swings = difference_um[1:].reshape(20, 200).mean(axis=1)
    assert np.abs(difference_um).max() > 0.5
    assert np.abs(swings).max() < 0.03


def test_the_relay_trips_on_the_peaks_of_the_ripple_and_a_threshold_that_knows_takes_them_out():
    quiet = (("transducer.relay", {"delay_s": 0.01}), ("run", {}))
    early = model(QUIET, *quiet)
    told = found(early)["ripple-behind-filter"]
    size_um = early.simulation().sizes.size_um[0]
    # the peaks change by less than a hundredth over a size of a µm; the curve moves the mean by some hundredths of one
    assert size_um == pytest.approx(told.evidence["early_um"], abs=0.1)
    assert 0.5 < size_um < 1.0
    volts = [early.setup.thresholds_v[0], told.evidence["clear_v"]]
    clear = model(QUIET, *quiet, ("thresholds", {"volts": volts}))
    assert clear.simulation().sizes.size_um[0] == pytest.approx(0.0, abs=0.1)
    assert "ripple-behind-filter" not in found(clear)
    # the peaks of the whole chain are at the threshold when the relay acts, one delay before the feed stands
    whole = model(QUIET, ("transducer.relay", {"delay_s": 0.0})).simulation()
    last = whole.waveform.time_s > whole.waveform.time_s[-1] - 0.01
    peak_v = whole.waveform.smoothed_v[last].max()
    # half a mV is 0.03 µm: what the allowance falls by in half a swing, and the swing's own lag
    assert peak_v == pytest.approx(early.setup.thresholds_v[-1], abs=1e-3)


def test_the_run_of_the_waveform_has_the_chain_and_the_others_have_not():
    recording = model(QUIET).simulation().recording
    assert recording.runs == ("part 1", "waveform")
    chain = ["current", "probe", "contact", "generator"]
    assert np.isnan(recording.values("part 1", chain)).all()
    assert np.isfinite(recording.values("waveform", list(recording.names))).all()
    assert recording.time_s("waveform")[0] == 0.0
    assert course(recording, "waveform", "contact").max() > 1.0
    assert course(recording, "waveform", "contact").min() == 0.0
    assert set(course(recording, "waveform", "stage")) == {2.0}
    assert recording.provenance["runs"]["waveform"]["of"] == "part 1"


def test_the_same_seed_makes_the_same_parts_however_many():
    few, many = model(CHAIN, ("run", {"parts": 2})), model(CHAIN, ("run", {"parts": 60}))
    first, again, other = few.simulation(), many.simulation(), few.simulation(seed=5)
    for run in ("part 1", "part 2"):
        for name in ("allowance", "gauge", "measured", "feed", "stage"):
            np.testing.assert_array_equal(course(first.recording, run, name), course(again.recording, run, name))
    assert len(again.recording.runs) == 50
    assert len(again.sizes.size_um) == 60
    np.testing.assert_array_equal(first.sizes.size_um, again.sizes.size_um[:2])
    assert (other.sizes.size_um != first.sizes.size_um).all()
    assert other.recording.provenance["simulated"]["seed"] == 5


def test_thresholds_are_those_of_eq_23_on_the_line_of_each_stage():
    built = model(CHAIN)
    gauges = built.stage_gauges
    assert built.setup.thresholds_v == (
        threshold_v(gauges[0], 30.0, 25.0, 0.01),
        threshold_v(gauges[1], 0.0, 5.0, 0.01 + 0.4),
    )
    assert gauges[0] != gauges[1]
    assert gauges[1].gain_v_per_um == pytest.approx(float(built.characteristic.slope_at(0.0)))
    line = model(LINEAR, ("grinding.wheel_wear", 0.25), ("relay.delay_s", 0.02))
    # a = feed/(1 + wear); no lag
    assert line.setup.thresholds_v == pytest.approx(
        (0.8 - 0.005 * (10.0 + 8.0 * 0.12), 0.8 - 0.005 * (0.0 + 1.6 * 0.12)), rel=1e-12
    )
    assert model(LINEAR, ("thresholds.volts", [0.7, 0.79])).setup.thresholds_v == (0.7, 0.79)


@pytest.mark.parametrize(
    ("change", "key", "said"),
    [
        (("thresholds.volts", [1.6, 2.9]), "thresholds.volts[2]", "the gauge gives no other"),
        (("thresholds.volts", [0.1, 2.1]), "thresholds.volts[1]", "the gauge gives no other"),
        (("grinding.stages.1.until_um", -60.0), "grinding.stages[2].until_um", "rest_gap_m"),
        (("grinding.stages.0.until_um", 140.0), "grinding.stages[1].until_um", "meets the workpiece"),
        (("transducer.electromagnet.gap_m", 2e-4), "transducer.electromagnet.gap_m", "off the core"),
        (("transducer.generator.gap_m", 1e-4), "transducer.generator.gap_m", "off the core"),
        (("bounds", {"nothing": [0.0, 1.0]}), "bounds.nothing", "one of"),
        (("bounds", {"noise.sd_um": [0.6, 1.0]}), "bounds.noise.sd_um", "around the value"),
    ],
)
def test_what_the_gauge_cannot_do_is_refused_with_its_key(change, key, said):
    with pytest.raises(ModelFileError, match=said) as caught:
        model(CHAIN, change)
    assert caught.value.where == f"key {key}"


def test_parameters_are_named_by_their_keys_and_can_be_set():
    built = model(CHAIN, ("bounds", {"noise.sd_um": [0.1, 0.9]}))
    named = built.parameters
    assert named["transducer.contact.stiffness"].unit == "N/m^p"
    assert named["grinding.stages.2.feed_um_per_s"].value == 5.0
    assert (named["noise.sd_um"].low, named["noise.sd_um"].high) == (0.1, 0.9)
    assert named["grinding.wheel_wear"].value == 0.0
    assert "surface.runout_um" not in named
    assert all(one.low <= one.value <= one.high and one.low < one.high for one in named.values())
    assert not {name for name, one in named.items() if not one.unit}
    other = built.with_parameters({"grinding.stages.2.feed_um_per_s": 4.0, "grinding.wheel_wear": 0.1})
    assert other.values.grinding.stages[1].feed_um_per_s == 4.0
    assert other.setup.thresholds_v != built.setup.thresholds_v
    assert other.characteristic is built.characteristic
    with pytest.raises(OptionError, match=r"0\.1 to 0\.9"):
        built.with_parameters({"noise.sd_um": 1.0})
    with pytest.raises(OptionError, match="no parameter"):
        built.with_parameters({"noise": 1.0})
    with pytest.raises(ModelFileError, match="above 0"):
        built.with_parameters({"grinding.stages.1.feed_um_per_s": 0.0})


def test_names_of_a_single_run_are_free():
    built = model(LINEAR)
    assert built.runs == ("",)
    assert built.simulation(run="r7").recording.runs == ("r7",)
    assert [channel.name for channel in built.outputs] == list(built.simulation().recording.names)


def test_odd_thresholds_samples_and_numbers_are_told():
    assert found(model(LINEAR)) == {}
    # what thresholds of the file make of the sizes is told of the sizes
    assert found(model(LINEAR, ("thresholds.volts", [0.745, 0.82]))) == {}
    slow = found(model(LINEAR, ("linear.time_constant_s", 7.0)))["slow-for-the-stage"]
    assert slow.evidence["stage_s"] < slow.evidence["time_s"] == 7.0
    coarse = found(model(LINEAR, ("run.period_s", 0.05)))["coarse-period"]
    assert coarse.evidence == {"period_s": 0.05, "advised_s": pytest.approx(0.02)}
    assert "run.period_s = 0.02 " in coarse.suggestion
    surface = {"workpiece_rpm": 300.0, "grooves": 4, "groove_share": 0.1, "groove_depth_um": 5.0}
    grooved = found(model(LINEAR, ("run.period_s", 0.02), ("surface", surface)))["coarse-period"]
    assert "4 grooves" in grooved.statement
    odd = found(model(LINEAR, ("grinding.stages.1.feed_um_per_s", 0.2)))["unlikely-value"]
    assert "mm/min" in odd.suggestion


def test_the_end_of_reach_is_told():
    near = found(model(CHAIN, ("grinding.stages.1.until_um", -32.9)))["wanted-size-at-the-end-of-reach"]
    assert "rest_gap_m" in near.suggestion
    assert "wanted-size-at-the-end-of-reach" not in found(model(CHAIN))
    assert "allowance-beyond-reach" not in found(model(CHAIN, ("grinding.allowance_um", 100.0)))


@pytest.mark.parametrize(
    ("values", "change", "meant"),
    [
        (LINEAR, ("linear.gain_v_per_um", -0.00002), "-0.02"),
        (LINEAR, ("tolerance", {"lower_um": -0.0025, "upper_um": 2.5}), "-2.5"),
        (LINEAR, ("grinding.stages.1.feed_um_per_s", 0.24), "4"),
        (LINEAR, ("noise.sd_um", 400.0), "0.4"),
    ],
)
def test_slips_of_units_are_told_with_what_was_perhaps_meant(values, change, meant):
    assert f"= {meant} if" in found(model(values, change))["unlikely-value"].suggestion
