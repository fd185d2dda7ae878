from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.drive.parts.stiffness import PreloadedContact, axial_load_per_deflection, groove_approach

contacts = st.builds(PreloadedContact, st.floats(1e10, 1e14), st.floats(10.0, 1e5))


@given(contacts, st.floats(-20.0, 20.0))
def test_closed_form_obeys_the_law_of_two_hertz_contacts(contact, times_preload):
    load = times_preload * contact.preload_n
    deflection, start = float(contact.deflection_m(load)), contact.preload_deflection_m
    kappa = contact.load_per_deflection
    one, other = max(start + deflection, 0.0), max(start - deflection, 0.0)
    # closed form and law are a dozen operations apart; near 0 the law is a difference of two preloads
    assert kappa * (one**1.5 - other**1.5) == pytest.approx(load, rel=1e-9, abs=1e-9 * contact.preload_n)
    assert contact.deflection_m(-load) == -deflection


@given(contacts, st.floats(0.0, 20.0))
def test_stiffness_is_the_slope(contact, times_preload):
    load, step = times_preload * contact.preload_n, 1e-4 * contact.preload_n
    slope = 2.0 * step / float(contact.deflection_m(load + step) - contact.deflection_m(load - step))
    # central difference over 2e-4 of the preload; next to the release the slope has a square root in it
    near = abs(load - contact.release_n) < 0.1 * contact.preload_n
    assert float(contact.stiffness_n_per_m(load)) == pytest.approx(slope, rel=2e-2 if near else 1e-5)


def test_preload_stiffens_release_softens_and_then_hertz_alone():
    contact = PreloadedContact(2e12, 3000.0)
    unloaded = float(contact.stiffness_n_per_m(0.0))
    # exact in the algebra, so to rounding
    assert unloaded == pytest.approx(3.0 * 2e12 ** (2 / 3) * 3000.0 ** (1 / 3), rel=1e-12)
    assert contact.release_n == pytest.approx(2**1.5 * 3000.0)
    assert float(contact.stiffness_n_per_m(contact.release_n)) == pytest.approx(unloaded / math.sqrt(2.0), rel=1e-7)
    beyond = contact.stiffness_n_per_m(np.array([2.0, 16.0]) * contact.release_n)
    assert beyond[1] / beyond[0] == pytest.approx(2.0, rel=1e-12)
    again = PreloadedContact.from_rigidity(unloaded, 3000.0, 1000.0)
    assert (again.load_per_deflection, again.preload_n) == (pytest.approx(2e12, rel=1e-12), 1000.0)


@pytest.mark.parametrize(("ball_mm", "pitch_mm", "angle_deg"), [(7.144, 46.4, 60.0), (6.35, 41.4, 45.0)])
@pytest.mark.parametrize("conformity", [0.515, 0.52, 0.53, 0.56])
def test_approach_agrees_with_approximate_hertz(ball_mm, pitch_mm, angle_deg, conformity):
    # Brewe and Hamrock (1977): ellipticity and integrals fitted by simple expressions, good to about 3 %
    gamma = ball_mm * math.cos(math.radians(angle_deg)) / pitch_mm
    elastic = 206e9 / (1.0 - 0.3**2)
    expected = 0.0
    for sign in (1.0, -1.0):
        rolling = 2.0 / ball_mm + sign * 2.0 * gamma / (ball_mm * (1.0 - sign * gamma))
        across = 2.0 / ball_mm - 1.0 / (conformity * ball_mm)
        ratio, total = rolling / across, (rolling + across) * 1e3
        axes = 1.0339 * ratio**0.6360
        second = 1.0003 + 0.5968 / ratio
        first = 1.5277 + 0.6023 * math.log(ratio)
        expected += first * (9.0 / (2.0 * second / total) * (1.0 / (math.pi * axes * elastic)) ** 2) ** (1.0 / 3.0)
    found = groove_approach(ball_mm * 1e-3, conformity, pitch_mm * 1e-3, math.radians(angle_deg), 206e9)
    assert found == pytest.approx(expected, rel=0.03)


def test_approach_agrees_with_the_constant_of_bearing_catalogues():
    # catalogues of angular-contact bearings print δ = 0.00044/sin α·(Q²/D)^(1/3) [mm, N] for grooves of about 0.52
    found = groove_approach(7.144e-3, 0.52, 46.4e-3, math.radians(60.0), 206e9) * 1e3 * 7.144 ** (1 / 3)
    assert found == pytest.approx(0.00044, rel=0.05)


@pytest.mark.parametrize(
    ("preload_n", "pitch_mm", "balls", "printed_n_per_um"),
    [
        (3350.0, 46.4, 18, 1030.0),
        (3800.0, 56.3, 20, 1180.0),
        (3900.0, 56.3, 21, 1230.0),
        (7650.0, 56.3, 2 * 20, 2350.0),
        (7850.0, 56.3, 2 * 21, 2400.0),
    ],
    ids=["30 DF", "35 DF", "40 DF", "35 DFF", "40 DFF"],
)
def test_printed_rigidities_of_screw_bearings(preload_n, pitch_mm, balls, printed_n_per_um):
    # HIWIN WBK units with 60° bearings (table 8.12); the balls are not printed: 9/32", as many as fit the printed
    # permissible axial load of 43, 50 and 52 kN by ISO 76 (f0 = 55.3…56.8), which is known to one ball, 4 % here
    approach = groove_approach(7.144e-3, 0.52, pitch_mm * 1e-3, math.radians(60.0), 206e9)
    contact = PreloadedContact(axial_load_per_deflection(approach, balls, math.radians(60.0)), preload_n)
    assert float(contact.stiffness_n_per_m(0.0)) * 1e-6 == pytest.approx(printed_n_per_um, rel=0.04)


@pytest.mark.parametrize(("kappa", "preload"), [(0.0, 1.0), (1e12, 0.0), (1e12, -5.0), (float("nan"), 1.0)])
def test_contacts_that_cannot_be(kappa, preload):
    with pytest.raises(InputError):
        PreloadedContact(kappa, preload)
