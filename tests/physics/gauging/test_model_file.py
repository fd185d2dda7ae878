"""Gauging model files: what they say, and that every mistake is refused with its key."""

from __future__ import annotations

import copy
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.errors import ModelFileError
from selector.physics.gauging.model_file import (
    checked_model_file,
    file_parts,
    finest_s,
    parsed_model_file,
    planned_s,
    sampling_s,
)
from selector.physics.model_text import plain_values

LINEAR = {
    "model": {"kind": "gauging", "name": "line"},
    "linear": {"gain_v_per_um": -0.005, "bias_v": 0.8, "time_constant_s": 0.1},
    "grinding": {
        "allowance_um": 60.0,
        "stages": [{"feed_um_per_s": 10.0, "until_um": 10.0}, {"feed_um_per_s": 2.0, "until_um": 0.0}],
    },
}
PARTS = {
    "electromagnet": {
        "voltage_v": 30.0, "frequency_hz": 50.0, "resistance_ohm": 60.0, "inductance_h": 0.1, "force_n_per_a2": 40.0,
    },
    "probe": {"mass_kg": 0.02, "stiffness_n_per_m": 12000.0, "damping_ns_per_m": 2.0},
    "contact": {"stiffness": 1e9},
    "generator": {"turns": 1000.0, "flux_wb": 1e-5, "gap_m": 1e-3},
    "smoothing": {"time_constant_s": 0.1},
}  # fmt: skip


def changed(values, *changes):
    """Plain values with some keys set, or left out where the new value is ``...``."""
    new = copy.deepcopy(values)
    for key, value in changes:
        inside = new
        *path, last = [int(part) if part.isdigit() else part for part in key.split(".")]
        for part in path:
            inside = inside[part] if isinstance(part, int) else inside.setdefault(part, {})
        if value is ...:
            del inside[last]
        else:
            inside[last] = value
    return new


TRANSDUCER = changed(LINEAR, ("linear", ...), ("transducer", PARTS))


def test_sections_are_values_with_the_defaults_of_their_dataclasses():
    parts = file_parts(checked_model_file(LINEAR))
    assert parts.linear.gain_v_per_um == -0.005
    assert parts.transducer is None
    assert [stage.until_um for stage in parts.grinding.stages] == [10.0, 0.0]
    assert (parts.relay.delay_s, parts.surface.grooves, parts.noise.sd_um, parts.tolerance) == (0.0, 0, 0.0, None)
    whole = file_parts(checked_model_file(changed(TRANSDUCER, ("transducer.relay", {"delay_s": 0.01}))))
    assert whole.linear is None
    assert whole.transducer.contact.exponent == 1.5
    assert whole.relay.delay_s == 0.01
    assert whole.filter_s == 0.1


def test_plain_values_make_an_equal_file():
    file = checked_model_file(
        changed(TRANSDUCER, ("thresholds.volts", [0.5, 0.6]), ("bounds", {"noise.sd_um": [0, 1]}))
    )
    assert checked_model_file(plain_values(file)) == file


