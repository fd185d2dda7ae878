"""Model files of feed drives: what is read, and what is refused with which key."""

from __future__ import annotations

import copy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from selector.errors import InputError, ModelFileError
from selector.physics.drive.drive_model import drive_model
from selector.physics.drive.model_file import checked_model_file, columns_needed, parsed_model_file, read_model_file
from selector.physics.drive.model_schema import INSTEAD, OFF, file_axis, parts_of
from selector.physics.drive.parts.catalogue import thc6350_servo, thc6350_x_axis
from selector.physics.drive.parts.stiffness import three_mass_mechanics
from selector.physics.model_text import plain_values
from selector.physics.thermal.model_file import read_model_file as read_thermal_model_file
from tests.work import counted_calls

EXAMPLES = Path(__file__).resolve().parents[3] / "fixtures" / "drive"
RIGID = {
    "model": {"kind": "drive", "name": "one mass"},
    "motion": {"kind": "sine", "amplitude_mm": 10.0, "frequency_hz": 2.0, "duration_s": 0.5},
    "axes": {
        "X": {
            "mechanics": {"kind": "rigid", "mass_kg": 100.0, "guide_damping_ns_per_m": 200.0},
            "servo": {"position_gain_per_s": 50.0, "velocity_gain": 20000.0, "sample_s": 0.001},
        }
    },
}
MOVES = {"kind": "moves", "targets_mm": [10.0], "feed_mm_per_min": 6000.0, "acceleration_m_per_s2": 2.0}
PARTS = {**RIGID["axes"]["X"], "parts": {"like": "thc6350-x"}, "varying": "constant"}
del PARTS["mechanics"]
CIRCLE = {"kind": "circle", "axes": ["X", "Y"], "feeds_mm_per_min": [1000.0]}


def changed(values: dict, *changes: tuple[str, object]) -> dict:
    """The sections with other values at dotted keys; `...` takes a key away."""
    values = copy.deepcopy(values)
    for key, value in changes:
        *way, last = key.split(".")
        here = values
        for part in way:
            here = here.setdefault(part, {})
        if value is ...:
            del here[last]
        else:
            here[last] = copy.deepcopy(value)
    return values


def refusal(*changes: tuple[str, object]) -> ModelFileError:
    with pytest.raises(ModelFileError) as caught:
        checked_model_file(changed(RIGID, *changes))
    return caught.value


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_examples_are_read_and_come_back_from_their_plain_values(path):
    file = read_model_file(path)
    assert checked_model_file(plain_values(file)) == file
    if not columns_needed(file):
        assert drive_model(file).parameters


