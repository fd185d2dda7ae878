from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.physics.thermal.network.heat_system import (
    Conditions,
    FilmLaw,
    HeatLaw,
    Laws,
    Lubricants,
    film_coefficients,
    fluid_degc,
    heat_parts,
)

STAGES = Conditions(
    [0.0, 10.0, 20.0, 30.0],
    spindle_speed=[0.0, 1000.0, 2000.0, -2000.0],
    torque=[5.0, 0.0, 30.0, 30.0],
    ambient_degc=[18.0, 19.0, 20.0, 21.0],
    coolant_on=[0.0, 0.0, 1.0, 1.0],
    coolant_degc=25.0,
    machine_on=[0.0, 1.0, 1.0, 1.0],
)


def test_every_part_of_the_heat_law():
    law = HeatLaw(
        "q",
        on_w=7.0,
        turning_w=11.0,
        coolant_w=13.0,
        speed_w=100.0,
        reference_rpm=500.0,
        exponent=1.5,
        torque_share=0.2,
    )
    power = 0.2 * 30.0 * 2 * np.pi * 2000 / 60
    expected = [0.0, 7 + 11 + 100 * 2**1.5, 7 + 11 + 13 + 100 * 4**1.5 + power, 7 + 11 + 13 + 100 * 4**1.5 + power]
    # a few roundings
    np.testing.assert_allclose(sum(heat_parts(Laws((law,), ()), STAGES))[:, 0], expected, rtol=1e-14)


def test_a_standing_spindle_makes_no_heat_whatever_the_exponent():
    for exponent in (0.0, 0.5, 3.0):
        law = HeatLaw("q", speed_w=100.0, exponent=exponent)
        film = FilmLaw("f", 3.0, 100.0, exponent=exponent)
        assert sum(heat_parts(Laws((law,), ()), STAGES))[0, 0] == 0.0
        assert film_coefficients(Laws((), (film,)), STAGES)[0, 0] == 3.0


def test_heat_falls_as_the_lubricant_warms():
    law = HeatLaw("q", on_w=5.0, speed_w=100.0, softening_per_k=0.02, softening_degc=30.0, at="T")
    firm, nominal = heat_parts(Laws((law,), ()), STAGES)
    np.testing.assert_allclose(firm[:, 0], [0.0, 5.0, 5.0, 5.0], rtol=1e-14)
    lubricants = Lubricants(np.eye(1), np.array([law.softening_per_k]), np.array([law.softening_degc]))
    found = [lubricants.heat_w(*at)[0] for at in zip(nominal, [80.0, 30.0, 65.0, 30.0], strict=True)]
    np.testing.assert_allclose(found, [0.0, 100.0, 200 * np.exp(-0.7), 200.0], rtol=1e-14)


def test_films_and_their_fluids():
    laws = Laws(
        (),
        (
            FilmLaw("walls", 10.0, 4.0, exponent=0.5),
            FilmLaw("table", 300.0, while_coolant=True, fluid="coolant"),
            FilmLaw("feet", 50.0, fluid="fixed", fixed_degc=17.0),
        ),
    )
    root = np.sqrt(2.0)
    np.testing.assert_allclose(
        film_coefficients(laws, STAGES),
        [[10, 0, 50], [14, 0, 50], [10 + 4 * root, 300, 50], [10 + 4 * root, 300, 50]],
        rtol=1e-14,
    )
    np.testing.assert_array_equal(fluid_degc(laws, STAGES), [[18, 25, 17], [19, 25, 17], [20, 25, 17], [21, 25, 17]])


def test_no_laws_make_empty_tables():
    assert [part.shape for part in heat_parts(Laws((), ()), STAGES)] == [(4, 0), (4, 0)]
    assert film_coefficients(Laws((), ()), STAGES).shape == (4, 0)


def test_rows_do_not_influence_each_other():
    laws = Laws((HeatLaw("q", on_w=1.0, speed_w=3.0, exponent=1.3),), (FilmLaw("f", 1.0, 2.0, exponent=0.7),))
    for k in range(3):
        pair = Conditions(**{name: values[k : k + 2] for name, values in vars(STAGES).items()})
        np.testing.assert_array_equal(sum(heat_parts(laws, pair))[0], sum(heat_parts(laws, STAGES))[k])
        np.testing.assert_array_equal(film_coefficients(laws, pair)[0], film_coefficients(laws, STAGES)[k])


@given(data=st.data())
@settings(max_examples=75)
def test_lubricants_settle_wherever_they_start(data):
    """Up to three lubricants that warm each other, from hardly softening to far beyond anything real."""
    k = data.draw(st.integers(1, 3))

    def numbers(low, high, shape):
        count = int(np.prod(shape))
        return np.array(data.draw(st.lists(st.floats(low, high), min_size=count, max_size=count))).reshape(shape)

    lubricants = Lubricants(np.eye(k), numbers(0.001, 0.1, k), numbers(-30.0, 30.0, k))
    nominal, without = numbers(0.0, 1000.0, k), numbers(-20.0, 200.0, k)
    # a response of a passive body: symmetric, not negative, its diagonal the largest
    cross = numbers(0.0, 0.05, (k, k))
    per_watt = 0.5 * (cross + cross.T) + np.diag(numbers(0.05, 1.0, k))
    heat = lubricants.settled_heat_w(nominal, without, per_watt)
    np.testing.assert_allclose(lubricants.heat_w(nominal, without + per_watt @ heat), heat, rtol=1e-9, atol=1e-9)


def test_conditions_are_read_only_copies():
    speed = np.array([1.0, 2.0])
    conditions = Conditions([0.0, 1.0], spindle_speed=speed)
    speed[0] = 99.0
    assert conditions.spindle_speed[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        conditions.spindle_speed[0] = 5.0
