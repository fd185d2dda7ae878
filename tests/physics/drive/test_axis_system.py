"""The slow twin says the same as the compiled equations, and what SciPy makes of it is what the kernel makes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from selector.errors import InputError
from selector.physics.drive import simulation
from selector.physics.drive.closed_loop import fastest_rate_per_s, largest_stable_step_s
from selector.physics.drive.kernel import _equations, _kernel, _packed, _stepping
from selector.physics.drive.parts.axis import (
    AxialCompliance,
    Axis,
    AxisState,
    Friction,
    LuGre,
    Ripple,
    Transmission,
    unloaded_state,
)
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import ParameterCourse
from tests.physics.drive.axes import CONTINUOUS, RIGID, RIGID_SERVO, SAMPLED, THREE, sine
from tests.physics.drive.axis_system import AxisSystem, linearise

FRICTION = Friction(
    300.0,
    250.0,
    450.0,
    400.0,
    0.01,
    1.5,
    offset_n=40.0,
    viscous_negative_ns_per_m=90.0,
    screw_coulomb_nm=0.3,
    nut_efficiency=0.88,
)
GUIDE = replace(FRICTION, screw_coulomb_nm=0.0, nut_efficiency=1.0)
BRISTLES = replace(GUIDE, lugre=LuGre(1e7, 1e4, 0.02))
PITCH = Transmission(0.0, 5e-6, 0.7, 1e-4, (-0.02, 0.0, 0.01, 0.03), (1e-6, 0.0, -4e-6, 2e-6))
PLAY = replace(PITCH, backlash_m=2e-5)
RIPPLE = (Ripple(4.0, 0.5, 0.01, 0.2), Ripple(6.0, cogging=0.2, share=0.02))
FORCE = np.linspace(-2e4, 2e4, 21)
SPRING = AxialCompliance(FORCE, FORCE / 3e8 + 2e-6 * np.tanh(FORCE / 3000.0), 2e8, 1.0, 0.4)
LIMITED = replace(CONTINUOUS, command_limit=60.0, speed_limit=500.0, velocity_feedforward=0.8)
AHEAD = replace(CONTINUOUS, velocity_feedforward=0.9, acceleration_feedforward=0.7, feedback="motor")
AXES = {
    "three": Axis(THREE, CONTINUOUS),
    "all of it": Axis(THREE, LIMITED, FRICTION, PLAY, RIPPLE, compliance=SPRING),
    "bristles": Axis(THREE, AHEAD, BRISTLES, PITCH, RIPPLE, compliance=replace(SPRING, both_ends=False)),
    "free": Axis(THREE, None, FRICTION, PLAY),
    "rigid": Axis(RIGID, replace(RIGID_SERVO, velocity_feedforward=1.0), GUIDE),
    "rigid bristles": Axis(
        RIGID, RIGID_SERVO, replace(GUIDE, lugre=LuGre(1e6, 1e3)), PITCH, RIPPLE, ripple_period=0.06
    ),
}
REFERENCE = sine(5e-3, 0.1)
COURSE = ParameterCourse(5e-3, np.linspace(1e8, 2e8, 21), np.linspace(3000.0, 500.0, 21))


def compiled_rates(system: AxisSystem, t_s: float, x: np.ndarray) -> np.ndarray:
    """The rates of the kernel's equations, in the order of the twin's states."""
    axis = system.axis
    p, o = _packed.packed_axis(axis)
    ref = simulation._packed_reference(axis, system.reference, system.course, o)
    p[_packed.PERIOD] = system.reference.period_s
    names = {"motor": 0, "motor_speed": 1, "screw": 2, "screw_speed": 3, "table": 4, "table_speed": 5}
    names |= {"position": 4, "speed": 5, "bristle": 6, "integral": 7}
    at = [names[name] for name in system.states]
    w = _kernel.work_space()
    w[0, at] = x
    o[_packed.GUIDE] = o[_packed.SCREW] = system.slip_direction
    if axis.friction.lugre is not None:
        o[_packed.GUIDE] = 1 if w[0, _packed.V] >= 0 else -1
    i, s = divmod(t_s / system.reference.period_s, 1.0)
    screw = w[0, _packed.X] if system.rigid else w[0, _packed.QL]
    o[_packed.SEGMENT] = _equations.segment(p[_packed.TRAVEL] * screw, p, o)
    for _ in range(4):
        _equations.derivative(w, 0, 5, s, int(i), 0.0, p, o, ref)
        upper, lower = w[_packed.ALSO, _packed.UPPER], w[_packed.ALSO, _packed.LOWER]
        o[_packed.CONTACT] = 1 if upper > 0 else (-1 if lower > 0 else 0)
        if o[_packed.LIMITS]:
            _stepping.changed_limits(w, p, o)
    return w[5, at]


@pytest.mark.parametrize("name", AXES)
@given(data=st.data())
@settings(max_examples=25)
def test_both_say_the_same_about_any_state(name, data):
    axis = AXES[name]
    wide = st.floats(-1.0, 1.0)
    unit = {"motor": 10.0, "motor_speed": 80.0, "screw": 10.0, "screw_speed": 80.0, "table": 0.025, "table_speed": 0.2}
    unit |= {"position": 0.025, "speed": 0.2, "bristle": 4e-5, "integral": 0.5}
    direction = data.draw(st.sampled_from((1, -1))) if axis.friction.lugre is None else 0
    varying = COURSE if axis.compliance is None else replace(COURSE, axial_stiffness_n_per_m=None)
    if name.startswith("rigid"):
        varying = replace(COURSE, axial_stiffness_n_per_m=None)
    system = AxisSystem(axis, REFERENCE, data.draw(st.sampled_from((None, varying))), slip_direction=direction)
    x = np.array([unit[name] * data.draw(wide) for name in system.states])
    if "screw" in system.states:
        # deflections of micrometres, not of millimetres
        x[system.states.index("screw")] = x[system.states.index("table")] / axis.mechanics.travel_per_motion
        x[system.states.index("screw")] += 0.01 * data.draw(wide)
        x[system.states.index("motor")] = x[system.states.index("screw")] + 1e-3 * data.draw(wide)
    if axis.friction.lugre is None:
        # sliding the way it was said to
        at = system.states.index("speed" if name.startswith("rigid") else "table_speed")
        x[at] = direction * abs(x[at])
    t = data.draw(st.floats(0.0, 0.099))
    slow, quick = system.derivative(t, x, np.zeros(2)), compiled_rates(system, t, x)
    # rounding of forces of 1e5 N that nearly cancel, over the least inertia; SciPy's root of the polygon is to 1e-12 N
    assert quick == pytest.approx(slow, rel=1e-9, abs=1e-6)


SMOOTH = {
    "three": (AXES["three"], None),
    "three, varying": (AXES["three"], COURSE),
    "bristles": (Axis(THREE, AHEAD, BRISTLES, replace(PITCH, pitch_position_m=(), pitch_error_m=()), RIPPLE), None),
    "rigid": (Axis(RIGID, RIGID_SERVO), None),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_the_kernel_agrees_with_the_stiff_solver(name):
    axis, course = SMOOTH[name]
    system = AxisSystem(axis, REFERENCE, course)
    x = system.start(unloaded_state(axis, 0.0))
    at = system.states.index("position" if name == "rigid" else "table")
    step_s = 2.5e-5
    motion = simulate_axis(axis, REFERENCE, step_s=step_s, course=course)
    slow = [x[at]]
    # SciPy starts anew at every corner of reference and course
    for begin, end in zip(REFERENCE.time_s[:-1], REFERENCE.time_s[1:], strict=True):
        solved = integrate.solve_ivp(
            lambda t, y: system.derivative(t, y, np.zeros(2)),
            (begin, end),
            x,
            method="Radau",
            rtol=1e-9,
            atol=np.where(np.array(system.states) == "bristle", 1e-14, 1e-11),
        )
        x = solved.y[:, -1]
        slow.append(x[at])
    # a pitch error begins with a table that is not at the reference
    difference = np.abs(motion.table_m - np.array(slow) - (motion.table_m[0] - slow[0])).max()
    # the solver's own tolerances are 1e-11 m a step
    assert difference < 2e-10
    half = simulate_axis(axis, REFERENCE, step_s=step_s / 2, course=course)
    assert np.abs(motion.table_m - half.table_m).max() < 1e-10


def test_linear_axis_is_linearised_exactly():
    system = AxisSystem(Axis(THREE, CONTINUOUS), REFERENCE)
    linear = linearise(system, np.zeros(7), np.zeros(2))
    rng = np.random.default_rng(1)
    x = rng.normal(size=7) * 1e-3
    moved = system.derivative(0.0, x, np.zeros(2)) - system.derivative(0.0, np.zeros(7), np.zeros(2))
    # central differences of linear functions: rounding of 1e8·1e-3 over steps of 6e-6
    assert linear.A @ x == pytest.approx(moved, rel=1e-6, abs=1e-6)
    assert system.states == ("motor", "motor_speed", "screw", "screw_speed", "table", "table_speed", "integral")


@pytest.mark.parametrize("name", AXES)
def test_the_fastest_rate_is_that_of_the_twin(name):
    axis = AXES[name]
    servo = axis.servo and replace(axis.servo, command_limit=None, speed_limit=None)
    free = replace(axis, servo=servo, transmission=replace(axis.transmission, backlash_m=0.0))
    system = AxisSystem(free, REFERENCE)
    linear = linearise(system, system.start(AxisState()), np.zeros(2))
    # the rate leaves the pitch error out, whose slope is 1e-3 of the travel; differences of the spring reach over 6 µm
    assert fastest_rate_per_s(axis) == pytest.approx(np.abs(linear.poles).max(), rel=1e-3)


def test_steps_at_the_limit_of_stability():
    axis = Axis(replace(THREE, torsional_damping_nms_per_rad=0.0, axial_damping_ns_per_m=0.0), CONTINUOUS)
    limit = largest_stable_step_s(axis)
    assert limit == pytest.approx(2.78 / fastest_rate_per_s(axis), rel=1e-12)
    reference = sine(limit * 0.98, 2.0)
    motion = simulate_axis(axis, reference, step_s=limit)
    assert np.abs(motion.table_m).max() < 0.03
    with pytest.raises(InputError) as caught:
        simulate_axis(axis, sine(limit * 1.05, 2.0), step_s=1.0)
    assert "vibration" in caught.value.advice
    assert f"{limit:.3g}" in caught.value.advice


def test_a_sampled_servo_is_not_a_continuous_system():
    with pytest.raises(InputError, match="sampled servo"):
        AxisSystem(Axis(THREE, SAMPLED), REFERENCE)
    assert math.isfinite(largest_stable_step_s(Axis(THREE, SAMPLED)))
    assert largest_stable_step_s(Axis(replace(RIGID, guide_damping_ns_per_m=0.0))) == math.inf
