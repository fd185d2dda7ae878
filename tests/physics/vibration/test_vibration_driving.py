"""Recorded speeds and forces in place of those of the model file: how they are found, and what they make."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy import signal

from selector.errors import InputError, OptionError
from selector.physics.vibration.model_file import checked_model_file
from selector.physics.vibration.recorded_force import force_answer, ring_time_s
from selector.physics.vibration.structure import GROUND, Joint, Line, Member, Source, Structure
from selector.physics.vibration.vibration_driving import driven_runs, recorded_channels
from selector.physics.vibration.vibration_model import FINALS, RELATIVE, vibration_model
from selector.physics.vibration.vibration_summary import vibration_summary
from selector.recording import Channel, Recording
from tests.physics.vibration.model_values import changed
from tests.physics.vibration.viscous import state_space

UNITS = {"displacement": "um", "force": "N", "spindle_speed": "rpm"}


def model(*changes):
    return vibration_model(checked_model_file(changed(*changes)))


def recording(time_s, *columns, run="r1"):
    """Columns as (name, role, values) or (name, role, values, place)."""
    channels = tuple(Channel(name, role, UNITS[role], *place) for name, role, _, *place in columns)
    table = pd.DataFrame({name: values for name, _, values, *_ in columns}, index=pd.Index(time_s, name="time_s"))
    return Recording.from_runs({run: table}, channels)


def tool(driven, run="r1", name="tool"):
    return driven.recording.values(run, [name])[:, 0]


def ids(driven):
    return [one.id for one in driven.findings]


TIME_S = np.arange(4000) * 1e-3
FORCE = 30.0 * np.sin(2 * np.pi * 31.0 * TIME_S + 0.4)


def test_the_model_driven_by_its_own_forces_does_what_it_did():
    built = model(("run.duration_s", 4.0), ("run.period_s", 5e-4))
    own = built.simulation().recording
    driven = driven_runs(built, own)
    assert driven.matched == {name: name for name in own.names}
    assert set(driven.inputs) == {"spindle_force", "motor_force", "spindle_speed", "motor_speed"}
    came, there = (one.values("simulation", FINALS) for one in (driven.recording, own))
    # steady from the first sample to the last: sines go on as sines, and what ends twice a ring-down outside is left of
    # by 1e-3 at most
    assert np.abs(came - there).max() < 1e-3 * np.abs(there).max()
    assert driven.recording.values("simulation", ["motor_force"]) == pytest.approx(
        own.values("simulation", ["motor_force"])
    )
    assert vibration_summary(built, driven).lines == vibration_summary(built, built.simulation()).lines


def test_chains_are_driven_too():
    built = model(("run.duration_s", 4.0), ("run.period_s", 5e-4), ("run.method", "chains"))
    own = built.simulation().recording
    came, there = (one.values("simulation", FINALS) for one in (driven_runs(built, own).recording, own))
    assert np.abs(came - there).max() < 1e-3 * np.abs(there).max()  # as above; the tool of the chains moves less


def test_a_blow_rings_as_the_viscous_oscillator_of_the_same_loss():
    loss = 0.02
    structure = Structure((Member("tool", 10.0),), (Joint(("tool", GROUND), 1e7, 2 * np.pi * loss),))
    step_s, natural = 1e-4, np.sqrt(1e7 / 10.0) / (2 * np.pi)
    time_s = np.arange(8000) * step_s
    force = np.where(time_s < 0.004, 100.0 * np.sin(np.pi * time_s / 0.004) ** 2, 0.0)
    source = Source("blow", "tool", (Line(frequency_hz=1.0, force_n=1.0),))
    found = force_answer(structure, source, force, step_s, {"tool": "tool"})
    viscous = state_space(structure, natural, inputs=["tool"], outputs=["tool"])
    _, exact, _ = signal.lsim((viscous.A, viscous.B, viscous.C, viscous.D), force, time_s)
    exact = np.ravel(exact)
    # the same loss at resonance; away from it, in the blow itself, the loss of the two differs by shares of η = 2 %
    assert np.abs(found[0] - exact).max() < 0.02 * np.abs(exact).max()
    # e^{−η·ω·t/2} falls to 1e-3; λ of a hysteretic joint has this decay but for η²/4
    assert ring_time_s(structure) == pytest.approx(np.log(1e3) / (loss * np.pi * natural), rel=1e-3)


def test_a_recorded_speed_turns_the_shaft_and_what_follows_it():
    course = [[0.0, 600.0], [2.0, 1500.0], [4.0, 1500.0]]
    file = model(("run.duration_s", 4.0), ("shafts.spindle.rpm", course))
    own = file.simulation(seed=2).recording
    speed = np.interp(TIME_S, *np.array(course).T)
    # times of a recording need not begin with 0
    driven = driven_runs(model(), recording(TIME_S + 7.0, ("n", "spindle_speed", speed)), seed=2)
    assert (driven.inputs, driven.matched) == (("n",), {"spindle_speed": "n"})
    # corners every millisecond instead of three: the integral of the speed rounds otherwise
    assert tool(driven) == pytest.approx(own.values("simulation", ["tool"])[:4000, 0], abs=1e-6)
    assert driven.recording.time_s("r1")[0] == 7.0
    follows = driven.recording.values("r1", ["motor_speed"])[:, 0]
    assert follows == pytest.approx(1.5 * speed, rel=1e-12)  # rounding
    # its trapezoids, the last sample at 3.999 s
    assert driven.shaft_rpm["spindle"] == pytest.approx(np.trapezoid(speed, TIME_S) / 3.999, rel=1e-9)


def test_displacements_of_nothing_are_named_with_what_to_put_into_the_machine_file():
    speed, moved = ("n", "spindle_speed", np.full(len(TIME_S), 900.0)), np.zeros(len(TIME_S))
    two = recording(TIME_S, speed, ("Werkzeug", "displacement", moved), ("Werkstück", "displacement", moved))
    said = next(one for one in driven_runs(model(), two).findings if one.id == "motion-not-compared")
    assert said.level == "warning"
    assert "'Werkzeug', 'Werkstück' (displacements) are not" in said.statement
    assert '[channels.Werkzeug] place = "tool" or "workpiece" or "tool_workpiece"' in said.suggestion
    # what it advises is enough
    placed = (("Werkzeug", "displacement", moved, "tool"), ("Werkstück", "displacement", moved, "workpiece"))
    driven = driven_runs(model(), recording(TIME_S, speed, *placed))
    assert (driven.matched["tool"], driven.matched["workpiece"]) == ("Werkzeug", "Werkstück")
    assert "motion-not-compared" not in ids(driven)
    # beside channels that are compared it is no warning
    third = recording(TIME_S, speed, *placed, ("bed drift", "displacement", moved))
    said = next(one for one in driven_runs(model(), third).findings if one.id == "motion-not-compared")
    assert (said.level, said.evidence["channels"]) == ("info", ["bed drift"])
    assert '[channels."bed drift"] place = "tool_workpiece"' in said.suggestion


def test_noise_comes_with_a_seed_alone():
    noisy, quiet = model(("sensing.noise_um", 0.5)), model()
    recorded = recording(TIME_S, ("n", "spindle_speed", np.full(len(TIME_S), 900.0)))
    without, plain = driven_runs(noisy, recorded), driven_runs(quiet, recorded)
    assert (tool(without) == tool(plain)).all()
    told = without.recording.provenance["simulated"]
    assert (told["seed"], told["instruments"]) == (None, False)
    # phases are those of the file's seed, so that a model follows its own recording in time
    own = quiet.file.run.seed
    assert (tool(plain) == tool(driven_runs(quiet, recorded, seed=own))).all()
    assert (tool(plain) != tool(driven_runs(quiet, recorded, seed=own + 1))).any()
    added = tool(driven_runs(noisy, recorded, seed=2)) - tool(driven_runs(quiet, recorded, seed=2))
    assert np.std(added) == pytest.approx(0.5, rel=0.05)  # 4000 draws: 1.1 %


def test_a_recorded_force_replaces_the_lines_of_its_source_alone():
    built = model()
    driven = driven_runs(built, recording(TIME_S, ("F", "force", FORCE, "motor")))
    silent = driven_runs(built, recording(TIME_S, ("F", "force", 0.0 * FORCE, "motor")))
    twice = driven_runs(built, recording(TIME_S, ("F", "force", 2.0 * FORCE, "motor")))
    spindle_alone = tool(silent)
    assert np.abs(spindle_alone).max() > 0
    # linear, to rounding of the transform
    assert tool(twice) - spindle_alone == pytest.approx(2.0 * (tool(driven) - spindle_alone), abs=1e-9)
    assert driven.recording.values("r1", ["F"])[:, 0] == pytest.approx(FORCE, rel=1e-15)
    assert "spindle_force" in driven.recording.names
    assert [one.evidence["sources"] for one in driven.findings if one.id == "lines-of-the-file"] == [["motor"]]


def test_outputs_are_called_as_the_recorded_channels_they_belong_to():
    zero = np.zeros(len(TIME_S))
    for name, place, own in (("probe", "tool", "tool"), ("WORKPIECE", None, "workpiece"), ("gap", None, RELATIVE)):
        there = recording(TIME_S, ("F", "force", FORCE, "motor"), (name, "displacement", zero, place))
        driven = driven_runs(model(), there)
        assert driven.matched[own] == name
        assert driven.recording.channel(name).role == "displacement"
        assert np.abs(tool(driven, name=name)).max() > 0
    both = recording(
        TIME_S, ("F", "force", FORCE, "motor"), ("a", "displacement", zero, "x"), ("tool", "displacement", zero)
    )
    driven = driven_runs(model(), both)
    # the tool has its own channel, and "a" is nobody's
    assert driven.matched == {"tool": "tool", "motor_force": "F"}
    taken = recording(TIME_S, ("F", "force", FORCE, "motor"), ("tool_workpiece_", "displacement", zero, "tool"),
                      ("workpiece", "force", zero, "else"))  # fmt: skip
    assert "workpiece (simulated)" in driven_runs(model(), taken).recording.names


def test_channels_are_found_by_name_then_place_then_by_being_alone():
    two = recording(
        TIME_S, ("spindle", "spindle_speed", FORCE), ("b", "spindle_speed", FORCE, "motor"), ("c", "force", FORCE),
    )  # fmt: skip
    found = recorded_channels(model(), two)
    assert found.speeds == {"spindle": "spindle", "motor": "b"}
    # two sources: a force without a name is of neither
    assert found.forces == {}
    assert [(one.id, one.where.channel) for one in found.findings] == [("channel-of-nothing", "c")]
    alone = recorded_channels(model(), recording(TIME_S, ("n", "spindle_speed", FORCE)))
    assert alone.speeds == {"spindle": "n"}
    one_source = model(("sources.spindle", ...), ("chains", ...))
    assert recorded_channels(one_source, recording(TIME_S, ("Fx", "force", FORCE))).forces == {"motor": "Fx"}


def test_nothing_that_drives_is_an_error_that_names_the_channels():
    with pytest.raises(OptionError, match=r"gap \(displacement\)"):
        driven_runs(model(), recording(TIME_S, ("gap", "displacement", FORCE)))
    with pytest.raises(OptionError, match="3 samples"):
        driven_runs(model(), recording(TIME_S[:3], ("n", "spindle_speed", FORCE[:3])))


def test_missing_values_are_bridged_and_told():
    holes = FORCE.copy()
    holes[100:103] = np.nan
    driven = driven_runs(model(), recording(TIME_S, ("F", "force", holes, "motor")))
    told = next(one for one in driven.findings if one.id == "input-bridged")
    assert (told.evidence["missing"], told.evidence["longest"], told.where.run) == (3, 3, "r1")
    assert np.isfinite(driven.recording.frame.to_numpy()).all()


def test_a_run_without_the_channel_has_the_lines_of_the_file():
    table = {"r1": FORCE, "r2": np.full(len(FORCE), np.nan)}
    frames = {
        run: pd.DataFrame({"motor": values}, index=pd.Index(TIME_S, name="time_s")) for run, values in table.items()
    }
    there = Recording.from_runs(frames, (Channel("motor", "force", "N"),))
    built = model(("run.duration_s", 3.999))
    driven = driven_runs(built, there)
    assert [(one.id, one.where.run) for one in driven.findings if one.id == "input-not-recorded"] == [
        ("input-not-recorded", "r2")
    ]
    own = built.simulation().recording.values("simulation", ["tool"])[:, 0]
    assert tool(driven, "r2") == pytest.approx(own, abs=1e-9)
    assert driven.recording.runs == ("r1", "r2")


def test_gaps_and_uneven_clocks_are_told_and_hardly_matter_where_small():
    even = tool(driven_runs(model(), recording(TIME_S, ("F", "force", FORCE, "motor"))))
    jitter = TIME_S + np.random.default_rng(1).uniform(-1e-5, 1e-5, len(TIME_S))
    # the same samples as those of an even clock, by stamps that are wrong
    wrong = driven_runs(model(), recording(jitter, ("F", "force", FORCE, "motor")))
    assert ("recorded-clock-jitter" in ids(wrong), "recorded-clock-uneven" in ids(wrong)) == (True, False)
    # lines of the spindle at 186 Hz that are taken 1e-5 s beside are off by 1.2 %
    assert np.abs(tool(wrong) - even).max() < 0.02 * np.abs(even).max()
    kept = np.r_[0:1000, 1200:4000]
    gap = driven_runs(model(), recording(TIME_S[kept], ("F", "force", FORCE[kept], "motor")))
    told = next(one for one in gap.findings if one.id == "recorded-gap")
    # until what the force left has faded
    assert (told.where.from_s, told.where.to_s) == (0.999, 1.2 + ring_time_s(model().structure))
    speeds = driven_runs(model(), recording(TIME_S[kept], ("n", "spindle_speed", np.full(len(kept), 900.0))))
    assert [(one.where.from_s, one.where.to_s) for one in speeds.findings if one.id == "recorded-gap"] == [(0.999, 1.2)]


def test_lines_that_the_samples_cannot_carry_are_left_out_and_told():
    slow = TIME_S[::10]
    driven = driven_runs(model(), recording(slow, ("n", "spindle_speed", np.full(len(slow), 1200.0))))
    told = [one.evidence["frequency_hz"] for one in driven.findings if one.id == "line-beyond-sampling"]
    # sampled at 100 Hz: 186 Hz of the spindle and 50 Hz of the motor, exact but for rounding
    assert sorted(told) == pytest.approx([50.0, 186.0], rel=1e-12)
    lower = model(("sources.spindle.lines", [{"order": 1.0, "unbalance_kg_m": 1e-4}]),
                  ("sources.motor.lines", [{"order": 1.0, "force_n": 5.0}]))  # fmt: skip
    same = driven_runs(lower, recording(slow, ("n", "spindle_speed", np.full(len(slow), 1200.0))))
    assert tool(driven) == pytest.approx(tool(same), abs=1e-9)  # rounding


def test_a_run_that_is_shorter_than_its_ring_down_is_a_warning():
    short = driven_runs(model(), recording(TIME_S[:100], ("F", "force", FORCE[:100], "motor")))
    assert [one.level for one in short.findings if one.id == "steady-before-recording"] == ["warning"]


def test_impossible_values_are_refused_with_channel_and_run():
    with pytest.raises(InputError, match=r"r1.*channel n"):
        driven_runs(model(), recording(TIME_S, ("n", "spindle_speed", np.full(len(TIME_S), 1e9))))


def test_progress_is_told_run_by_run():
    said = []
    driven_runs(model(), recording(TIME_S, ("n", "spindle_speed", np.full(len(TIME_S), 900.0))),
                progress=lambda done, of, run: said.append((done, of, run)))  # fmt: skip
    assert said == [(0, 1, "r1")]


def test_a_lost_row_and_an_uneven_clock_are_told_as_what_they_are():
    kept = np.delete(np.arange(4000), 2000)
    lost = driven_runs(model(), recording(TIME_S[kept], ("F", "force", FORCE[kept], "motor")))
    (told,) = (one for one in lost.findings if one.id.startswith("recorded"))
    assert (told.id, told.evidence["lost"]) == ("recorded-rows-lost", 1)
    whole = tool(driven_runs(model(), recording(TIME_S, ("F", "force", FORCE, "motor"))))
    # a cubic spline over one of 32 samples a period
    assert np.abs(tool(lost) - whole[kept]).max() < 1e-3 * np.abs(whole).max()
    uneven = np.cumsum(np.random.default_rng(2).uniform(0.5e-3, 1.5e-3, 4000))
    driven = driven_runs(model(), recording(uneven, ("F", "force", np.sin(uneven), "motor")))
    (told,) = (one for one in driven.findings if one.id.startswith("recorded"))
    assert told.id == "recorded-clock-uneven"


def test_a_force_with_a_mean_deflects_from_the_first_sample_to_the_last():
    # no other source moves it
    alone = model(("sources.spindle", ...), ("chains", ...))
    driven = driven_runs(alone, recording(TIME_S, ("F", "force", np.full(4000, 100.0))))
    deflected = tool(driven)
    assert np.ptp(deflected) < 1e-9 * np.abs(deflected).max()
    assert np.abs(deflected).max() > 0.01
    (told,) = (one for one in driven.findings if one.id == "steady-before-recording")
    assert told.level == "info"


@pytest.mark.parametrize("shaft", ["spindle", "motor"])
def test_a_shaft_of_the_cut_that_stands_is_refused_with_its_channel(shaft):
    # the motor follows the spindle: its speed is that of the recorded one too
    stands = recording(TIME_S, ("n", "spindle_speed", 0.0 * TIME_S, "spindle"))
    with pytest.raises(OptionError) as refused:
        driven_runs(model(("cutting.shaft", shaft)), stands)
    assert refused.value.where == "run r1, channel n"
    assert "[cutting]" in refused.value.advice
    begins = recording(TIME_S, ("n", "spindle_speed", 300.0 * TIME_S, "spindle"))
    assert driven_runs(model(("cutting.shaft", shaft)), begins).shaft_rpm["spindle"] > 0


def test_of_speeds_below_0_the_amount_counts_and_it_is_said():
    forth, back = (
        driven_runs(model(), recording(TIME_S, ("n", "spindle_speed", np.full(len(TIME_S), sign * 900.0))))
        for sign in (1.0, -1.0)
    )
    assert np.array_equal(tool(back), tool(forth))
    assert "speed-without-sign" not in ids(forth)
    (told,) = [one for one in back.findings if one.id == "speed-without-sign"]
    assert (told.level, told.where.channel, told.evidence["below_0"]) == ("info", "n", len(TIME_S))
    turned = driven_runs(model(), recording(TIME_S, ("n", "spindle_speed", np.linspace(-900.0, 900.0, len(TIME_S)))))
    assert [one.level for one in turned.findings if one.id == "speed-without-sign"] == ["warning"]
    # a hundredth of the speed is the noise of a shaft that stands
    noisy = np.r_[np.full(2000, 900.0), np.full(2000, -5.0)]
    assert "speed-without-sign" not in ids(driven_runs(model(), recording(TIME_S, ("n", "spindle_speed", noisy))))
