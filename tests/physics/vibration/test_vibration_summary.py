"""What a simulated vibration amounts to: lines by both methods, amplitudes, errors, chains."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from selector.physics.vibration.model_file import checked_model_file, read_model_file
from selector.physics.vibration.vibration_model import FINALS, RELATIVE, vibration_model
from selector.physics.vibration.vibration_summary import judged_frequencies_hz, vibration_summary
from tests.physics.vibration.model_values import changed

LATHE = Path(__file__).resolve().parents[3] / "fixtures" / "vibration" / "lathe.toml"


def summary(*changes):
    built = vibration_model(checked_model_file(changed(*changes)))
    return vibration_summary(built, built.simulation())


def test_lines_stand_by_frequency_with_both_methods_beside_the_one_of_the_run():
    coupled, chains = summary(), summary(("run.method", "chains"))
    assert [round(one.frequency_hz, 6) for one in coupled.lines] == [20.0, 30.0, 50.0, 186.0]
    assert [(one.source, one.shaft, one.order) for one in coupled.lines[:2]] == [
        ("spindle", "spindle", 1.0), ("motor", "motor", 1.0),
    ]  # fmt: skip
    for one, other in zip(coupled.lines, chains.lines, strict=True):
        assert one.motion_um == one.coupled_um == other.coupled_um
        assert one.chains_um == other.chains_um
        assert other.motion_um == {name: size or 0.0 for name, size in other.chains_um.items()}
        assert set(one.motion_um) == {*FINALS, RELATIVE}
    # the motor has a chain to the tool, and none to the workpiece
    motor = coupled.lines[1].chains_um
    assert motor["workpiece"] is None
    assert motor["tool"] == motor[RELATIVE] > 0
    assert coupled.lines[0].force_n == pytest.approx(1e-4 * (40.0 * math.pi) ** 2, rel=1e-12)  # rounding


def test_amplitudes_lie_between_the_smallest_and_the_sum_of_all_lines():
    found = summary()
    for name, one in found.amplitudes.items():
        sizes = [line.motion_um[name] for line in found.lines]
        assert 0 < one.mean_abs_um < one.expected_um < one.largest_um <= sum(sizes) * (1 + 1e-12)  # rounding
        assert one.realisations == 4**2
        # ½·Σ|X|² where no two lines of a source share a frequency: over 1000 sections instead of all time, 5 %
        assert one.rms_um == pytest.approx(math.sqrt(sum(size**2 for size in sizes) / 2.0), rel=0.05)


def test_of_too_many_realisations_some_are_drawn():
    more = [(f"sources.m{n}", {"member": "bed", "lines": [{"frequency_hz": 70.0 + n, "force_n": 5.0}]}) for n in (1, 2)]
    few, many = summary(*more), summary(*more, ("realisations", {"phases": 360}))
    one, other = many.amplitudes[RELATIVE], few.amplitudes[RELATIVE]
    assert (one.realisations, one.sections) == (1 << 14, 1000)
    # the same sections, and for three phases and more the same closed form: rounding
    assert one.rms_um == pytest.approx(other.rms_um, rel=1e-12)
    # four steps of a turn or 360, averaged over time
    assert one.expected_um == pytest.approx(other.expected_um, rel=0.01)


def test_errors_are_sorted_into_kinds_and_absent_without_a_cut():
    found = summary()
    assert {error.kind for error in found.errors} == set(found.heights)
    assert found.split_hz == pytest.approx(60.0 * math.pi * 20.0 / 0.8, rel=1e-12)  # rounding
    bare = summary(("cutting", ...), ("chains", ...))
    assert (bare.errors, bare.heights, bare.split_hz, bare.accuracy) == ((), {}, None, ())
    assert all(size is None for line in bare.lines for size in line.chains_um.values())


def test_a_published_height_far_above_the_motion_is_told():
    high = summary(("sources.spindle.lines.1", {"frequency_hz": 480.0, "force_n": 20.0}))
    told = next(finding for finding in high.findings if finding.id == "height-beyond-motion")
    kind = high.heights[told.evidence["kind"]]
    assert kind.rms_um > 10.0 * kind.kinematic_um
    # without exponents' help: ΔP = m·ω²·A against the same A
    assert not [one for one in summary(("cutting.force_coefficient", 1e6)).findings if one.id == "height-beyond-motion"]


def test_speeds_that_change_are_told_as_their_mean():
    found = summary(("shafts.spindle.rpm", [[0.0, 600.0], [0.5, 1800.0]]))
    assert found.shaft_rpm["spindle"] == pytest.approx(1200.0, rel=1e-12)  # mean of a straight course
    assert "lines-at-mean-speed" in [finding.id for finding in found.findings]
    assert "lines-at-mean-speed" not in [finding.id for finding in summary().findings]


def test_the_lathe_has_1024_realisations_and_every_chain_is_judged_for_every_source():
    built = vibration_model(read_model_file(LATHE))
    found = vibration_summary(built, built.simulation())
    assert {one.realisations for one in found.amplitudes.values()} == {1024}
    assert {(one.chain, one.source) for one in found.accuracy} == {
        (chain.name, source) for chain in built.chains for source in chain.sources
    }
    assert all(np.isfinite(one.published.ratio).all() for one in found.accuracy)
    assert {"chains-off-coupled", "height-beyond-motion"} == {finding.id for finding in found.findings}


def test_chains_that_meet_an_undamped_resonance_are_not_judged():
    undamped = [(f"joints.{n}.dissipation", 0.0) for n in range(3)]
    # the grid of frequencies begins at 1 Hz: put the resonance of the workpiece there
    stiffness = 20.0 * (2.0 * math.pi) ** 2
    found = summary(*undamped, ("joints.0.stiffness_n_per_m", stiffness), ("members.bed.mass_kg", 1e9),
                    ("joints.2.stiffness_n_per_m", 1e14))  # fmt: skip
    assert found.accuracy == ()
    assert "chains-not-judged" in [finding.id for finding in found.findings]


def test_chains_are_judged_from_1_hz_to_twice_the_highest_line_or_where_the_high_ones_begin():
    built = vibration_model(read_model_file(LATHE))
    assert judged_frequencies_hz(built, np.array([0.8, 1700.0]), 785.4)[[0, -1]] == pytest.approx([1.0, 3400.0])
    assert judged_frequencies_hz(built, np.array([20.0]), 785.4)[-1] == pytest.approx(2 * 785.4)
    assert judged_frequencies_hz(built, np.array([20.0]), None)[-1] == pytest.approx(40.0)
    steps = np.diff(np.log(judged_frequencies_hz(built, np.array([20.0]), None)))
    assert steps == pytest.approx(steps[0], rel=1e-9)  # as many a decade everywhere