@pytest.mark.parametrize(
    ("key", "value", "where"),
    [
        ("axes.X.mechanics.mass_kg", -1.0, "key axes.X.mechanics.mass_kg"),
        ("axes.X.mechanics.mas_kg", 1.0, "key axes.X.mechanics.mas_kg"),
        ("axes.X.mechanics.kind", "rigit", "key axes.X.mechanics.kind"),
        ("axes.X.mechanics", ..., "key axes.X"),
        ("axes.X.parts", {"like": "thc6350-x"}, "key axes.X"),
        ("axes.X.varying", "state", "key axes.X.varying"),
        ("axes.X.servo.position_gain_per_s", 0.0, "key axes.X.servo.position_gain_per_s"),
        ("axes.X.servo.feedback", "tabel", "key axes.X.servo.feedback"),
        ("axes.X.servo", ..., "key axes.X.servo"),
        ("axes.X.transmission.backlash_m", 1e-5, "key axes.X.transmission.backlash_m"),
        ("axes.X.friction.screw_coulomb_nm", 1.0, "key axes.X.friction.screw_coulomb_nm"),
        ("axes.X.friction.coulomb_n", float("nan"), "key axes.X.friction.coulomb_n"),
        ("axes.X.friction.lugre", {"stiffness_n_per_m": 0.0}, "key axes.X.friction.lugre.stiffness_n_per_m"),
        ("axes.X.mechanics.mass_kg", 1e-300, "key axes.X.mechanics.mass_kg"),
        ("axes.X.servo.velocity_feedforward", 1e15, "key axes.X.servo.velocity_feedforward"),
        ("axes.X.servo.sample_s", 1e-9, "key axes.X.servo.sample_s"),
        ("axes.X.servo.delay_s", 1.0, "key axes.X.servo.delay_s"),
        ("axes.X.sensing", {"speed_from_encoder": True, "speed_samples": 301}, "key axes.X.sensing.speed_samples"),
        ("axes.X.transmission.pitch_slope", -1.0, "key axes.X.transmission.pitch_slope"),
        ("axes.X.transmission.pitch_amplitude_m", 2.0, "key axes.X.transmission"),
        ("run.period_s", 0.2, "key run.period_s"),
        ("motion.duration_s", 1e-3, "key motion"),
        ("axes.X.ripple", [{"harmonic": 1.0}, {"harmonic": -2.0}], "key axes.X.ripple[2].harmonic"),
        ("axes.X.transmission.pitch_position_m", [0.0, 1.0], "key axes.X.transmission.pitch_position_m"),
        ("axes.X Y", {}, 'key axes."X Y"'),
        ("axes", {}, "key axes"),
        ("motion.axis", "Y", "key motion.axis"),
        ("motion.kind", "sin", "key motion.kind"),
        ("motion.duration_s", 1e5, "key run.period_s"),
        ("run.step_s", 1e-8, "key run.step_s"),
        ("motion.force_n", [[0.5, 10.0]], "key motion.force_n"),
        ("motion", {**MOVES, "feed_mm_per_min": -1.0}, "key motion.feed_mm_per_min"),
        ("motion", {**MOVES, "targets_mm": [0.0]}, "key motion"),
        ("motion", {**MOVES, "repeat": 10_000, "targets_mm": [1.0, 2.0, 3.0]}, "key motion.repeat"),
        ("motion", {**MOVES, "acceleration_m_per_s2": 1e-9}, "key run.period_s"),
        ("motion", CIRCLE, "key motion.axes[2]"),
        ("ball_bar", {}, "key ball_bar"),
        ("bounds", {"axes.X.mechanics.mass_kg": [2.0, 1.0]}, 'key bounds."axes.X.mechanics.mass_kg"'),
        ("model.kind", "network", "key model.kind"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_cannot_be_is_refused_with_its_key(key, value, where):
    said = refusal((key, value))
    assert said.where == f"model file, {where}"
    assert said.found
    assert said.expected
    assert said.advice


def test_what_a_sampled_control_needs():
    for key, value in (("servo.delay_s", 0.001), ("sensing", {"motor_resolution": 1e-6})):
        continuous = ("axes.X.servo.sample_s", 0.0), (f"axes.X.{key}", value)
        assert refusal(*continuous).where == f"model file, key axes.X.{key}"
        assert checked_model_file(changed(RIGID, continuous[1]))


def test_circles_need_two_axes_that_slide_and_a_ball_on_the_third():
    rotary = changed(RIGID, ("axes.X.mechanics.kind", "rotary"))["axes"]["X"]
    two = (("motion", CIRCLE), ("axes.Y", RIGID["axes"]["X"]))
    assert checked_model_file(changed(RIGID, *two))
    assert checked_model_file(changed(RIGID, *two, ("ball_bar.squareness_um_per_m", 10.0)))
    assert refusal(*two, ("ball_bar.bow_um", [1.0])).where.endswith("key ball_bar.bow_um[2]")
    assert refusal(*two, ("motion.axes", ["X", "X"])).where.endswith("key motion.axes")
    assert refusal(*two, ("motion.table_ball", {"distance_mm": 10.0})).where.endswith("key motion.table_ball")
    assert refusal(("motion", CIRCLE), ("axes.Y", rotary)).where.endswith("key motion.axes[2]")
    three = (*two, ("axes.B", rotary), ("motion.axes", ["X", "Y", "B"]))
    assert refusal(*three).where.endswith("key motion.table_ball")
    assert checked_model_file(changed(RIGID, *three, ("motion.table_ball", {"distance_mm": 10.0})))


def test_of_several_axes_one_is_named_for_other_motions():
    assert refusal(("axes.Y", RIGID["axes"]["X"])).where.endswith("key motion.axis")
    file = checked_model_file(changed(RIGID, ("axes.Y", RIGID["axes"]["X"]), ("motion.axis", "Y")))
    assert list(drive_model(file).axes) == ["Y"]
    rotary = ("axes.X.mechanics.kind", "rotary")
    assert refusal(rotary).where.endswith("key motion.axis")


# parts


def test_parts_are_those_that_are_named_or_all_said():
    short = checked_model_file(changed(RIGID, ("axes.X", {**PARTS, "parts": "thc6350-x"})))
    assert parts_of(short.axes["X"].parts) == thc6350_x_axis()
    heavier = checked_model_file(changed(RIGID, ("axes.X", PARTS), ("axes.X.parts.table.mass_kg", 2000.0)))
    made = parts_of(heavier.axes["X"].parts)
    assert made.table.mass_kg == 2000.0
    assert made.screw == thc6350_x_axis().screw


def test_parts_without_a_name_are_said_in_full():
    whole = {name: dict(vars(part)) for name, part in vars(thc6350_x_axis()).items()}
    for part in whole.values():
        for key in [key for key, value in part.items() if value is None]:
            del part[key]
    file = checked_model_file(changed(RIGID, ("axes.X", {**PARTS, "parts": whole})))
    assert parts_of(file.axes["X"].parts) == thc6350_x_axis()
    del whole["screw"]["lead_mm"]
    said = refusal(("axes.X", {**PARTS, "parts": whole}))
    assert said.where.endswith("key axes.X.parts.screw.lead_mm")
    assert "thc6350-x" in said.advice
    # a rigidity that is not said is off, not that of the machine whose values are the defaults
    whole["screw"]["lead_mm"] = 20.0
    del whole["nut"]["rigidity_n_per_um"], whole["nut"]["rigidity_preload_n"]
    file = checked_model_file(changed(RIGID, ("axes.X", {**PARTS, "parts": whole})))
    assert parts_of(file.axes["X"].parts).nut.rigidity_n_per_um is None


def written(parts, **without: tuple[str, ...]) -> dict:
    """The parts as sections of a file, None left out, and of some parts these keys."""
    return {
        name: {k: v for k, v in vars(part).items() if v is not None and k not in without.get(name, ())}
        for name, part in vars(parts).items()
    }


def of_parts(sections: dict):
    return parts_of(checked_model_file(changed(RIGID, ("axes.X", {**PARTS, "parts": sections}))).axes["X"].parts)


@pytest.mark.parametrize("kind", INSTEAD, ids=lambda kind: kind.__name__)
def test_a_key_that_takes_the_place_of_others_frees_from_them(kind):
    name = kind.__name__.lower()
    ((instead, spared),) = INSTEAD[kind].items()
    parts = thc6350_x_axis()
    part = getattr(parts, name)
    if getattr(part, instead) is None:
        more = {"rigidity_preload_n": part.preload_n} if instead == "rigidity_n_per_um" else {}
        parts = replace(parts, **{name: replace(part, **{instead: 700.0}, **more)})
    short = of_parts(written(parts, **{name: tuple(spared)}))
    # what was left out counts for nothing, whatever it is
    other = {key: 1.01 * getattr(part, key) for key in spared if isinstance(getattr(part, key), float)}
    assert other
    moved = replace(parts, **{name: replace(getattr(parts, name), **other)})
    assert three_mass_mechanics(short) == three_mass_mechanics(parts) == three_mass_mechanics(moved)
    # without that key they are needed, all told at once
    said = refusal(("axes.X", {**PARTS, "parts": written(parts, **{name: (*spared, instead, "rigidity_preload_n")})}))
    assert all(f"'{key}'" in said.found for key in spared)
    assert instead in said.advice
    assert said.where.endswith(f"key axes.X.parts.{name}" + (f".{next(iter(spared))}" if len(spared) == 1 else ""))


def test_what_no_catalogue_prints_is_off_when_left_out():
    parts = thc6350_x_axis()
    without = {kind.__name__.lower(): tuple(off) for kind, off in OFF.items()}
    made = of_parts(written(parts, **without))
    for kind, off in OFF.items():
        for key, value in off.items():
            assert getattr(getattr(made, kind.__name__.lower()), key) == value
    assert made.screw.damping_nms_per_rad == made.guide.viscous_ns_per_m == 0.0
    said = refusal(("axes.X", {**PARTS, "parts": {}}))
    # a part that is not there at all is told with all of its keys
    assert said.found == "no 'inertia_kg_m2', 'torque_constant_nm_per_a', 'peak_torque_nm', 'top_speed_rpm'"


@pytest.mark.parametrize(
    ("key", "value"), [("screw.lead_mm", 0.0), ("table.mass_kg", -5.0), ("nut.contact_angle_deg", 90.0),
                       ("bearings.balls", 0), ("screw.origin_mm", 2000.0)],
)  # fmt: skip
def test_parts_that_cannot_be_are_refused_with_their_key(key, value):
    assert refusal(("axes.X", PARTS), (f"axes.X.parts.{key}", value)).where.endswith(f"key axes.X.parts.{key}")


def test_how_parts_vary_is_said():
    assert refusal(("axes.X", PARTS), ("axes.X.varying", ...)).where.endswith("key axes.X.varying")
    assert refusal(("axes.X", PARTS), ("axes.X.course.damping", "cycle")).where.endswith("key axes.X.course")
    along = (("axes.X", PARTS), ("axes.X.varying", "command"))
    assert refusal(*along, ("axes.X.friction.coulomb_n", 5.0)).where.endswith("key axes.X.friction.coulomb_n")
    axis = file_axis(checked_model_file(changed(RIGID, *along, ("axes.X.friction.offset_n", 5.0))).axes["X"]).axis
    assert axis.friction.coulomb_n == 0.0
    assert axis.friction.offset_n == 5.0


def test_the_motor_says_gain_and_limits_unless_the_servo_does():
    axis = file_axis(checked_model_file(changed(RIGID, ("axes.X", PARTS))).axes["X"]).axis
    motor = thc6350_x_axis().motor
    assert axis.servo.actuator_gain == motor.torque_constant_nm_per_a
    assert axis.servo.command_limit * axis.servo.actuator_gain == pytest.approx(motor.peak_torque_nm, rel=1e-15)
    said = changed(RIGID, ("axes.X", PARTS), ("axes.X.servo.command_limit", 1.0))
    assert file_axis(checked_model_file(said).axes["X"]).axis.servo.command_limit == 1.0


def test_the_example_of_the_published_size_has_the_documented_parts_and_servo():
    made = file_axis(read_model_file(EXAMPLES / "thc6350-x.toml").axes["X"])
    assert made.axis.servo == thc6350_servo()
    assert made.parts == thc6350_x_axis()


def test_the_example_from_catalogue_parts_needs_no_other():
    section = read_model_file(EXAMPLES / "catalogue-axis.toml").axes["X"]
    assert section.parts.like is None
    for name, kind in vars(thc6350_x_axis()).items():
        # a pattern to copy shows every key that is asked for
        assert getattr(section.parts, name).model_fields_set, name
        assert type(kind) is type(getattr(parts_of(section.parts), name))


# text


def test_a_file_of_another_physics_says_where_it_belongs():
    with pytest.raises(ModelFileError, match="simulate thermal"):
        read_model_file(EXAMPLES.parent / "thermal" / "headstock.toml")
    with pytest.raises(ModelFileError, match="simulate drive"):
        read_thermal_model_file(EXAMPLES / "rigid-friction.toml")


@pytest.mark.parametrize(
    "text",
    ["a" * 100 + " = 1", "[model]\nkind = 'drive", "a." * 40 + "b = 1", "[" * 3000, "", "[model]\nkind = 3",
     "[model]\nkind = 'drive'\nname = '\\n'", "motion = 3\naxes = 3\n[model]\nkind = 'drive'\nname = 'x'"],
    ids=["no section", "open text", "long key", "deep", "empty", "kind", "name", "no tables"],
)  # fmt: skip
def test_hostile_text_is_refused_quickly(text):
    with counted_calls() as calls, pytest.raises(ModelFileError):
        parsed_model_file(text)
    assert calls.count < 5_000  # ten times what it takes


def test_no_file_and_no_text(tmp_path):
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(InputError) as refused:
            read_model_file(path)
        assert str(path) in str(refused.value)
        assert "drive" in str(refused.value)


def test_reading_a_model_file_needs_no_compiler_and_no_pictures():
    code = (
        "import sys, selector.physics.drive.model_file as m; "
        f"m.read_model_file({str(EXAMPLES / 'thc6350-x.toml')!r}); "
        "print([name for name in ('numba', 'control', 'matplotlib', 'sympy', 'skfem') if name in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert run.stdout.strip() == "[]"
