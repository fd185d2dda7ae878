"""Slips of units are told with the unit that was meant, and a good machine is left alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from selector.errors import ModelFileError
from selector.physics.drive.drive_model import drive_model
from selector.physics.drive.drive_summary import drive_summary, model_findings, simulation_findings
from selector.physics.drive.model_file import checked_model_file, columns_needed, read_model_file
from tests.physics.drive.test_model_file import PARTS, RIGID, changed

EXAMPLES = [
    path
    for path in sorted((Path(__file__).resolve().parents[3] / "fixtures").glob("*/*.toml"))
    if 'kind = "drive"' in path.read_text(encoding="utf-8")
]
SCREW = {
    "kind": "three-mass",
    "motor_inertia_kg_m2": 0.002,
    "screw_inertia_kg_m2": 0.001,
    "table_mass_kg": 300.0,
    "lead_m": 0.01,
    "torsional_stiffness_nm_per_rad": 1e4,
    "axial_stiffness_n_per_m": 2e8,
}


def model(*changes):
    return drive_model(checked_model_file(changed(RIGID, *changes)))


def odd(drive):
    """What its file says that no machine has."""
    numbers = ("unlikely-value", "breakaway-below-sliding", "ripple-beyond-force")
    return [one for one in model_findings(drive) if one.id in numbers]


@pytest.mark.parametrize(
    ("key", "slip", "meant", "unit"),
    [
        ("servo.position_gain_per_s", 3.0, 50.0, "m/(min·mm)"),
        ("servo.position_gain_per_s", 3000.0, 50.0, "1/min"),
        ("servo.sample_s", 1.0, 0.001, "ms"),
        ("mechanics.table_mass_kg", 0.3, 300.0, "t"),
        ("mechanics.motor_inertia_kg_m2", 20.0, 0.002, "kg·cm²"),
        ("mechanics.lead_m", 10.0, 0.01, "mm"),
        ("mechanics.axial_stiffness_n_per_m", 200.0, 2e8, "N/µm"),
        ("transmission.backlash_m", 5.0, 5e-6, "µm"),
    ],
)
def test_a_slip_of_units_is_told_with_the_unit_that_was_meant(key, slip, meant, unit):
    (one,) = odd(model(("axes.X.mechanics", SCREW), (f"axes.X.{key}", slip)))
    assert (one.id, one.level, one.where.channel) == ("unlikely-value", "warning", "X")
    assert one.evidence["perhaps"] == pytest.approx(meant, rel=1e-12)  # rounding
    assert f"axes.X.{key} is {slip:g}" in one.statement
    assert unit in one.statement
    assert f"= {meant:.6g}" in one.suggestion


@pytest.mark.parametrize(
    ("part", "key", "slip", "meant"),
    [
        ("screw", "modulus_gpa", 206e9, 206.0),
        ("screw", "lead_mm", 0.020, 20.0),
        ("screw", "density_kg_per_m3", 7.85, 7850.0),
        ("table", "mass_kg", 0.3, 300.0),
        ("motor", "inertia_kg_m2", 20.0, 0.002),
        ("nut", "preload_n", 3.0, 3000.0),
    ],
)
def test_so_are_those_of_catalogue_parts(part, key, slip, meant):
    found = odd(model(("axes.X", PARTS), (f"axes.X.parts.{part}", {key: slip})))
    assert [one.evidence["perhaps"] for one in found] == [pytest.approx(meant, rel=1e-12)]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_machines_that_are_shipped_have_usual_numbers(path):
    file = read_model_file(path)
    assert odd(drive_model(file, dict.fromkeys(columns_needed(file)))) == []


def test_effects_that_cannot_be_are_told():
    strange = model(
        ("axes.X.friction", {"coulomb_n": 300.0, "static_n": 200.0}),
        ("axes.X.ripple", [{"harmonic": 2.0, "share": 2.0}]),
    )
    assert [one.id for one in model_findings(strange)] == ["breakaway-below-sliding"] * 2 + ["ripple-beyond-force"]


def test_a_sine_with_fewer_than_two_samples_a_period_is_refused():
    with pytest.raises(ModelFileError) as refused:
        model(("motion.frequency_hz", 500.0))
    assert refused.value.where.endswith("key motion.frequency_hz")
    assert "500 Hz" in refused.value.found
    assert model(("motion.frequency_hz", 499.0))


def limit_of(*changes):
    drive = model(*changes)
    done = drive.simulation()
    told = simulation_findings(drive, done, drive_summary(drive, done).loops)
    return next(one for one in told if one.id == "limit-reached")


def test_an_unstable_loop_at_its_limits_is_not_advised_to_accelerate_less():
    found = limit_of(("axes.X.servo.velocity_gain", 250_000.0), ("axes.X.servo.command_limit", 3000.0))
    assert "unstable" in found.suggestion
    assert "acceleration" not in found.suggestion
    # 10 mm at 2 Hz need more than 20 N of an axis that is stable
    weak = limit_of(("axes.X.servo.command_limit", 10.0), ("axes.X.servo.actuator_gain", 2.0))
    assert "acceleration" in weak.suggestion
    assert "unstable" not in weak.suggestion
    assert 0.0 < weak.evidence["share"] <= 1.0


def test_bristles_that_can_make_energy_are_told_with_what_would_not():
    bristles = {"stiffness_n_per_m": 1e6, "damping_ns_per_m": 2e4}
    friction = {"coulomb_n": 20.0, "static_n": 60.0, "lugre": bristles}
    (one,) = (one for one in model_findings(model(("axes.X.friction", friction))) if one.id == "bristles-make-energy")
    assert (one.level, one.where.channel) == ("warning", "X")
    for change in (
        {"damping_ns_per_m": one.evidence["largest"]},
        {"fading_speed_m_per_s": one.evidence["fading_speed"]},
    ):
        mended = {**friction, "lugre": {**bristles, **change}}
        assert "bristles-make-energy" not in {found.id for found in model_findings(model(("axes.X.friction", mended)))}
