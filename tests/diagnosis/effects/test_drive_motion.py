"""What an axis does is told from its command, position or speed; what a force does, from the loop of its simulation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.drive._forces import held_back, leads
from selector.diagnosis.effects.drive.compliance import _widths
from selector.diagnosis.shapes.axis import motion
from selector.diagnosis.shapes.force_response import ClosedLoop, closed_loop, passed, responds, yields_s2
from selector.diagnosis.workflow import diagnosis
from selector.recording import Channel
from tests.diagnosis.effects.drive_axis import (
    PAIRS,
    VISCOUS_ONLY,
    WITH_FRICTION,
    Noise,
    compared,
    driven,
    moves,
    replace,
)

COULOMB = effect_of("drive.coulomb")
PITCH_ERROR = effect_of("drive.pitch_error")
SATURATION = effect_of("drive.saturation")

PERIOD_S = 2e-3


def comparison_with(
    channels: tuple[Channel, ...], recorded: dict[str, np.ndarray], **simulated: np.ndarray
) -> Comparison:
    n = len(next(iter(recorded.values())))
    return Comparison(
        runs=("r1",),
        starts=(0, n),
        time_s=np.arange(n) * PERIOD_S,
        channels=channels,
        recorded=recorded,
        simulated=simulated,
        responses=tuple(name for name in simulated if name in recorded),
        held_out=np.zeros(n, dtype=bool),
    )


COMMAND = moves(3, duration_s=7.0)[::20]
SPEED = np.gradient(COMMAND, PERIOD_S)


@pytest.mark.parametrize("role", ["position_command", "position", "velocity"])
def test_any_of_three_channels_tells_the_motion(role):
    random = np.random.default_rng(0)
    noise = {"position_command": 0.0, "position": 2e-7, "velocity": 2e-4}[role]
    clean = SPEED if role == "velocity" else COMMAND
    unit = "m/s" if role == "velocity" else "m"
    recorded = {"q": clean + noise * random.standard_normal(len(clean))}
    found = motion(comparison_with((Channel("q", role, unit),), recorded))
    top = np.abs(SPEED).max()
    # half a percent of the top speed: what smoothing rounds off the ramps; a noisy position is smoothed over 60 ms
    allowed = 0.03 if role == "position" else 0.01
    assert np.sqrt(np.mean((found.velocity_m_per_s - SPEED) ** 2)) < allowed * top
    moving = np.abs(SPEED) > 0.05 * top
    assert np.mean(found.sense[moving] == np.sign(SPEED[moving])) > 0.99
    # sin² ramps leave standstill gently, and noise must not be taken for motion
    still = np.convolve(np.abs(SPEED), np.ones(51), "same") == 0.0
    assert still.sum() > 50
    assert np.mean(found.sense[still] == 0.0) > 0.95


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_simulated_error_says_where_the_table_is_whichever_sign_it_has(sign):
    behind = 0.02 * SPEED
    channels = (Channel("r", "position_command", "m"), Channel("E", "displacement", "um"))
    error = -1e6 * behind * sign
    found = motion(comparison_with(channels, {"r": COMMAND, "E": error}, E=error))
    assert found.position_m == pytest.approx(COMMAND - behind, abs=1e-12)


def test_a_noisy_position_says_how_far_the_axis_is_behind_its_command():
    table = np.interp(np.arange(len(COMMAND)) * PERIOD_S - 0.01, np.arange(len(COMMAND)) * PERIOD_S, COMMAND)
    noisy = table + 5e-5 * np.random.default_rng(1).standard_normal(len(table))
    channels = (Channel("r", "position_command", "m"), Channel("q", "position", "m"))
    found = motion(comparison_with(channels, {"r": COMMAND, "q": noisy}))
    assert found.sources == ("r", "q")
    # a lag instead of a dead time: a tenth of the way that it is behind
    assert np.abs(found.position_m - table).max() < 0.3 * np.abs(COMMAND - table).max()


def test_beside_a_command_the_simulated_position_says_where_the_table_is_not_a_recorded_one():
    """A second encoder has noise, and is behind the command by no loop of the simulation."""
    table = COMMAND - 2e-5 * np.sin(np.arange(len(COMMAND)) / 40.0)
    motor = table + 1e-6 * np.random.default_rng(0).standard_normal(len(COMMAND))
    channels = (Channel("r", "position_command", "m"), Channel("motor", "position", "m"), Channel("x", "position", "m"))
    comparison = comparison_with(channels, {"r": COMMAND, "motor": motor, "x": table}, x=table)
    found = motion(comparison)
    assert found is not None
    assert found.sources == ("r", "x")
    np.testing.assert_array_equal(found.position_m, table)


def test_a_compared_speed_may_stand_at_a_limit_far_below_the_simulated_one():
    speed = np.gradient(COMMAND, PERIOD_S)
    limit = 0.3 * np.abs(speed).max()
    comparison = comparison_with((Channel("v", "velocity", "m/s"),), {"v": np.clip(speed, -limit, limit)}, v=speed)
    lacking = np.clip(speed, -limit, limit) - speed
    left = []
    for variant in SATURATION.variants(comparison, "v"):
        columns = variant.columns
        rest = lacking - columns @ np.linalg.lstsq(columns, lacking, rcond=None)[0]
        left.append((float(np.sum(rest**2) / np.sum(lacking**2)), variant.shape["limit"].value))
    assert min(left)[0] < 1e-3
    assert min(left)[1] == pytest.approx(limit, rel=0.01)


@pytest.mark.parametrize("read", [lambda q: np.round(q, 2), lambda q: np.roll(q, 400)], ids=["rounded", "late"])
def test_a_recorded_speed_is_believed_before_a_position_that_goes_another_way(read):
    channels = (Channel("q", "position", "m"), Channel("v", "velocity", "m/s"))
    found = motion(comparison_with(channels, {"q": read(COMMAND), "v": SPEED}))
    assert found.sources == ("q", "v")
    top = np.abs(SPEED).max()
    assert np.sqrt(np.mean((found.velocity_m_per_s - SPEED) ** 2)) < 0.01 * top
    # at the level that the position tells
    assert found.position_m.mean() == pytest.approx(read(COMMAND).mean(), abs=1e-9)
    fine = motion(comparison_with(channels, {"q": COMMAND, "v": SPEED + 0.1 * top}))
    assert fine.sources == ("q",)


def test_a_speed_that_counts_the_other_way_round_turns_no_position():
    channels = (Channel("q", "position", "m"), Channel("v", "velocity", "m/s"))
    found = motion(comparison_with(channels, {"q": COMMAND, "v": -SPEED}))
    assert found.sources == ("q",)
    np.testing.assert_allclose(found.position_m, COMMAND)


def test_the_speed_of_another_axis_says_nothing_of_a_position():
    channels = (Channel("q", "position", "m", axis="X"), Channel("v", "velocity", "m/s", axis="Y"))
    found = motion(comparison_with(channels, {"q": np.round(COMMAND, 2), "v": SPEED}))
    assert found.sources == ("q",)


def test_play_is_crossed_within_a_quarter_of_the_usual_stroke():
    """However far the axis comes by many of them."""
    t = np.arange(4000) * PERIOD_S
    place = 0.05 * t + 0.02 * np.sin(2.0 * np.pi * t / 0.4)
    found = motion(comparison_with((Channel("r", "position_command", "m"),), {"r": place}))
    assert np.ptp(place) > 0.4
    forth = place[np.flatnonzero(np.diff(np.sign(np.gradient(place))))]
    stroke_m = float(np.median(np.abs(np.diff(forth))))
    wider = [width for width in _widths(found) if width > 100.0]
    assert wider
    assert 1e-6 * max(wider) < 0.27 * stroke_m


def test_the_channel_of_the_own_axis_is_taken():
    channels = (Channel("rx", "position_command", "m", axis="X"), Channel("ry", "position_command", "m", axis="Y"))
    comparison = comparison_with(channels, {"rx": COMMAND, "ry": 0.0 * COMMAND})
    assert motion(comparison, "X").sources == ("rx",)
    assert motion(comparison, "Y") is None


def test_without_motion_there_is_none():
    channel = (Channel("T", "temperature", "degC"), Channel("I", "current", "A"))
    comparison = comparison_with(channel, {"T": COMMAND, "I": SPEED}, I=SPEED)
    assert motion(comparison) is None
    assert "position" in responds(comparison, "I")
    assert "neither" in responds(comparison_with(channel, {"T": COMMAND}, T=COMMAND), "T")


@given(
    steps=st.lists(st.floats(-1e-3, 1e-3, allow_nan=False), min_size=9, max_size=60),
    presliding_um=st.floats(0.5, 100.0),
)
@settings(max_examples=25)
def test_friction_is_within_its_bounds_and_depends_on_the_way_only(steps, presliding_um):
    place = 0.1 * np.sin(np.arange(80) / 6.0)
    place[: len(steps)] += np.cumsum(steps)
    found = motion(comparison_with((Channel("r", "position_command", "m"),), {"r": place}))
    state = found.friction_state(1e-6 * presliding_um)
    assert np.all(np.abs(state) <= 1.0)
    # the same way in finer steps ends in the same state
    fine = np.interp(np.arange(0, 79.01, 0.25), np.arange(80), place)
    finer = motion(comparison_with((Channel("r", "position_command", "m"),), {"r": fine}))
    # exact between samples: rounding only
    assert finer.friction_state(1e-6 * presliding_um)[::4] == pytest.approx(state, abs=1e-9)


@pytest.mark.parametrize("control", [{}, {"proportional": 30.0, "reset_s": 0.05}, {"feed_forward": 0.0}])
def test_the_simulation_tells_the_poles_of_its_loop(control):
    axis = replace(VISCOUS_ONLY, **control)
    loop = closed_loop(compared(axis, axis, seed=1), "X")
    mass = axis.motor_kg + axis.table_kg
    gain = axis.speed_gain
    slowest = min(
        abs(
            np.roots(
                [mass, gain, gain * (axis.proportional + 1.0 / axis.reset_s), gain * axis.proportional / axis.reset_s]
            )
        )
    )
    assert loop.misfit < 1e-2
    # the screw, the current loop and the sampled control are not in that polynomial; the slow pole hardly feels them
    assert min(abs(np.roots(loop.polynomial))) == pytest.approx(slowest, rel=0.1)


def test_a_simulation_that_is_no_loop_shows_none():
    channels = (Channel("r", "position_command", "m"), Channel("F", "force", "N"))
    comparison = comparison_with(channels, {"r": COMMAND, "F": SPEED}, F=SPEED)
    assert closed_loop(comparison) is None
    assert passed(comparison, "F", SPEED)[0] == pytest.approx(SPEED, abs=0.0)
    assert yields_s2(comparison, "F") == (0.0,)


def test_a_force_that_stays_is_countered_in_full_and_moves_nothing():
    comparison = compared(*PAIRS["drive.coulomb"], seed=1, noise=Noise(0.0, 0.0, 0.0))
    step = np.where(comparison.time_s > 0.5, 1.0, 0.0)
    late = comparison.time_s > 2.0
    drive, _ = passed(comparison, "I", step)
    moved, _ = passed(comparison, "E", step)
    bent, _ = passed(comparison, "E", step, yield_s2=5e-6)
    # the slowest pole is near 40 1/s: nothing is left after 1.5 s
    assert drive[late] == pytest.approx(1.0, abs=1e-6)
    assert np.abs(moved[late]).max() < 1e-6 * np.abs(moved).max()
    # what yields stays bent, away from the force
    assert np.ptp(bent[late]) < 1e-6 * np.abs(bent).max()
    assert bent[late].max() < 0.0


@pytest.mark.parametrize("winds_up", [True, False])
def test_a_limit_beyond_the_force_does_nothing_and_one_below_is_made_good(winds_up):
    comparison = compared(*PAIRS["drive.saturation"], seed=1)
    loop = ClosedLoop((1.0, 300.0, 3e4, 6e5), 0.0)
    force = np.exp(-(((comparison.time_s - 1.0) / 0.05) ** 2))
    lacking, behind = held_back(comparison, loop, force, 1.5, winds_up=winds_up)
    assert not lacking.any()
    assert not behind.any()
    lacking, behind = held_back(comparison, loop, force, 0.8, winds_up=winds_up)
    assert (force + lacking).max() == pytest.approx(0.8, abs=1e-12)
    assert behind.min() < 0.0
    # forgotten with the slowest pole, near 30 1/s, after one second
    assert np.abs(behind[comparison.time_s > 2.0]).max() < 1e-6 * np.abs(behind).max()


@pytest.mark.parametrize("name", ["speed", "acceleration"])
def test_a_limit_is_looked_for_also_where_a_channel_of_that_name_is_recorded_and_not_simulated(name):
    role, unit = {"speed": ("velocity", "m/s"), "acceleration": ("acceleration", "m/s^2")}[name]
    moved = {"speed": SPEED, "acceleration": np.gradient(SPEED, PERIOD_S)}[name]
    channels = (Channel("q", "position", "m"), Channel(name, role, unit), Channel("F", "force", "N"))
    recorded = {"q": COMMAND, name: moved, "F": np.clip(SPEED, -0.1, 0.1)}
    comparison = comparison_with(channels, recorded, F=SPEED)
    limits = {variant.shape["limit"].unit for variant in SATURATION.variants(comparison, "F")}
    assert "N" in limits


def _followed(command: np.ndarray, fastest_m_per_s: float) -> Comparison:
    """A servo that lags by 40 ms and turns no faster than that, beside a lag alone."""
    way, lagging = command.copy(), command.copy()
    for k in range(1, len(command)):
        step = PERIOD_S * (command[k] - way[k - 1]) / 0.04
        way[k] = way[k - 1] + np.clip(step, -fastest_m_per_s * PERIOD_S, fastest_m_per_s * PERIOD_S)
        lagging[k] = lagging[k - 1] + PERIOD_S * (command[k] - lagging[k - 1]) / 0.04
    channels = (Channel("r", "position_command", "m"), Channel("q", "position", "m"))
    noise = 1e-4 * np.random.default_rng(2).standard_normal(len(way))
    return comparison_with(channels, {"r": command, "q": way + noise}, q=lagging)


def test_a_follower_that_is_too_slow_for_its_steps_has_a_limit_of_speed():
    steps = np.repeat([0.0, 0.4, -0.2, 0.5, 0.1, -0.4, 0.3, 0.0], 250)
    comparison = _followed(steps, 1.5)
    (named,) = diagnosis(comparison).effects
    assert named.id == "drive.saturation"
    assert named.parameters["limit"].value == pytest.approx(1.5, rel=0.15)


def test_a_command_that_is_hardly_faster_than_its_follower_tells_no_limit_of_speed():
    ramps = np.interp(np.arange(2000.0), [0, 300, 800, 1200, 2000], [0.0, 0.4, -0.3, 0.3, -0.2])
    slow, fast = (_followed(ramps, most) for most in (0.5 * float(np.abs(np.diff(ramps)).max()) / PERIOD_S, 9.0))
    limits = [
        [v.shape["limit"].value for v in SATURATION.variants(one, "q") if v.shape["kind"].value == 1.0]
        for one in (slow, fast)
    ]
    assert limits[0]
    assert not limits[1]


@pytest.mark.parametrize("growth_per_m", [0.0, 1.0], ids=["repeats", "repeats and grows"])
def test_a_pitch_error_may_be_counted_from_where_each_run_began(growth_per_m):
    lead_m, begins = 0.010, (0.100, 0.103, 0.109)
    command = np.concatenate([begin + COMMAND - COMMAND[0] for begin in begins])
    n = len(COMMAND)
    wave = 0.3 * np.sin(2.0 * np.pi * command / lead_m + 1.0) + growth_per_m * command
    error = wave - np.repeat(wave[::n], n)
    recorded = {"r": command, "E": error + 0.02 * np.random.default_rng(0).standard_normal(len(command))}
    channels = (Channel("r", "position_command", "m"), Channel("E", "displacement", "um"))
    one = comparison_with(channels, recorded, E=0.1 * np.tile(SPEED, 3))
    runs = replace(one, runs=("r1", "r2", "r3"), starts=(0, n, 2 * n, 3 * n), time_s=np.tile(one.time_s[:n], 3))
    left = {}
    for variant in PITCH_ERROR.variants(runs, "E"):
        if "lead_mm" in variant.shape and variant.shape["power"].value == float(growth_per_m > 0.0):
            base = np.column_stack([variant.columns, np.ones(3 * n), runs.simulated["E"]])
            rest = error - base @ np.linalg.lstsq(base, error)[0]
            kind = "from_start" in variant.shape
            left[kind] = min(left.get(kind, np.inf), float(np.std(rest) / np.std(error)))
    assert left[True] < 0.25
    assert left[False] > 0.3


def test_a_grating_of_a_quarter_millimetre_is_a_pitch_error():
    way = 0.01 * np.linspace(0.0, 1.0, 4000)
    error = 8.0 * np.sin(2.0 * np.pi * way / 0.00025) + np.random.default_rng(0).standard_normal(len(way))
    channels = (Channel("r", "position_command", "m"), Channel("E", "displacement", "um"))
    comparison = comparison_with(channels, {"r": way, "E": error}, E=1e3 * way)
    leads = {
        variant.shape["lead_mm"].value
        for variant in PITCH_ERROR.variants(comparison, "E")
        if "lead_mm" in variant.shape
    }
    # peaks of the spectrum lie on a grid of a 43rd of a turn
    assert min(abs(lead / 0.25 - 1.0) for lead in leads) < 0.01


def test_friction_may_turn_with_the_speed_where_a_force_is_compared():
    friction = np.tanh(SPEED / (0.06 * np.abs(SPEED).max()))
    channels = (Channel("v", "velocity", "m/s"), Channel("F", "force", "N"))
    comparison = comparison_with(channels, {"v": SPEED, "F": SPEED + friction}, F=SPEED)
    columns = [variant.columns[:, 0] for variant in COULOMB.variants(comparison, "F")]
    # the speed is told by the recorded one, smoothed
    assert max(float(np.corrcoef(column, friction)[0, 1]) for column in columns) > 0.999


@pytest.mark.parametrize("lead_mm", [1.93, 2.0, 2.11])
def test_a_lead_is_found_between_the_lines_of_its_spectrum(lead_mm):
    time_s = np.arange(6000) * PERIOD_S
    place_m = 0.03 * np.sin(0.5 * time_s)  # some 30 turns
    error_m = 4e-6 * np.sin(2.0 * np.pi * place_m / (1e-3 * lead_mm))
    noise_m = 3e-7 * np.random.default_rng(2).standard_normal(len(time_s))
    channels = (Channel("command", "position_command", "m", axis="X"), Channel("x", "position", "m", axis="X"))
    made = comparison_with(channels, {"command": place_m, "x": place_m + error_m + noise_m}, x=place_m)
    found = leads(made, "X", of_force=False)
    assert min(abs(1e3 * one / lead_mm - 1.0) for one in found) < 1e-3


def _wound_up(play: float) -> Comparison:
    """Three runs of a table on a screw, its scale less the motor's encoder compared, and the encoder recorded."""
    axis = replace(WITH_FRICTION, feed_forward=0.3)
    channels = (
        Channel("xc", "position_command", "m"),
        Channel("xm", "position", "m"),
        Channel("d", "displacement", "um"),
    )
    parts: dict[str, list[np.ndarray]] = {"xc": [], "xm": [], "d": [], "simulated": []}
    for seed in range(3):
        command = moves(seed)
        true, simulated = (driven(one, command) for one in (replace(axis, play=play), axis))
        parts["xc"].append(command[::20])
        parts["xm"].append(true["m"][::20])
        parts["d"].append(1e6 * (true["x"] - true["m"])[::20])
        parts["simulated"].append(1e6 * (simulated["x"] - simulated["m"])[::20])
    recorded = {name: np.concatenate(of) for name, of in parts.items()}
    recorded["d"] += 0.3 * np.random.default_rng(1).standard_normal(len(recorded["d"]))
    simulated = {"d": recorded.pop("simulated")}
    n = len(parts["xc"][0])
    time = np.tile(np.arange(n) * PERIOD_S, 3)
    held_out = np.arange(3 * n) >= 2 * n
    return Comparison(("r1", "r2", "r3"), (0, n, 2 * n, 3 * n), time, channels, recorded, simulated, ("d",), held_out)


