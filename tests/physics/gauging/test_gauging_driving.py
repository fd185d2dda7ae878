"""A gauge that is driven by recordings: by a recorded allowance, or by the feed alone, at the time stamps of both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from selector.errors import InputError, OptionError
from selector.physics.channel_differences import channel_differences
from selector.physics.gauging.gauging_driving import driven_runs
from selector.physics.gauging.gauging_model import gauging_model
from selector.physics.gauging.model_file import checked_model_file
from selector.physics.gauging.transducer import Surface, smoothed_surface
from selector.recording import Channel, Recording
from tests.physics.gauging.test_model_file import LINEAR, changed

GAIN = LINEAR["linear"]["gain_v_per_um"]


def model(*changes):
    return gauging_model(checked_model_file(changed(LINEAR, *changes)))


def table(time_s, **columns):
    return pd.DataFrame(columns, index=pd.Index(np.asarray(time_s, dtype=float), name="time_s"))


def kept(recording, names):
    """A recording with these of its channels, called as the values say."""
    channels = tuple(replace(recording.channel(old), name=new) for old, new in names.items())
    tables = {
        run: table(recording.time_s(run), **{new: recording.values(run, [old])[:, 0] for old, new in names.items()})
        for run in recording.runs
    }
    return Recording.from_runs(tables, channels)


def size(name="allowance"):
    return Channel(name, "size", "um")


def test_a_straight_course_gives_the_voltage_of_eq_21_and_its_transient():
    time_s = np.arange(0.0, 3.0, 0.05)
    driven = driven_runs(model(), Recording.from_runs({"r": table(time_s, allowance=50.0 - 4.0 * time_s)}, [size()]))
    # T·S' + S = K·x + bias from rest: S = K·(x + a·T·(1 − e^(−t/T))) + bias
    late_um = 4.0 * 0.1 * (1.0 - np.exp(-time_s / 0.1))
    expected = GAIN * (50.0 - 4.0 * time_s + late_um) + 0.8
    # exact for straight inputs, so that nothing but rounding is left
    np.testing.assert_allclose(driven.recording.values("r", ["gauge"])[:, 0], expected, atol=1e-13)
    measured = driven.recording.values("r", ["measured"])[:, 0]
    np.testing.assert_allclose(measured, 50.0 - 4.0 * time_s + late_um, atol=1e-10)
    assert driven.inputs == ("allowance",)


def test_driven_by_its_own_allowance_it_shows_the_same():
    gauge = model(("run.period_s", 0.01))
    own = gauge.simulation(run="r").recording
    driven = driven_runs(gauge, own)
    by_name = {one.channel: one for one in channel_differences(driven.recording, own, driven.inputs)}
    # the feed changes within a sample, whose allowance is taken as straight: by at most 8 µm/s · 0.01 s / 4 in the
    # middle of it, of which the filter of 0.1 s lets a tenth through: 0.002 µm · 5 mV/µm
    assert by_name["gauge"].largest < 0.002 * abs(GAIN)
    assert by_name["measured"].largest < 0.002
    # the stage follows the command, of which the recorded samples stand up to one period later
    stages = by_name["stage"]
    assert np.count_nonzero(stages.simulated != stages.recorded) <= 2
    assert set(by_name) == {"gauge", "measured", "stage"}


def test_the_feed_alone_drives_with_the_lag_and_wear_of_the_file():
    gauge = model(("run.period_s", 0.01), ("grinding.lag_s", 0.3), ("grinding.wheel_wear", 0.1))
    own = gauge.simulation(run="r").recording
    driven = driven_runs(gauge, kept(own, {"feed": "fx", "gauge": "u"}))
    assert driven.inputs == ("fx",)
    assert driven.matched == {"feed": "fx", "gauge": "u"}
    assert driven.recording.names == ("allowance", "u", "measured", "stage", "fx")
    error_um = driven.recording.values("r", ["allowance"]) - own.values("r", ["allowance"])
    # each feed is held to the end of its sample: two changes, of 8 and 2 µm/s for up to 0.01 s
    assert np.abs(error_um).max() < 0.1
    assert np.abs(error_um).max() > 0.0


def test_names_of_the_recording_are_kept_and_taken_ones_marked():
    time_s = np.arange(0.0, 1.0, 0.05)
    recording = Recording.from_runs(
        {"r": table(time_s, d=20.0 - time_s, u=0.7 + 0 * time_s, gauge=0 * time_s)},
        [size("d"), Channel("u", "voltage", "V", "rack 3"), Channel("gauge", "state", "1")],
    )
    driven = driven_runs(model(), recording)
    assert driven.recording.names == ("d", "u", "measured", "stage")
    assert driven.recording.channel("u").place == "rack 3"
    (one,) = channel_differences(driven.recording, recording, driven.inputs)
    assert one.channel == "u"
    free = driven_runs(model(), kept(recording, {"d": "d", "gauge": "gauge"}))
    assert free.recording.names == ("d", "gauge (simulated)", "measured", "stage")
    assert "output-not-recorded" in {one.id for one in free.findings}


def test_several_sizes_are_undecided_unless_the_file_says():
    time_s = np.arange(0.0, 1.0, 0.05)
    two = Recording.from_runs({"r": table(time_s, a=20.0 - time_s, b=20.0 - time_s)}, [size("a"), size("b")])
    with pytest.raises(OptionError, match='allowance = "a" under') as caught:
        driven_runs(model(), two)
    assert "a (size, um), b (size, um)" in caught.value.found
    said = driven_runs(model(("recorded.allowance", "b")), two)
    assert said.matched == {"allowance": "b", "measured": "a"}


@pytest.mark.parametrize(
    ("recorded", "said"),
    [
        ({"allowance": "nothing"}, "no channel 'nothing'"),
        ({"allowance": "a", "measured": "a"}, "twice"),
        ({"gauge": "a"}, "role size"),
    ],
)
def test_names_that_cannot_be_are_refused_with_their_key(recorded, said):
    one = Recording.from_runs({"r": table([0, 1], a=[20.0, 19.0])}, [size("a")])
    with pytest.raises(OptionError, match=said) as caught:
        driven_runs(model(("recorded", recorded)), one)
    assert caught.value.where == f"key recorded.{list(recorded)[-1]}"


def test_nothing_that_drives_names_what_there_is():
    voltage = Recording.from_runs({"r": table([0, 1], u=[0.5, 0.6])}, [Channel("u", "voltage", "V")])
    with pytest.raises(OptionError, match=r"u \(voltage, V\)"):
        driven_runs(model(), voltage)
    shown = Recording.from_runs({"r": table([0, 1], measured=[20.0, 19.0])}, [size("measured")])
    with pytest.raises(OptionError, match='allowance = "measured" under'):
        driven_runs(model(), shown)


def test_gaps_and_stray_clocks_are_told_and_gone_over_straight():
    time_s = np.arange(0.0, 2.0, 0.05)
    course = 20.0 - 4.0 * time_s
    whole = driven_runs(model(), Recording.from_runs({"r": table(time_s, allowance=course)}, [size()]))
    holed = course.copy()
    holed[10:13] = np.nan
    lost = driven_runs(model(), Recording.from_runs({"r": table(time_s, allowance=holed)}, [size()]))
    np.testing.assert_allclose(lost.recording.frame.to_numpy(), whole.recording.frame.to_numpy(), atol=1e-12)
    (gap,) = (one for one in lost.findings if one.id == "recorded-gap")
    assert gap.evidence == {"missing": 3, "of": 40}
    leap = np.r_[time_s[:20], time_s[20:] + 1.0]
    told = driven_runs(model(), Recording.from_runs({"r": table(leap, allowance=course)}, [size()])).findings
    (gap,) = (one for one in told if one.id == "recorded-gap")
    assert gap.evidence["longest_s"] == pytest.approx(1.05)
    stray = time_s + np.r_[0.0, np.random.default_rng(0).uniform(-0.005, 0.005, 38), 0.0]
    jittered = driven_runs(model(), Recording.from_runs({"r": table(stray, allowance=20.0 - 4.0 * stray)}, [size()]))
    assert [one.id for one in jittered.findings if one.id.startswith("recorded")] == ["recorded-clock-jitter"]
    late_um = 4.0 * 0.1 * (1.0 - np.exp(-stray / 0.1))
    # straight between points 17 ms apart of an exponential of 0.1 s: (0.017/0.1)²/8 of 0.4 µm
    shown = jittered.recording.values("r", ["measured"])[:, 0]
    assert np.abs(shown - (20.0 - 4.0 * stray + late_um)).max() < 1.4e-3
    assert "recorded-clock-jitter" not in {one.id for one in whole.findings}


def test_noise_is_drawn_only_with_a_seed_and_has_the_spread_of_eq_25():
    gauge = model(("noise", {"sd_um": 0.5, "rate_per_s": 20.0}))
    time_s = np.arange(0.0, 2000.0, 0.05)
    recording = Recording.from_runs({"r": table(time_s, allowance=10.0 + 0 * time_s)}, [size()])
    still, drawn, again = (
        driven_runs(gauge, recording, seed=seed).recording.values("r", ["measured"])[:, 0] for seed in (None, 3, 3)
    )
    assert np.ptp(still) < 1e-9
    np.testing.assert_array_equal(drawn, again)
    # 2000 s hold some 2000/(0.1 + 1/20)/2 independent values: 1 % is 1.2 standard errors, 4 % five
    assert np.std(drawn) == pytest.approx(0.5 / np.sqrt(1.0 + 20.0 * 0.1), rel=0.04)


def test_grooves_lower_what_is_shown_by_their_mean():
    surface = {"workpiece_rpm": 120.0, "grooves": 3, "groove_share": 0.2, "groove_depth_um": 10.0}
    time_s = np.arange(0.0, 5.0, 0.05)
    recording = Recording.from_runs({"r": table(time_s, allowance=10.0 + 0 * time_s)}, [size()])
    shown = driven_runs(model(("surface", surface)), recording).recording.values("r", ["measured"])[40:, 0]
    # 60 samples of 0.05 s are 6 whole turns; the share of the grooves is exact, and the transient of 2 s ago is e^(−20)
    assert shown[:60].mean() == pytest.approx(10.0 - 2.0, abs=1e-8)
    settled, _ = smoothed_surface(Surface(**surface), 0.1, time_s[40:] * 2.0)
    # an edge at a sample is spread over half a step of 5 ms to both sides: 10 µm · (5 ms / 0.1 s) / 4
    np.testing.assert_allclose(shown - 10.0, settled, atol=0.13)
    assert np.ptp(settled) > 1.5


@pytest.mark.parametrize("values", [[np.nan, np.nan, 3.0], [1.0, 2.0, 1e9]])
def test_runs_without_values_and_values_without_sense_are_refused_with_their_place(values):
    recording = Recording.from_runs({"r7": table([0, 1, 2], allowance=values)}, [size()])
    with pytest.raises(InputError) as caught:
        driven_runs(model(), recording)
    assert "run r7" in caught.value.where
    assert "channel allowance" in caught.value.where
