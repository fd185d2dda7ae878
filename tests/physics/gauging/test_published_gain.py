"""The published line: its Fourier series by quadrature, its derivation by SymPy, how far it is from the simulation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import sympy

from selector.errors import InputError
from selector.physics.gauging.characteristic import characteristic, steady_swing
from selector.physics.gauging.transducer import Generator
from tests.physics.gauging.examples import TRANSDUCER
from tests.physics.gauging.published_line import flux_harmonic_wb, published_gauge
from tests.physics.gauging.test_steady_swing import tuned


@pytest.mark.parametrize(("amplitude", "centre"), [(1e-9, 0.0), (1.7e-4, 3e-5), (9e-4, -2e-4)])
def test_the_first_harmonic_of_the_flux_is_that_of_quadrature(amplitude, centre):
    generator = TRANSDUCER.generator
    phase = np.linspace(0.0, 2 * np.pi, 4096, endpoint=False)

    def harmonic(a):
        flux = generator.flux_wb * generator.gap_m / (generator.gap_m - centre - a * np.sin(phase))
        return 2 * (flux * np.sin(phase)).mean()

    found, slope = flux_harmonic_wb(generator, amplitude, centre)
    # means of 4096 points of a periodic function: rounding of a flux of 3e-5 Wb
    assert found == pytest.approx(harmonic(amplitude), rel=1e-9, abs=1e-19)
    step = 1e-4 * amplitude
    # central differences of it: 1e-8 of curvature; rounding of 1e-20 Wb over the step
    measured = (harmonic(amplitude + step) - harmonic(amplitude - step)) / (2 * step)
    assert slope == pytest.approx(measured, rel=1e-5, abs=1e-20 / step)


def test_the_closed_form_follows_from_the_flux_law():
    """G eq. 15–17: the integral of the harmonic, and its derivative."""
    b, a, psi = sympy.symbols("b a psi", positive=True)
    # ∫ sin²/(b − a sin)… in powers of a/b, term by term, against the closed form
    series = sympy.series(1 / (1 - a * sympy.sin(psi)), a, 0, 9).removeO()
    harmonic = sympy.integrate(sympy.expand(series * sympy.sin(psi)), (psi, 0, 2 * sympy.pi)) / sympy.pi
    closed = 2 / a * (1 / sympy.sqrt(1 - a**2) - 1)
    assert sympy.simplify(harmonic - sympy.series(closed, a, 0, 9).removeO()) == 0
    with_gap = 2 / a * (b / sympy.sqrt(b**2 - a**2) - 1)
    slope = sympy.diff(with_gap, a)
    values = {b: sympy.Rational(7, 5), a: sympy.Rational(2, 5)}
    generator = Generator(turns=1.0, flux_wb=1 / 1.4, gap_m=1.4)
    found = flux_harmonic_wb(generator, 0.4)
    # the same numbers but for rounding
    assert found == pytest.approx((float(with_gap.subs(values)), float(slope.subs(values))), rel=1e-13)


def test_a_swing_across_the_gap_is_refused():
    with pytest.raises(InputError, match=r"generator\.gap_m"):
        flux_harmonic_wb(TRANSDUCER.generator, 2e-3)


def test_a_coil_without_time_constant_is_no_slow_one():
    fast = replace(TRANSDUCER, generator=replace(TRANSDUCER.generator, time_constant_s=0.0))
    with pytest.raises(InputError, match=r"generator\.time_constant_s"):
        published_gauge(fast)
    assert published_gauge(fast, slow_coil=False).gain_v_per_um < 0


def test_with_a_slow_coil_both_forms_agree():
    slow = replace(TRANSDUCER, generator=replace(TRANSDUCER.generator, time_constant_s=0.2))
    published, exact = (published_gauge(slow, slow_coil=taken) for taken in (True, False))
    # 1 − 1/√(1 + 1/(2ω0·T_Γ)²) at 2ω0·T_Γ = 126
    assert exact.gain_v_per_um / published.gain_v_per_um == pytest.approx(1 - 1 / (2 * 125.66**2), rel=1e-6)


def test_the_voltage_at_the_first_touch_is_that_of_the_free_swing():
    line = published_gauge(TRANSDUCER, slow_coil=False)
    free = steady_swing(TRANSDUCER, None)
    at_touch = line.bias_v + line.gain_v_per_um * line.allowance_um
    # what harmonics of flux and swing give beside the first: seen 0.3 %
    assert at_touch == pytest.approx(free.voltage_v, rel=5e-3)


def test_how_far_the_published_gain_is_off_in_the_example():
    """Numbers of docs/explanation/vibrating-contact-gauge.md."""
    true = float(characteristic(TRANSDUCER).slope_at(0.0))
    # as published the coil integrates at all frequencies: √(1 + (2ω0·T_Γ)²)/(2ω0·T_Γ) = 1.28 of it
    assert published_gauge(TRANSDUCER).gain_v_per_um / true == pytest.approx(1.24, abs=0.01)
    assert published_gauge(TRANSDUCER, slow_coil=False).gain_v_per_um / true == pytest.approx(0.97, abs=0.01)


def amplitudes(ratio: float, quality: float, shares: list[float]) -> list[float]:
    """Amplitudes over the free one where the allowance takes these shares of it."""
    gauge = tuned(ratio, quality)
    free = steady_swing(gauge, None)
    touch_um, swing = 1e6 * gauge.rest_gap_m - free.highest_um, None
    found = []
    for share in shares:
        swing = steady_swing(gauge, touch_um + share * free.stroke_um / 2, start=swing.state if swing else free.state)
        found.append(swing.stroke_um / free.stroke_um)
    return found


def test_amplitude_falls_like_the_allowance_near_the_resonance():
    # A = A0 − x, to 1 % of A0: contact that gives in by 1 % of A0, a mean that gives way by A0/2Q·√(1 − (A/A0)²)
    assert amplitudes(1.0, 25.0, [0.1, 0.4]) == pytest.approx([0.9, 0.6], abs=0.01)


def test_amplitude_grows_at_first_where_the_pull_is_faster_than_the_resonance():
    """The contact stiffens the probe and brings its resonance up to the pull."""
    assert amplitudes(0.8, 10.0, [0.05])[0] > 1.1


def test_a_stiff_probe_loses_one_side_of_its_swing_only():
    """Far below the resonance the tip follows the pull: only the upper turn is cut off, A = A0 − x/2 at most."""
    quarter = amplitudes(4.0, 5.0, [0.4])[0]
    assert quarter == pytest.approx(1 - 0.4 / 2, abs=0.03)
    assert math.isfinite(quarter)
