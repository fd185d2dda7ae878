"""Each drive effect, put into an axis by other code, is what explains the difference best, and is read in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.signal import savgol_filter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading
from selector.recording import Channel
from tests.diagnosis.effects.drive_axis import PAIRS, Noise, compared, replace
from tests.diagnosis.effects.drive_evidence import EFFECTS, NAMES, best, evidence

EMPS = Path(__file__).parents[3] / "fixtures" / "emps" / "DATA_EMPS.mat"
UNDECIDABLE = "drive.offset_force"
"""Dry friction holds it while the axis stands: then it looks like friction of one direction, or a zero."""


@pytest.fixture(scope="module")
def rows():
    """Truth → evidence for each effect; printed at the end (pytest -s)."""
    found: dict[str, dict[str, float]] = {}
    yield found
    print("\n" + " " * 20 + " ".join(f"{name[:8]:>8}" for name in NAMES))
    for truth, of in found.items():
        print(f"{truth[:20]:<20}" + " ".join(f"{of[name]:8.0f}" for name in NAMES))


@pytest.mark.parametrize("name", [name for name in PAIRS if name != UNDECIDABLE])
def test_what_was_put_in_explains_most(name, rows):
    truth, model = PAIRS[name]
    found = evidence(compared(truth, model, seed=2))
    rows[name.partition(".")[2]] = found
    ranked = sorted(found, key=lambda name: -found[name])
    assert ranked[0] == name.partition(".")[2], {name: round(found[name]) for name in ranked[:4]}
    # a likelihood ratio of e^3: less would be a draw
    assert found[ranked[0]] > found[ranked[1]] + 3.0


def test_a_force_that_friction_holds_at_rest_is_taken_for_what_is_named_beside_it(rows):
    found = evidence(compared(*PAIRS[UNDECIDABLE], seed=2))
    rows["offset_force"] = found
    top = f"drive.{max(found, key=lambda name: found[name])}"
    assert top in (UNDECIDABLE, *effect_of(UNDECIDABLE).confounders)


@pytest.mark.parametrize("name", ["drive.coulomb", "drive.backlash", "drive.mass"])
def test_the_name_stays_when_the_control_is_another(name):
    truth, model = PAIRS[name]
    other = {"proportional": 30.0, "reset_s": 0.05, "speed_gain": 2.5e5, "feed_forward": 0.0}
    found = evidence(compared(replace(truth, **other), replace(model, **other), seed=4))
    assert max(found, key=lambda name: found[name]) == name.partition(".")[2], found


@pytest.mark.parametrize("name", ["drive.coulomb", "drive.saturation", "drive.pitch_error"])
def test_the_size_is_that_which_was_put_in(name):
    truth, model = PAIRS[name]
    comparison = compared(truth, model, seed=2)
    response, key, expected = {
        "drive.coulomb": ("I", "current_a", truth.coulomb / truth.force_per_a),
        "drive.saturation": ("I", "limit", truth.limit_a),
        "drive.pitch_error": ("E", "amplitude", 1e6 * truth.lead_error),
    }[name]
    _, fit = best(comparison, effect_of(name), response)
    found = effect_of(name).reading(fit, comparison).parameters[key].value
    # the grid of limits, the loop and a nut that is not where the table is: 8 % is what is left
    assert found == pytest.approx(expected, rel=0.08)


@pytest.fixture(scope="module")
def rubbing():
    return compared(*PAIRS["drive.coulomb"], seed=6)


@pytest.mark.parametrize("effect", EFFECTS, ids=NAMES)
def test_every_shape_is_finite_and_small_in_number_and_read_in_a_sentence(effect, rubbing):
    comparison = rubbing
    told = 0
    for response in comparison.responses:
        variants = list(effect.variants(comparison, response))
        assert bool(variants) == (effect.testable(comparison, response) is None)
        assert len(variants) <= 60
        for variant in variants:
            n = variant.columns.shape[1]
            assert variant.columns.shape == (len(comparison.time_s), n)
            assert 1 <= n <= 4
            assert np.isfinite(variant.columns).all()
            known = {parameter.name for parameter in effect.parameters}
            # "inertia_share" tells shapes of play apart that have no parameter in common
            assert set(variant.shape) <= known | {"inertia_share"}
            fit = Fitted(
                response, comparison.channel(response).unit, variant, np.ones(n), np.full(n, 0.1), {}, 1.0, 2.0
            )
            reading = effect.reading(fit, comparison)
            told += _is_a_sentence(reading)
    assert told


def _is_a_sentence(reading: Reading) -> bool:
    assert reading.statement.endswith(".")
    assert reading.statement[0].isupper()
    assert len(reading.statement) < 260
    assert any(character.isdigit() for character in reading.statement)
    assert all(isinstance(q, Quantity) and np.isfinite(q.value) for q in reading.parameters.values())
    return True


@pytest.mark.parametrize("effect", EFFECTS, ids=NAMES)
def test_an_axis_that_stands_or_a_channel_that_is_no_motion_is_said_to_be_untestable(effect, rubbing):
    comparison = rubbing
    still = {name: np.full(len(values), 0.05) for name, values in comparison.recorded.items()}
    standing = replace(comparison, recorded=comparison.recorded | {"r": still["r"], "v": 0.0 * still["v"]},
                       simulated={name: 0.0 * values for name, values in comparison.simulated.items()})  # fmt: skip
    hot = replace(
        comparison, channels=(*comparison.channels[:2], Channel("E", "temperature", "degC"), comparison.channels[3])
    )
    for case in (standing, hot):
        assert effect.testable(case, "E")
        assert not list(effect.variants(case, "E"))


@pytest.mark.parametrize("name", ["drive.coulomb", "drive.asymmetric_friction", "drive.stribeck", "drive.backlash"])
def test_one_way_says_nothing_of_reversals(name, rubbing):
    comparison = rubbing
    forwards = replace(comparison, recorded=comparison.recorded | {"r": 0.05 + 0.03 * comparison.time_s},
                       simulated={name: 0.0 * values for name, values in comparison.simulated.items()})  # fmt: skip
    assert "one way" in effect_of(name).testable(forwards, "I")


def test_confounders_and_experiments_are_said():
    for effect in EFFECTS:
        assert effect.id not in effect.confounders
        for text in (effect.refuted_by, effect.experiment, effect.needs, effect.reference, effect.physics):
            assert len(text) > 25
        assert any(character.isdigit() for character in effect.experiment)


def test_without_noise_nothing_else_is_needed():
    """What the right shapes leave of the difference, once noise is out of the way."""
    for name in ("drive.coulomb", "drive.viscous", "drive.mass", "drive.ripple"):
        comparison = compared(*PAIRS[name], seed=1, noise=Noise(0.0, 0.0, 0.0))
        for response in comparison.responses:
            _, fit = best(comparison, effect_of(name), response)
            rows = ~comparison.held_out
            left = (comparison.difference(response) - fit.variant.columns @ fit.coefficients)[rows]
            # the loop is of third order here and of seventh in the axis, and a lead is known to half a line width: 8 %;
            # gain and offset of `best` are free as well
            simulated = np.column_stack([np.ones(rows.sum()), comparison.simulated[response][rows]])
            left = left - simulated @ np.linalg.lstsq(simulated, left, rcond=None)[0]
            assert np.var(left) < 0.08 * np.var(comparison.difference(response)[rows]), (name, response)


def _emps(dry_friction: bool) -> Comparison:
    """The recorded drive beside an inverse model without or with symmetric dry friction, as a simulated force."""
    data = {key: np.asarray(v, dtype=float).ravel() for key, v in loadmat(EMPS).items() if key[0] != "_"}
    smooth = {"window_length": 41, "polyorder": 3}
    position = data["qm"]
    speed = savgol_filter(position, deriv=1, delta=1e-3, **smooth)
    force = savgol_filter(float(data["gtau"][0]) * data["vir"], **smooth)
    parts = [savgol_filter(position, deriv=2, delta=1e-3, **smooth), speed, np.ones(len(speed))]
    if dry_friction:
        parts.append(np.sign(speed) * (np.abs(speed) > 1e-3))
    model = np.column_stack(parts)
    told = model @ np.linalg.lstsq(model, force, rcond=None)[0]
    rows = slice(None, None, 4)
    n = len(position[rows])
    return Comparison(
        runs=("r1",),
        starts=(0, n),
        time_s=1e-3 * np.arange(len(position))[rows],
        channels=(Channel("q", "position", "m"), Channel("r", "position_command", "m"), Channel("F", "force", "N")),
        recorded={"q": position[rows], "r": data["qg"][rows], "F": force[rows]},
        simulated={"F": told[rows]},
        responses=("F",),
        held_out=np.arange(n) > 0.7 * n,
    )


@pytest.mark.skipif(not EMPS.exists(), reason="the recorded drive is not here")
def test_the_recorded_drive_lacks_dry_friction_and_then_what_its_authors_describe():
    viscous = evidence(_emps(dry_friction=False), viscous=True)
    assert max(viscous, key=lambda name: viscous[name]) == "coulomb"
    symmetric = evidence(_emps(dry_friction=True), viscous=True)
    ranked = sorted(symmetric, key=lambda name: -symmetric[name])
    # A. Janot, M. Gautier, M. Brunot (2019): friction that differs by direction, and a flexible joint
    assert ranked[:2] == ["asymmetric_friction", "elasticity"]