def test_a_wind_up_is_no_following_error():
    wound_up = _wound_up(0.0)
    assert motion(wound_up).sources == ("xc", "xm")


def test_play_is_crossed_where_the_simulated_wind_up_turns_over():
    effects = {effect.id: effect for effect in diagnosis(_wound_up(14e-6)).effects}
    assert effects["drive.backlash"].parameters["lost_motion"].value == pytest.approx(14.0, rel=0.15)


def turning(random: np.random.Generator, ripple: float = 0.0, waves: float = 6.0) -> Comparison:
    """A motor at one speed that wanders, in three runs with an angle that goes on; simulated is that one speed."""
    n, wanders = 900, []
    for _ in range(3):
        slow = np.convolve(random.standard_normal(n + 400), np.hanning(401), "valid")
        wanders.append(4.5 + 0.02 * slow / np.std(slow))
    speed = np.concatenate(wanders)
    angle = np.cumsum(speed) * 5e-3 + np.repeat([0.0, 60.0, 130.0], n)
    turns = speed + ripple * np.sin(2.0 * np.pi * waves * angle)
    angle = np.cumsum(turns) * 5e-3 + np.repeat([0.0, 60.0, 130.0], n)
    seen = turns + 0.003 * random.standard_normal(3 * n)
    channels = (Channel("v", "velocity", "m/s", axis="C"), Channel("angle", "position", "m", axis="C"))
    return Comparison(
        runs=("a", "b", "c"),
        starts=(0, n, 2 * n, 3 * n),
        time_s=np.tile(5e-3 * np.arange(n), 3),
        channels=channels,
        recorded={"v": seen, "angle": angle},
        simulated={"v": np.full(3 * n, 4.5)},
        responses=("v",),
        held_out=np.arange(3 * n) >= 2 * n,
    )


def test_a_speed_that_is_compared_is_no_physics_of_its_own():
    answer = diagnosis(turning(np.random.default_rng(1)))
    assert not [effect.id for effect in answer.effects if effect.id.startswith("drive.")]


@pytest.mark.parametrize("waves", [1.0, 6.0])
def test_a_speed_ripples_along_its_turns_however_many_were_made(waves):
    """Which the angle does as well, being the way of that speed."""
    answer = diagnosis(turning(np.random.default_rng(1), ripple=0.05, waves=waves))
    ripple = next(effect for effect in answer.effects if effect.id == "drive.ripple")
    assert ripple.parameters["lead_mm"].value == pytest.approx(1e3 / waves, rel=0.002)
