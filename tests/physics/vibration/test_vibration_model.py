"""A vibrating structure that runs: what its recording holds, seeds, methods, parameters, places."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.vibration.model_file import checked_model_file, read_model_file
from selector.physics.vibration.vibration_model import FINALS, RELATIVE, vibration_model
from tests.physics.vibration.model_values import changed
from tests.work import calls_of

FIXTURES = Path(__file__).resolve().parents[3] / "fixtures" / "vibration"


def model(*changes):
    return vibration_model(checked_model_file(changed(*changes)))


def columns(recording, *names, run="simulation"):
    return recording.values(run, names).T


def test_the_recording_has_finals_forces_and_speeds_at_every_period():
    built = model()
    recording = built.simulation().recording
    assert recording.names == (
        "tool", "workpiece", RELATIVE, "spindle_force", "motor_force", "spindle_speed", "motor_speed",
    )  # fmt: skip
    assert {channel.role for channel in recording.channels} == {"displacement", "force", "spindle_speed"}
    # 0.5 s at 1 ms, both ends
    assert len(recording.time_s("simulation")) == 501
    assert recording.time_s("simulation")[-1] == 0.5
    tool, workpiece, apart = columns(recording, "tool", "workpiece", RELATIVE)
    assert np.array_equal(apart, tool - workpiece)
    assert set(columns(recording, "motor_speed")[0]) == {1800.0}
    assert np.isfinite(recording.frame.to_numpy()).all()
    assert [channel.name for channel in built.outputs] == [*FINALS, RELATIVE]


def test_the_motion_is_the_sum_of_its_lines_with_the_shifts_of_the_seed():
    built = model()
    simulation = built.simulation(seed=5)
    motion, time_s = simulation.motions["coupled"], simulation.recording.time_s("simulation")
    phases_rad = built.phases_rad(5)
    shift = np.array([phases_rad[name] for name in motion.sources])[motion.source]
    turned = motion.of("tool")[:, None] * np.exp(
        1j * (shift[:, None] + 2 * np.pi * motion.frequency_hz[:, None] * time_s)
    )
    # sums of four sinusoids: rounding alone
    assert columns(simulation.recording, "tool")[0] == pytest.approx(1e6 * turned.imag.sum(axis=0), abs=1e-9)


def test_a_seed_draws_shifts_and_noise_and_repeats_them():
    noisy = model(("sensing", {"noise_um": 0.05}))
    assert noisy.simulation(seed=3).recording.frame.equals(noisy.simulation(seed=3).recording.frame)
    assert not noisy.simulation(seed=3).recording.frame.equals(noisy.simulation(seed=4).recording.frame)
    quiet = model()
    added = columns(noisy.simulation().recording, *FINALS) - columns(quiet.simulation().recording, *FINALS)
    # 1002 samples of noise: its standard deviation is known to 1/sqrt(2·1002) = 2.2 %, here 4 of these
    assert added.std() == pytest.approx(0.05, rel=0.09)


def test_both_methods_are_computed_and_the_file_says_which_is_recorded():
    coupled, chains = model(), model(("run.method", "chains"))
    motions = coupled.simulation().motions
    assert list(motions) == ["coupled", "chains"]
    simulated = chains.simulation()
    for built, method in ((coupled, "coupled"), (chains, "chains")):
        # mean square of many sines over a time that is no common period of them: a tenth
        rms = columns(built.simulation().recording, "workpiece")[0].std()
        by_source = np.abs(motions[method].of("workpiece"))
        assert rms == pytest.approx(1e6 * np.sqrt(np.sum(by_source**2) / 2.0), rel=0.1)
    assert np.array_equal(simulated.motions["chains"].motion_m, motions["chains"].motion_m)
    assert list(model(("chains", ...), ("cutting", ...)).simulation().motions) == ["coupled"]


def test_the_split_is_the_cut_off_of_roughness_at_the_speed_of_the_cut():
    built = model()
    # pi · 60 mm · 20 1/s / 0.8 mm, exact but for rounding
    assert built.split_hz(built.shaft_rpm) == pytest.approx(np.pi * 60.0 * 20.0 / 0.8, rel=1e-12)


def test_a_run_up_follows_its_course_and_lines_are_those_of_the_mean_speed():
    built = model(("shafts.spindle.rpm", [[0.0, 600.0], [0.5, 1800.0]]))
    speed, follows = columns(built.simulation().recording, "spindle_speed", "motor_speed")
    assert (speed[0], speed[-1]) == (600.0, 1800.0)
    assert follows == pytest.approx(1.5 * speed, rel=1e-12)  # rounding
    assert built.shaft_rpm["spindle"] == pytest.approx(1200.0, rel=1e-12)  # mean of a straight course
    assert ("spindle", 10.0, 30.0) in [
        (name, round(low, 9), round(high, 9)) for name, low, high in built.line_ranges_hz
    ]


def test_a_line_in_a_resonance_without_damping_is_refused_and_names_the_joint():
    undamped = {"mass_kg": 1.0 / (2.0 * np.pi) ** 2}
    built = model(
        ("members", {"tool": undamped, "workpiece": {"mass_kg": 1e6}}),
        ("joints", [
            {"between": ["tool", "ground"], "stiffness_n_per_m": 2500.0},
            {"between": ["workpiece", "ground"], "stiffness_n_per_m": 1e3, "dissipation": 0.1},
        ]),
        ("chains", ...), ("shafts", ...), ("cutting", ...),
        ("sources", {"motor": {"member": "tool", "lines": [{"frequency_hz": 50.0, "force_n": 1.0}]}}),
    )  # fmt: skip
    with pytest.raises(InputError, match="nothing damps") as refused:
        built.simulation()
    assert "tool" in refused.value.found
    assert "tool – ground" in refused.value.advice
    # with dissipation it is a motion: F/(j·η)
    damped = built.with_parameters({"joints.1.dissipation": 0.2 * np.pi}).simulation()
    # frequency 50 Hz and √(j/m) agree to rounding, of which 1/η = 10 makes ten times as much
    assert abs(damped.motions["coupled"].of("tool")[0]) == pytest.approx(1.0 / 2500.0 / 0.1, rel=1e-9)


def test_parameters_change_the_motion_and_nothing_changes_none():
    built = model()
    same = built.with_parameters({})
    assert same.simulation().recording.frame.equals(built.simulation().recording.frame)
    twice = built.with_parameters(
        {
            name: 2.0 * one.value
            for name, one in built.parameters.items()
            if name.endswith(("force_n", "unbalance_kg_m"))
        }
    )
    # linear: twice the forces, twice the motion, to rounding
    assert columns(twice.simulation().recording, "tool")[0] == pytest.approx(
        2.0 * columns(built.simulation().recording, "tool")[0], abs=1e-9
    )


@pytest.mark.parametrize("path", sorted(FIXTURES.glob("*.toml")), ids=lambda path: path.stem)
def test_examples_run_without_surprise(path):
    simulation = vibration_model(read_model_file(path)).simulation()
    assert np.isfinite(simulation.recording.frame.to_numpy()).all()
    assert simulation.findings == ()


def test_the_motion_of_the_lathe_is_cheap_enough_for_a_fit():
    lathe = vibration_model(read_model_file(FIXTURES / "lathe.toml"))
    lathe.simulation()
    changed = lathe.with_parameters({"joints.1.dissipation": 0.2})
    # 8000 calls, 12 ms; a fit calls it hundreds of times
    assert calls_of(lambda: changed.signal(changed.times_s, changed.courses, changed.phases_rad(0))) < 20_000
