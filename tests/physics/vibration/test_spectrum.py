"""Lines of sources at given speeds."""

from __future__ import annotations

import cmath
import math

from selector.physics.vibration.structure import excitation
from tests.physics.vibration.small_lathe import SOURCES, SPINDLE


def test_one_row_a_line_in_the_order_of_the_sources():
    found = excitation(SOURCES, {"spindle": 1200.0})
    # 1200 r/min are 20 turns a second
    assert found.frequency_hz.tolist() == [20.0, 9.3 * 20.0, 50.0, 20.0]
    assert found.source.tolist() == [0, 0, 1, 1]
    assert found.line.tolist() == [0, 1, 0, 1]
    assert found.order == (1.0, 9.3, None, 1.0)
    assert found.shaft == ("spindle", "spindle", None, "spindle")
    assert found.sources == ("spindle", "motor")


def test_force_is_amplitude_with_phase_and_unbalance_grows_with_the_square_of_the_speed():
    slow, quick = (excitation(SOURCES, {"spindle": rpm}) for rpm in (600.0, 1200.0))
    # 1e-14: a few roundings of numbers of size 1 to 20
    assert abs(quick.force_n[0] - 1e-4 * (2 * math.pi * 20.0) ** 2) < 1e-14
    assert abs(quick.force_n[0] - 4.0 * slow.force_n[0]) < 1e-14
    assert abs(quick.force_n[1] - 20.0 * cmath.exp(0.7j)) < 1e-14


def test_a_shaft_at_standstill_shakes_nothing():
    found = excitation(SOURCES, {"spindle": 0.0})
    assert found.frequency_hz.tolist() == [50.0]
    assert found.sources == ("spindle", "motor")
    assert len(excitation((SPINDLE,), {"spindle": 0.0}).force_n) == 0


def test_rows_alone():
    found = excitation(SOURCES, {"spindle": 1200.0}).only([1, 2])  # type: ignore[arg-type]
    assert found.order == (9.3, None)
    assert found.frequency_hz.tolist() == [186.0, 50.0]
