"""Circles with a rotary axis: planted causes come out, from closed forms and simulated, and what hides is said."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.drive.ball_bar.basis import pair_of, smooth_columns
from selector.physics.drive.ball_bar.causes import circle_causes
from selector.physics.drive.ball_bar.circle import BallBarTrace, PairGeometry, TableBall
from selector.physics.drive.parts.axis import Axis, RigidMechanics, Servo
from tests.physics.drive.ball_bars import BallBarPlan, ball_bar_test

RADIUS_M = 0.1
SAMPLES = 1800
TURN = 2 * math.pi
A_QUARTER = TableBall(0.15)
"""A quarter turn from the bar."""


@dataclass(frozen=True)
class Planted:
    """Errors of three axes in closed form: first-order lags, play, geometry, the ball off its place on the table."""

    table_ball: TableBall = A_QUARTER
    lags_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    squareness_um_per_m: float = 0.0
    scales_um_per_m: tuple[float, float] = (0.0, 0.0)
    backlash_um: float = 0.0
    """Of X."""
    set_up_um: complex = 0.0
    """On the table, where it stands at the start."""
    table_centre_um: complex = 0.0
    start_rad: float = 0.0

    def traces(self, feeds=(1000.0,), noise_um: float = 0.1, seed: int = 0) -> list[BallBarTrace]:
        rng, ball, made = np.random.default_rng(seed), self.table_ball, []
        for feed in feeds:
            pace = feed / 60e3 / RADIUS_M
            for direction in (1, -1):
                turned = direction * np.arange(-SAMPLES, SAMPLES) * TURN / SAMPLES
                x, y = (
                    RADIUS_M * self.follows(turned + self.start_rad, pace * direction, lag, part)
                    + ball.ball_distance_m
                    * self.follows(ball.ratio * turned + ball.ball_angle_rad, ball.ratio * pace * direction, lag, part)
                    for lag, part in zip(self.lags_s[:2], (0, 1), strict=True)
                )
                x = self.with_play(x)
                table = ball.ratio * (turned - direction * pace * self.lags_s[2])
                on_table = (ball.ball_distance_m * np.exp(1j * ball.ball_angle_rad) + self.set_up_um * 1e-6) * np.exp(
                    1j * table
                )
                spindle = (1 + self.scales_um_per_m[0] * 1e-6) * x + self.squareness_um_per_m * 1e-6 * y
                bar = spindle + 1j * (1 + self.scales_um_per_m[1] * 1e-6) * y - on_table - self.table_centre_um * 1e-6
                bar = bar[SAMPLES:]
                deviation = (np.abs(bar) - RADIUS_M) * 1e6 + rng.normal(0, noise_um, SAMPLES)
                made.append(
                    BallBarTrace(
                        np.angle(bar), deviation, direction, feed, RADIUS_M, ("X", "Y", "B"), ball, self.start_rad
                    )
                )
        return made

    @staticmethod
    def follows(angle, pace, lag_s, part):
        """What a first-order loop makes of a steady wave."""
        late = angle - math.atan(pace * lag_s)
        return (np.sin(late) if part else np.cos(late)) / math.hypot(1, pace * lag_s)

    def with_play(self, commanded):
        place, half, followed = commanded[0], self.backlash_um * 0.5e-6, np.empty_like(commanded)
        for number, wanted in enumerate(commanded):
            place = min(max(place, wanted - half), wanted + half)
            followed[number] = place
        return followed


EVERYTHING = Planted(
    lags_s=(0.024, 0.025, 0.0255),
    squareness_um_per_m=30.0,
    scales_um_per_m=(-12.0, 5.0),
    backlash_um=6.0,
    set_up_um=3.0 - 2.0j,
    table_centre_um=4.0 + 7.0j,
    start_rad=0.3,
)


@pytest.mark.parametrize("ratio", [1.0, 2.0, 0.5])
def test_planted_causes_come_out(ratio):
    planted = replace(EVERYTHING, table_ball=TableBall(0.15, -1.2, ratio))
    found = circle_causes(planted.traces((1000.0, 3000.0)))
    expected = {
        "squareness": 30.0,
        "scale mismatch": -17.0,
        "difference of the lag times": -1.0,
        "lag time of B over that of the others": 1.0,
        "backlash X, positive end": 6.0,
        "backlash X, negative end": 6.0,
        "backlash Y, positive end": 0.0,
        "backlash Y, negative end": 0.0,
    }
    for name, truth in expected.items():
        amount = found.through_feeds[name]
        # 4.5 standard errors; lags of 125 µm have second-order parts of (ωT)², 1.6e-4 of themselves, and what stands
        # across the bar, up to 40 µm, of 40²/(2·R) = 8e-3 µm or 0.1 µm/m
        assert abs(amount.value - truth) <= 4.5 * amount.standard_error + 2e-3 * abs(truth) + 0.15, (name, amount)
        assert amount.found == (truth != 0), name
    assert all(cause.found for cause in found.feeds[0].causes[:5])
    assert found.feeds[0].remaining_rms_um == pytest.approx(0.1, rel=0.1)


def test_centre_of_the_table_and_set_up_are_no_errors_of_the_machine():
    feed = circle_causes(Planted(set_up_um=3.0 - 2.0j, table_centre_um=4.0 + 7.0j).traces()).feeds[0]
    # the spindle against the table's centre
    assert feed.centre["X"].value == pytest.approx(-4.0, abs=0.02)
    assert feed.centre["Y"].value == pytest.approx(-7.0, abs=0.02)
    # along the bar, which stands still on a table of ratio 1, the set-up is a shorter bar
    assert (feed.causes[0].kind, feed.causes[0].found) == ("radius", True)
    assert feed.cause("radius").amounts["radius"].value == pytest.approx(-3.0, abs=0.02)
    assert not [cause for cause in feed.causes[1:] if cause.found]


@pytest.mark.parametrize("seed", range(4))
def test_noise_alone_names_nothing(seed):
    found = circle_causes(Planted().traces(noise_um=1.0, seed=seed)).feeds[0]
    assert not [cause.kind for cause in found.causes if cause.found]


def test_what_the_place_of_the_ball_hides_is_said():
    aside, in_line, against = (
        {finding.id for finding in circle_causes(Planted(ball).traces()).findings}
        for ball in (TableBall(0.15), TableBall(0.15, 0.0), TableBall(0.15, ratio=-1.0))
    )
    assert "ball-bar-rotary-lag-hidden" in in_line - aside
    assert "ball-bar-set-up-turns" in aside & in_line
    # a table that turns against the bar: the set-up is an oval
    assert "ball-bar-alike" in against
    assert "set-up" not in " ".join(against)


def test_circles_without_a_place_of_the_ball_are_refused():
    traces = [replace(one, table_ball=None) for one in Planted().traces()]
    with pytest.raises(InputError, match="rotary"):
        circle_causes(traces)


def test_a_ball_at_the_centre_of_the_table_is_a_plain_circle():
    planted = replace(EVERYTHING, table_ball=TableBall(0.0), start_rad=0.0)
    plain = pair_of([replace(one, axes=("X", "Y"), table_ball=None) for one in planted.traces()])
    turned = pair_of(planted.traces())
    cos, sin, d = np.cos(plain.angle_rad), np.sin(plain.angle_rad), plain.direction
    double = 2 * plain.angle_rad
    closed = {
        "scale-mismatch": np.cos(double),
        "squareness": np.sin(double),
        "gain-mismatch": d * np.sin(double),
        "straightness 0": np.sin(3 * plain.angle_rad) / 4,
        "straightness 1": -np.cos(3 * plain.angle_rad) / 4,
    }
    for name, column in closed.items():
        for pair in (plain, turned):
            # rounding
            np.testing.assert_allclose(smooth_columns(pair)[name], column, atol=1e-12)
    for pair in (plain, turned):
        for axis, ends in enumerate(((0.0, math.pi), (math.pi / 2, 1.5 * math.pi))):
            for arc, end in zip(pair.courses[axis].since_reversal_rad, ends, strict=True):
                away = (arc - d * (pair.angle_rad - end) + 1e-6) % TURN - 1e-6
                np.testing.assert_allclose(away, 0, atol=1e-9)
        np.testing.assert_allclose(pair.courses[0].gone, _gone(d * sin, cos), atol=1e-9)


def _gone(rising, place):
    """Travel of cos θ since its last end, from the sign of d·sin θ: it comes from 1 while that is positive."""
    return np.where(rising > 0, 1 - place, 1 + place)


def test_simulated_axes_show_what_they_have():
    servo = Servo(40.0, 400.0, 8000.0, actuator_gain=60.0)
    axes = {
        "X": Axis(RigidMechanics(300.0, 500.0), servo),
        "Y": Axis(RigidMechanics(300.0, 500.0), replace(servo, position_gain_per_s=38.0)),
        "B": Axis(RigidMechanics(12.0, 20.0), replace(servo, velocity_gain=16.0, velocity_integral_gain=320.0)),
    }
    plan = BallBarPlan(0.05, (1500.0, 3000.0), table_ball=TableBall(0.08), noise_um=0.05)
    found = circle_causes(ball_bar_test(axes, PairGeometry(30.0, (-12.0, 5.0)), plan, step_s=1e-3)).through_feeds
    assert found["squareness"].value == pytest.approx(30.0, abs=0.5)
    assert found["scale mismatch"].value == pytest.approx(-17.0, abs=0.5)
    # a loop with an integrator lags by 1/Kv; the next order at 1/s is (ω/Kv)² of that, 6e-4
    assert found["difference of the lag times"].value == pytest.approx(1e3 / 40 - 1e3 / 38, rel=0.01)
    assert found["lag time of B over that of the others"].value == pytest.approx(0.5 * (25 - 1e3 / 38), rel=0.02)