MISTAKES = {
    "no gauge": (LINEAR, ("linear", ...), "linear", "one gauge"),
    "two gauges": (LINEAR, ("transducer", PARTS), "linear", "one gauge"),
    "relay of a transducer": (TRANSDUCER, ("relay", {"delay_s": 0.1}), "relay", r"transducer\.relay"),
    "waveform of a line": (LINEAR, ("run.waveform_s", 0.1), "run.waveform_s", "parts swing"),
    "feed 0": (LINEAR, ("grinding.stages.1.feed_um_per_s", 0.0), "grinding.stages[2].feed_um_per_s", "above 0"),
    "filter 0": (LINEAR, ("linear.time_constant_s", 0.0), "linear.time_constant_s", "above 0"),
    "filter of a transducer 0": (
        TRANSDUCER, ("transducer.smoothing.time_constant_s", 0.0), "transducer.smoothing.time_constant_s", "above 0",
    ),
    "noise below 0": (LINEAR, ("noise.sd_um", -1.0), "noise.sd_um", "0 or more"),
    "relay below 0": (LINEAR, ("relay.delay_s", -1.0), "relay.delay_s", "0 or more"),
    "tolerance exchanged": (
        LINEAR, ("tolerance", {"lower_um": 2.0, "upper_um": -2.0}), "tolerance.lower_um", "lower and an upper",
    ),
    "volts of another number": (LINEAR, ("thresholds.volts", [0.5]), "thresholds.volts", "each of the stages"),
    "volts that fall": (LINEAR, ("thresholds.volts", [0.8, 0.7]), "thresholds.volts", "rise"),
    "gain above 0": (LINEAR, ("linear.gain_v_per_um", 0.005), "linear.gain_v_per_um", "below 0"),
    "gain 0": (LINEAR, ("linear.gain_v_per_um", 0.0), "linear.gain_v_per_um", "below 0"),
    "stages exchanged": (LINEAR, ("grinding.stages.0.until_um", -5.0), "grinding.stages", "less allowance"),
    "no stage": (LINEAR, ("grinding.stages", []), "grinding.stages", "at least one stage"),
    "too many stages": (
        LINEAR,
        ("grinding.stages", [{"feed_um_per_s": 1.0, "until_um": 50.0 - i} for i in range(21)]),
        "grinding.stages", "at most 20",
    ),
    "grooves that stand": (
        LINEAR,
        ("surface", {"grooves": 3, "groove_share": 0.1, "groove_depth_um": 100.0}),
        "surface.workpiece_rpm", "speed",
    ),
    "half a groove": (LINEAR, ("surface.grooves", 0.5), "surface.grooves", "whole number"),
    "wheel that wears more than it removes": (LINEAR, ("grinding.wheel_wear", 1.0), "grinding.wheel_wear", "below 1"),
    "no part": (LINEAR, ("run.parts", 0), "run.parts", "greater than or equal to 1"),
    "too many samples": (LINEAR, ("run.period_s", 1e-6), "run.period_s", "at most 2000000"),
    "too slow a feed": (
        changed(LINEAR, ("run.period_s", 0.001)),
        ("grinding.stages.1.feed_um_per_s", 1e-5), "run.period_s", "at most 2000000",
    ),
    "one sample": (LINEAR, ("run.period_s", 10.0), "run.period_s", "shorter than a part"),
    "waveform too long": (TRANSDUCER, ("run.waveform_s", 11.0), "run.waveform_s", "less than or equal to 10"),
    "bounds exchanged": (LINEAR, ("bounds", {"noise.sd_um": [1.0, 0.0]}), 'bounds."noise.sd_um"', "lower and a higher"),
    "unknown key": (LINEAR, ("noise.sd", 1.0), "noise.sd", "'sd_um' perhaps"),
    "missing key": (LINEAR, ("linear.bias_v", ...), "linear.bias_v", "bias_v"),
    "a number in a text": (LINEAR, ("noise.sd_um", "1 µm"), "noise.sd_um", "number"),
    "not a number": (LINEAR, ("noise.sd_um", math.nan), "noise.sd_um", "finite"),
    "a share beyond all": (LINEAR, ("grinding.feed_sd", 5.0), "grinding.feed_sd", r"0\.25"),
    "an allowance in mm": (LINEAR, ("grinding.allowance_um", 0.06), "grinding.stages", "less allowance"),
    "a wheel that is never dressed": (
        changed(LINEAR, ("grinding.wheel_wear", 0.2), ("grinding.wear_growth_per_part", 0.05)),
        ("run.parts", 40), "grinding.wear_growth_per_part", "dressed",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_every_mistake_is_refused_with_its_key(name):
    values, change, key, said = MISTAKES[name]
    with pytest.raises(ModelFileError, match=said) as caught:
        checked_model_file(changed(values, change))
    assert caught.value.where == f"model file, key {key}"


def test_a_model_of_another_physics_is_sent_to_its_command():
    with pytest.raises(ModelFileError, match="simulate drive"):
        parsed_model_file('[model]\nkind = "drive"\nname = "x"\n')


@given(
    filter_s=st.floats(5e-3, 1.0), feed=st.floats(1.0, 100.0), rpm=st.floats(1.0, 1000.0), grooves=st.integers(0, 50)
)
def test_left_out_the_period_shows_filter_and_grooves_and_is_not_too_short(filter_s, feed, rpm, grooves):
    surface = {"workpiece_rpm": rpm, "runout_um": 1.0}
    if grooves:
        surface |= {"grooves": grooves, "groove_share": 0.1, "groove_depth_um": 5.0}
    stages = [{"feed_um_per_s": feed, "until_um": 0.0}]
    values = changed(LINEAR, ("linear.time_constant_s", filter_s), ("surface", surface), ("grinding.stages", stages))
    file = checked_model_file(values)
    parts = file_parts(file)
    samples = planned_s(parts) / sampling_s(file, parts)
    # rounding down to 1, 2, 5 makes up to 2.5 times as many
    assert 500 <= samples <= 2.5 * 20_000
    assert sampling_s(file, parts) <= finest_s(parts) or samples >= 20_000
