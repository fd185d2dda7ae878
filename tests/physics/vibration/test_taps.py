"""Taps on a machine whose joints are known: compliances, modes, stiffness and ψ with intervals that hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from selector.errors import InputError
from selector.physics.vibration.model_file import checked_model_file
from selector.physics.vibration.structure import (
    GROUND,
    Joint,
    Member,
    Structure,
    joint_ends,
    receptance,
    structure_modes,
)
from selector.physics.vibration.taps import TapResponse, measured_modes, tap_fit
from selector.physics.vibration.vibration_model import vibration_model
from tests.physics.vibration import planted_taps
from tests.physics.vibration.planted_taps import drawn, model, planted

TRUE = drawn(3)
QUIET = planted(TRUE, 3, 2, noise=0.0)


@pytest.fixture(scope="module")
def fit():
    return tap_fit(model(), planted(TRUE, 3, 4))


def truth(name):
    return TRUE.parameters[name].value


def test_compliance_of_two_masses_is_that_of_their_transfer_functions():
    m1, m2, k1, k2 = 40.0, 8.0, 3e7 * (1 + 0.05j), 6e6 * (1 + 0.02j)
    # ψ is 2π times the loss factor
    joints = (Joint(("slide", GROUND), 3e7, 0.1 * np.pi), Joint(("tool", "slide"), 6e6, 0.04 * np.pi))
    structure = Structure((Member("slide", m1), Member("tool", m2)), joints)
    hz = np.linspace(20.0, 300.0, 57)
    characteristic = [m1 * m2, 0, m2 * (k1 + k2) + m1 * k2, 0, k1 * k2]
    for of, at, above in (("tool", "tool", [m1, 0, k1 + k2]), ("slide", "tool", [k2]), ("slide", "slide", [m2, 0, k2])):
        _, expected = signal.freqs(above, characteristic, 2 * np.pi * hz)
        # rounding
        assert receptance(structure, hz, of=of, at=at) == pytest.approx(expected, rel=1e-9)


def test_records_give_the_compliance_though_they_end_while_it_rings():
    # the fit is of the same machine: what it computes is the compliance with the window that lies over the records
    for one, lines, (_, fitted) in zip(QUIET, (found := tap_fit(model(), QUIET)).used, found.computed, strict=True):
        away = np.abs(one.mean[lines] / fitted - 1.0)
        # a hysteretic joint answers a little before its force, which no record that begins with the blow has
        assert np.median(away) < 2e-3, one.called
    for parameter in found.parameters:
        assert parameter.value == pytest.approx(truth(parameter.name), rel=2e-3)


def test_stiffness_and_psi_lie_in_their_intervals(fit):
    assert fit.left_after < 0.1 * fit.left_before
    for one in fit.parameters:
        # of six intervals of 95 % one may miss by a little
        assert abs(one.value - truth(one.name)) < 0.75 * (one.high - one.low), one.name
        # a guess that is up to 40 % off becomes a number with an interval of a few percent
        assert one.high - one.low < 0.1 * one.value
    assert fit.after.parameters["joints.2.dissipation"].value == fit.parameters[3].value


def test_intervals_hold_as_often_as_they_say():
    inside = []
    for seed in range(6):
        true = drawn(seed)
        for one in tap_fit(model(), planted(true, seed, 3)).parameters:
            inside.append(one.low <= true.parameters[one.name].value <= one.high)
    # of 36 intervals of 95 % less than 28 inside has a probability of 5e-5
    assert sum(inside) >= 28


def test_a_spectrum_alone_has_wider_intervals_and_says_so(fit):
    alone = [replace(one, taps=one.mean[None], weight=np.ones((1, len(one.frequency_hz)))) for one in fit.responses]
    found = tap_fit(model(), alone)
    assert {one.id for one in found.findings} >= {"single-tap"}
    assert sum(one.low <= truth(one.name) <= one.high for one in found.parameters) >= 5


def test_modes_are_those_of_the_machine(fit):
    true = structure_modes(TRUE.structure)
    assert len(fit.modes) == 3
    for k, (measured, before, after) in enumerate(fit.modes):
        assert measured.frequency_hz == pytest.approx(true.frequency_hz[k], rel=0.005)
        # what is read off a peak beside two others
        assert measured.loss_factor == pytest.approx(true.loss_factor[k], rel=0.1)
        assert after.frequency_hz == pytest.approx(true.frequency_hz[k], rel=0.002)
        assert abs(np.log(after.frequency_hz / measured.frequency_hz)) < abs(
            np.log(before.frequency_hz / measured.frequency_hz)
        )
        assert after.mac > 0.98


def test_no_mode_is_read_off_noise():
    rng = np.random.default_rng(0)
    noise = [replace(one, taps=rng.normal(size=one.taps.shape) * (1 + 0j)) for one in QUIET[:2]]
    assert measured_modes(noise, np.ones(len(noise[0].frequency_hz), dtype=bool))[0] == ()


def changed(**sections):
    return vibration_model(checked_model_file({**model().file.model_dump(exclude_unset=True), **sections}))


def test_what_the_taps_do_not_see_is_said_with_the_reason():
    members = {"bed": {"mass_kg": 9e7}, "workpiece": {"mass_kg": 60.0}, "tool": {"mass_kg": 25.0}}
    joints = [dict(one) for one in model().file.model_dump()["joints"]]
    doubled = [*joints, {"between": ("tool", "bed"), "stiffness_n_per_m": 2e7, "dissipation": 0.4}]
    machine = changed(members=members, joints=doubled)
    found = {one.name: one for one in tap_fit(machine, planted(machine, 5, 3), band_hz=(60.0, 400.0)).parameters}
    # a bed of 90 000 t does not move
    assert found["joints.1.stiffness_n_per_m"].low is None
    assert "hardly" in found["joints.1.stiffness_n_per_m"].unseen
    # two joints side by side are one spring
    assert "joints.4.stiffness_n_per_m" in found["joints.3.stiffness_n_per_m"].unseen
    workpiece = found["joints.2.stiffness_n_per_m"]
    assert workpiece.low < 1.5e8 < workpiece.high
    together = sum(found[f"joints.{k}.stiffness_n_per_m"].value for k in (3, 4))
    assert together == pytest.approx(6e7, rel=0.01)


def test_frequencies_count_up_to_twice_the_highest_mode():
    found = tap_fit(model(), QUIET)
    highest = structure_modes(model().structure).frequency_hz[-1]
    for one, lines in zip(QUIET, found.used, strict=True):
        assert one.frequency_hz[lines][-1] <= 2.0 * highest
    wide = tap_fit(model(), QUIET, band_hz=(0.0, 1000.0))
    assert max(one.frequency_hz[lines][-1] for one, lines in zip(QUIET, wide.used, strict=True)) > 2.0 * highest


def test_of_very_many_lines_some_count():
    hz = np.linspace(1.0, 400.0, 24_000)
    exact = receptance(TRUE.structure, hz, of="tool", at="tool")[None]
    found = tap_fit(model(), [TapResponse("tool", "tool", hz, exact, np.ones(exact.shape))])
    assert 2500 < np.count_nonzero(found.used[0]) <= 5000
    (stiffness,) = (one for one in found.parameters if one.name == "joints.3.stiffness_n_per_m")
    assert stiffness.value == pytest.approx(truth(stiffness.name), rel=1e-5)


def test_a_mass_is_fitted_where_it_is_asked_for():
    name = "members.tool.mass_kg"
    heavier = TRUE.with_parameters({name: 30.0})
    found = tap_fit(TRUE, planted(heavier, 1, 3), free=[name]).parameters
    assert [one.name for one in found] == [name]
    assert found[0].low < 30.0 < found[0].high


def test_another_machine_is_not_reached_and_is_said():
    softer = TRUE.with_parameters({"joints.3.stiffness_n_per_m": 6e6, "members.tool.mass_kg": 5.0})
    found = tap_fit(TRUE, planted(softer, 1, 3), free=["joints.3.stiffness_n_per_m"])
    assert {"taps-not-reached"} <= {one.id for one in found.findings}


def test_viscous_joints_are_not_those_of_the_model_and_are_said(monkeypatch):
    def viscous(structure, hz, *, of, at):
        # η as the joints have it at 150 Hz, and in proportion to the frequency elsewhere
        ends, masses = joint_ends(structure), [one.mass_kg for one in structure.members]
        stiffness = [one.stiffness_n_per_m * (1 + 1j * one.loss_factor * hz / 150.0) for one in structure.joints]
        held = np.einsum("jm,jf,jn->fmn", ends, np.array(stiffness), ends)
        dynamic = held - (2 * np.pi * hz[:, None, None]) ** 2 * np.diag(masses)
        return np.linalg.inv(dynamic)[:, structure.position(of), structure.position(at)]

    monkeypatch.setattr(planted_taps, "receptance", viscous)
    found = tap_fit(model(), planted(drawn(0), 0, 3))
    assert "taps-not-reached" in {one.id for one in found.findings}
    # frequencies hardly depend on the law of damping, so stiffnesses do neither
    for one in found.parameters[::2]:
        assert one.value == pytest.approx(drawn(0).parameters[one.name].value, rel=0.02)


@pytest.mark.parametrize(
    ("asked", "where"),
    [
        ({"free": ["joints.9.dissipation"]}, "--free"),
        ({"free": ["sources.motor.lines.1.force_n"]}, "--free"),
        ({"band_hz": (1e4, 2e4)}, "tool per force on tool"),
    ],
)
def test_what_cannot_be_fitted_is_refused(asked, where):
    with pytest.raises(InputError) as error:
        tap_fit(model(), QUIET, **asked)
    assert error.value.where == where


def test_a_unit_that_cannot_be_is_refused():
    with pytest.raises(InputError, match="--unit"):
        tap_fit(model(), [replace(one, taps=1e3 * one.taps) for one in QUIET])
