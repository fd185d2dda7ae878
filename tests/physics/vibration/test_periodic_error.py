"""Heights, wavelengths and kinds of the errors that a vibration leaves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.vibration.chains import in_range
from selector.physics.vibration.final_motion import FinalMotions, final_motions
from selector.physics.vibration.periodic_error import (
    Surface,
    error_kind,
    kind_heights,
    periodic_errors,
    published_height_um,
    split_frequency_hz,
    waves_per_revolution,
)
from selector.physics.vibration.structure import excitation
from tests.physics.vibration.small_lathe import CUTTING, FINALS, SOURCES, STRUCTURE

ROUNDING = 1e-12
"""A few products and powers of numbers of moderate size."""
PER_DEPTH = 10.0 * 300.0 * 0.2**0.75 * (math.pi * 60e-3 * 1200.0) ** -0.15
"""10·C_p·S^y·V^n·K_p of the cut in `small_lathe` [N/mm]."""


def motions(frequency_hz, tool_m, workpiece_m, source=None, mass_kg=(5.0, 20.0)) -> FinalMotions:
    motion = np.array([tool_m, workpiece_m], dtype=np.complex128)
    owner = np.zeros(len(frequency_hz), dtype=np.int64) if source is None else np.array(source)
    return FinalMotions(
        ("tool", "workpiece"),
        np.array(frequency_hz, dtype=np.float64),
        owner,
        motion,
        motion * np.array(mass_kg)[:, None],
        ("IK1", "IK2", "IK3"),
        np.ones(motion.shape, dtype=np.bool_),
    )


def test_height_is_that_of_the_law_of_the_force():
    # a straight line for x = 1: 100 N are 100/PER_DEPTH mm of depth, doubled, in µm
    assert published_height_um(100.0, CUTTING) == pytest.approx(2e3 * 100.0 / PER_DEPTH, rel=ROUNDING)
    bent = replace(CUTTING, depth_exponent=0.9)
    assert published_height_um(100.0, bent) == pytest.approx(2e3 * (100.0 / PER_DEPTH) ** (1 / 0.9), rel=ROUNDING)
    assert published_height_um(0.0, bent) == 0.0


@given(force=st.floats(1e-6, 1e6), x=st.floats(0.3, 2.0), feed=st.floats(0.01, 2.0))
def test_the_law_of_the_force_gives_the_force_back(force, x, feed):
    cut = replace(CUTTING, depth_exponent=x, feed_mm_per_rev=feed)
    depth_mm = published_height_um(force, cut) / 2e3
    per_depth = 10.0 * 300.0 * feed**0.75 * cut.speed_m_per_min**-0.15
    # 1e-11: the exponent multiplies what rounding left
    assert per_depth * depth_mm**x == pytest.approx(force, rel=1e-11)


def test_one_line_of_both_branches():
    (error,) = periodic_errors(motions([100.0], [3e-6j], [-1e-6]), CUTTING)
    square = (2 * math.pi * 100.0) ** 2
    assert error.amplitude_um == pytest.approx({"tool": 3.0, "workpiece": 1.0}, rel=ROUNDING)
    assert error.force_n == pytest.approx(
        {"tool": 5.0 * square * 3e-6, "workpiece": 20.0 * square * 1e-6}, rel=ROUNDING
    )
    assert error.height_um["tool"] == pytest.approx(2e3 * error.force_n["tool"] / PER_DEPTH, rel=ROUNDING)
    assert error.published_um == pytest.approx(error.height_um["tool"] + error.height_um["workpiece"], rel=ROUNDING)
    # 3i − (−1) has the amount √10
    assert error.kinematic_um == pytest.approx(2.0 * math.sqrt(10.0), rel=ROUNDING)
    assert error.sources == ("IK1",)


def test_a_rigid_motion_of_both_leaves_nothing_that_copies_but_a_published_height():
    (error,) = periodic_errors(motions([100.0], [2e-6], [2e-6]), CUTTING)
    assert error.kinematic_um == 0.0
    assert error.published_um > 1.0


def test_lines_at_one_frequency():
    together = periodic_errors(motions([100.0, 50.0, 100.0], [1e-6, 5e-6, 1e-6], [0, 0, 0], [0, 1, 0]), CUTTING)
    assert [error.frequency_hz for error in together] == [50.0, 100.0]
    # one source: the amplitudes add up
    assert together[1].amplitude_um["tool"] == pytest.approx(2.0, rel=ROUNDING)
    apart = periodic_errors(motions([100.0, 100.0 * (1 + 1e-13)], [1e-6, 1e-6], [0, 0], [0, 2]), CUTTING)
    # two sources: mean of |1 + e^{iφ}| over four shifts, and so of the force and of the kinematic height
    mean = (2.0 + 2.0 * math.sqrt(2.0)) / 4.0
    assert apart[0].sources == ("IK1", "IK3")
    assert apart[0].amplitude_um["tool"] == pytest.approx(mean, rel=ROUNDING)
    assert apart[0].force_n["tool"] == pytest.approx(5.0 * (200 * math.pi) ** 2 * mean * 1e-6, rel=ROUNDING)
    assert apart[0].kinematic_um == pytest.approx(2.0 * mean, rel=ROUNDING)
    assert len(periodic_errors(motions([100.0, 100.001], [1e-6, 1e-6], [0, 0], [0, 2]), CUTTING)) == 2


def test_lines_without_motion_leave_nothing():
    assert periodic_errors(motions([100.0], [0.0], [0.0]), CUTTING) == ()
    assert periodic_errors(motions([], [], []), CUTTING) == ()
    assert kind_heights((), CUTTING) == ()


@pytest.mark.parametrize(
    ("waves", "kind", "direction", "wavelength_mm"),
    [
        # a workpiece of 60 mm: 188.5 mm around
        (0.1, "waviness", "feed", 2.0),
        (0.4, "roughness", "feed", 0.5),
        (0.5, "runout", "cut", 376.99),
        (1.0, "runout", "cut", 188.496),
        (1.5, "lobing", "cut", 125.664),
        (2.0, "lobing", "cut", 94.248),
        (15.0, "lobing", "cut", 12.566),
        (15.1, "waviness", "cut", 12.483),
        (235.0, "waviness", "cut", 0.80211),
        (236.0, "roughness", "cut", 0.79871),
    ],
)
def test_kinds_by_wavelength(waves, kind, direction, wavelength_mm):
    found = error_kind(waves * 20.0, CUTTING, Surface())
    assert found[:2] == (kind, direction)
    # as many digits as are written down above
    assert found[2] == pytest.approx(wavelength_mm, rel=1e-4)


def test_wavelength_is_speed_over_frequency_and_the_split_is_where_it_is_the_cut_off():
    surface = Surface(roughness_below_mm=0.5)
    split = split_frequency_hz(CUTTING, surface)
    assert error_kind(split * (1 + 1e-8), CUTTING, surface)[0] == "roughness"
    assert error_kind(split, CUTTING, surface)[0] == "waviness"
    wavelength = error_kind(5000.0, CUTTING, surface)[2]
    assert wavelength == pytest.approx(CUTTING.speed_m_per_min / 60.0 * 1e3 / 5000.0, rel=ROUNDING)
    assert split * 0.5 == pytest.approx(CUTTING.speed_m_per_min / 60.0 * 1e3, rel=ROUNDING)


@pytest.mark.parametrize("waves", [0.5, 1.0, 1.5, 2.0, 15.0])
def test_rounding_of_a_speed_decides_no_kind(waves):
    kinds, directions = set(), set()
    for rpm in np.concatenate([np.arange(100.0, 3000.0, 7.0), np.arange(100.1, 3000.0, 13.3)]):
        kind, direction, _ = error_kind(waves * rpm / 60.0, replace(CUTTING, workpiece_rpm=rpm), Surface())
        kinds.add(kind)
        directions.add(direction)
    assert kinds == {"runout" if waves < 1.5 else "lobing"}
    assert directions == {"cut"}


@pytest.mark.parametrize("diameter_mm", [2.0, 3.3, 60.0, 247.9])
@pytest.mark.parametrize("cut_off_mm", [0.08, 0.25, 0.8, 2.5])
def test_what_the_high_chains_carry_is_roughness_along_the_cut_and_no_other_is(diameter_mm, cut_off_mm):
    surface = Surface(roughness_below_mm=cut_off_mm)
    for rpm in np.arange(100.0, 3000.0, 33.1):
        cut = replace(CUTTING, diameter_mm=diameter_mm, workpiece_rpm=rpm)
        split = split_frequency_hz(cut, surface)
        around_mm = math.pi * diameter_mm
        frequency = (
            rpm / 60.0 * np.array([0.3, 0.5, 1.5, 15.0, 15.1, around_mm / cut_off_mm, 1.01 * around_mm / cut_off_mm])
        )
        for one, high in zip(frequency, in_range("high", frequency, split), strict=True):
            kind, direction, _ = error_kind(one, cut, surface)
            assert (kind == "roughness" and direction == "cut") == high
        assert error_kind(split, cut, surface)[0] == ("waviness" if around_mm > 15.0 * cut_off_mm else "lobing")
        assert error_kind(15.0 * rpm / 60.0, cut, surface)[0] == "lobing"


def test_a_feed_of_the_cut_off_leaves_waviness_whatever_rounding_says():
    for rpm in np.arange(100.0, 3000.0, 7.3):
        for part in (0.25, 0.1, 0.3):
            cut = replace(CUTTING, workpiece_rpm=rpm, feed_mm_per_rev=0.8 * part)
            assert error_kind(part * rpm / 60.0, cut, Surface())[0] == "waviness"


@pytest.mark.parametrize("phases", [4, 60, 360])
def test_too_many_sources_at_one_frequency_have_the_expectation_over_drawn_phases(phases):
    n = 13
    many = motions([100.0] * n, [1e-6] * n, [0.0] * n, range(n))
    many = replace(many, sources=tuple(f"s{number}" for number in range(n)))
    (error,) = periodic_errors(many, CUTTING, phases=phases)
    assert error.realisations == 1 << 14
    drawn = np.exp(2j * np.pi * np.random.default_rng(1).random((200_000, n)))
    # four deviations of the mean of so many walks as are drawn
    spread = 4.0 * abs(drawn.sum(axis=1)).std() / math.sqrt(1 << 14)
    assert error.amplitude_um["tool"] == pytest.approx(abs(drawn.sum(axis=1)).mean(), abs=spread)
    assert error.kinematic_um == pytest.approx(2.0 * error.amplitude_um["tool"], rel=ROUNDING)


def test_expectations_say_over_how_many_realisations_they_are():
    apart = periodic_errors(motions([100.0, 100.0, 50.0], [1e-6, 1e-6, 1e-6], [0, 0, 0], [0, 2, 1]), CUTTING)
    assert [error.realisations for error in apart] == [4, 16]


def test_half_a_turn_is_ahead_at_every_speed():
    for rpm in np.arange(100.0, 3000.0, 7.3):
        (error,) = periodic_errors(motions([2.5 * rpm / 60.0], [1e-6], [0.0]), replace(CUTTING, workpiece_rpm=rpm))
        assert error.advance == pytest.approx(0.5, abs=ROUNDING)


@pytest.mark.parametrize(
    ("frequency", "advance", "axial_mm"),
    [(60.0, 0.0, None), (65.0, 0.25, 0.8), (58.0, -0.1, 2.0), (2.0, 0.1, 2.0), (20.0 / 3.0 * 9.0, 0.0, None)],
)
def test_advance_from_turn_to_turn(frequency, advance, axial_mm):
    (error,) = periodic_errors(motions([frequency], [1e-6], [0.0]), CUTTING)
    assert error.advance == pytest.approx(advance, abs=ROUNDING)
    assert error.axial_wavelength_mm == (None if axial_mm is None else pytest.approx(axial_mm, rel=1e-10))


@given(frequency=st.floats(0.01, 2e4))
def test_every_line_has_one_kind_and_numbers(frequency):
    (error,) = periodic_errors(motions([frequency], [1e-6], [1e-6j]), CUTTING)
    assert -0.5 <= error.advance <= 0.5
    assert math.isfinite(error.wavelength_mm)
    assert error.wavelength_mm > 0
    assert error.axial_wavelength_mm is None or error.axial_wavelength_mm > 0
    (total,) = kind_heights([error], CUTTING)
    assert total.kind == error.kind
    assert total.rms_um == pytest.approx(error.published_um, rel=ROUNDING)
    assert total.published_um == pytest.approx(error.published_um, rel=ROUNDING)


def test_totals_of_a_kind():
    errors = periodic_errors(
        motions([100.0, 200.0, 9e3], [3e-6, 1e-6, 1e-9], [0, 0, 0]), replace(CUTTING, depth_exponent=0.8)
    )
    totals = {one.kind: one for one in kind_heights(errors, replace(CUTTING, depth_exponent=0.8))}
    assert list(totals) == ["roughness", "lobing"]
    lobing = totals["lobing"]
    forces = [error.force_n["tool"] for error in errors[:2]]
    assert lobing.lines == 2
    assert lobing.published_um == pytest.approx(2e3 * (sum(forces) / PER_DEPTH) ** (1 / 0.8), rel=ROUNDING)
    assert lobing.rms_um == pytest.approx(math.hypot(errors[0].published_um, errors[1].published_um), rel=ROUNDING)
    assert lobing.kinematic_um == pytest.approx(2.0 * math.hypot(3.0, 1.0), rel=ROUNDING)
    assert lobing.rms_um < lobing.published_um


def test_from_sources_to_errors():
    found = final_motions(STRUCTURE, SOURCES, excitation(SOURCES, {"spindle": 1200.0}), FINALS)
    errors = periodic_errors(found, CUTTING)
    assert [(error.frequency_hz, error.sources, error.kind) for error in errors] == [
        (20.0, ("spindle", "motor"), "runout"),
        (50.0, ("motor",), "lobing"),
        (186.0, ("spindle",), "lobing"),
    ]


@pytest.mark.parametrize(
    ("change", "force_n"),
    [
        ({"depth_exponent": 1e-3}, 1e6),
        ({"depth_exponent": 1e-9}, 1.0),
        ({"feed_exponent": 1e5}, 1.0),
        ({"speed_exponent": -1e308}, 1.0),
        ({"speed_exponent": 1e308, "feed_exponent": 1e308}, 1.0),
    ],
)
def test_exponents_that_leave_the_range_of_numbers_are_refused(change, force_n):
    with pytest.raises(InputError) as caught:
        published_height_um(force_n, replace(CUTTING, **change))
    assert caught.value.where == "cutting.depth_exponent"


def test_forces_of_rounding_are_no_fault_of_the_exponents():
    assert 0.0 <= published_height_um(1e-300, replace(CUTTING, depth_exponent=0.75)) < 1e-300


def test_other_numbers_that_cannot_be_are_refused():
    with pytest.raises(InputError, match="roughness_below_mm"):
        Surface(roughness_below_mm=0.0)
    with pytest.raises(InputError, match="workpiece_rpm"):
        waves_per_revolution(1e300, replace(CUTTING, workpiece_rpm=1e-300))
