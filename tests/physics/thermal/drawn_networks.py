"""Hypothesis strategies: machines as lumped networks, with laws and conditions, of all sizes that occur."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from selector.physics.thermal.network.heat_system import Conditions, FilmLaw, HeatLaw, Laws, Network


def decades(low, high):
    """Numbers between powers of ten, every decade as likely."""
    return st.floats(low, high).map(lambda power: float(10.0**power))


@st.composite
def networks(draw, max_nodes=7):
    """A connected network: a source on the first node at least, air on the last one, coolant on some."""
    n = draw(st.integers(1, max_nodes))
    # a probe's tip to a bed of several tonnes
    capacity, expansion = {}, {}
    for k in range(n):
        capacity[f"n{k}"] = draw(decades(1, 6))
        expansion[f"n{k}"] = {"Z": draw(st.floats(-10, 10))}
    links = [(f"n{k}", f"n{draw(st.integers(0, k - 1))}", draw(decades(-1, 3))) for k in range(1, n)]
    extra = draw(st.lists(st.tuples(st.integers(0, n - 1), st.integers(0, n - 1), decades(-1, 3)), max_size=4))
    links += [(f"n{a}", f"n{b}", g) for a, b, g in extra if a != b]
    wet = draw(st.sets(st.integers(0, n - 1)))
    areas = {"air": {f"n{k}": draw(decades(-2, 1)) for k in sorted(wet | {n - 1})}}
    washed = sorted(draw(st.sets(st.integers(0, n - 1))))
    if washed:
        areas["wash"] = {f"n{k}": draw(decades(-2, 0)) for k in washed}
    share = draw(st.floats(0.05, 0.95))
    friction = {"n0": share, f"n{n - 1}": 1 - share} if n > 1 else {"n0": 1.0}
    return Network(capacity, links, areas, {"friction": friction, "motor": {"n0": 1.0}}, expansion)


@st.composite
def laws_of(draw, network, softening=False):
    """Laws for all sources and films of a drawn network."""
    heat = (
        HeatLaw(
            "friction",
            speed_w=draw(st.floats(0, 500)),
            exponent=draw(st.floats(0.5, 2.0)),
            turning_w=draw(st.floats(0, 100)),
            softening_per_k=draw(st.floats(0.001, 0.03)) if softening else 0.0,
            at="n0" if softening else "",
        ),
        HeatLaw("motor", on_w=draw(st.floats(0, 200)), torque_share=draw(st.floats(0, 0.2))),
    )
    films = [FilmLaw("air", draw(st.floats(1, 15)), draw(st.floats(0, 20)), exponent=0.7)]
    if "wash" in network.area_m2:
        films.append(FilmLaw("wash", draw(st.floats(50, 800)), while_coolant=True, fluid="coolant"))
    return Laws(heat, tuple(films))


@st.composite
def courses(draw, quiet=False):
    """Up to five stretches of seconds to hours; `quiet`: a machine that is off and makes no heat."""
    lengths = draw(st.lists(decades(0.5, 4), min_size=1, max_size=5))
    time = np.r_[0.0, np.cumsum(lengths)]

    def each(values):
        return np.array([draw(values) for _ in time])

    return Conditions(
        time,
        spindle_speed=0.0 if quiet else each(st.sampled_from([0.0, 500.0, 1500.0, 3000.0])),
        torque=0.0 if quiet else each(st.floats(0, 50)),
        ambient_degc=each(st.floats(5, 35)),
        coolant_on=each(st.sampled_from([0.0, 1.0])),
        coolant_degc=each(st.floats(10, 30)),
        machine_on=0.0 if quiet else each(st.sampled_from([0.0, 1.0])),
    )
