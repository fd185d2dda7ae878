"""The answer in sentences: what, where, how sure, worth what."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from selector.diagnosis.answer import Errors
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.effects.effect import Fitted, Quantity, Variant
from selector.diagnosis.effects.thermal._wording import delay_of, told
from selector.diagnosis.wording import amount, headline, held_out_words, name_of, what_to_do
from selector.findings import Finding, Where
from tests.diagnosis.answers import answer, memory_effect, zero_effect

ZERO = np.zeros(900)


def test_missing_physics_says_what_where_how_sure_and_worth_what():
    found = answer()
    text = headline(found)
    assert text.startswith(
        "The simulation leaves out memory of past heating (column): Z follows T1 41 min late, worth 12 µm (97 % sure); "
        "with it the error of Z on the unseen run r3 falls from "
    )
    before, after = found.fit["Z"].heldout.rmse_before, found.fit["Z"].heldout.rmse_after
    assert f"{before:.2f} to " in text
    assert f"recalibration alone gives {found.fit['Z'].recalibrated_heldout:.2f}." in text
    assert before > after


def test_a_set_is_said_to_be_a_set_with_the_run_that_tells():
    found = answer(effects=(memory_effect(ZERO, cannot_be_told_from=("thermal.ambient",)),))
    text = headline(found)
    assert "memory of past heating or the hall temperature" in text
    assert "this record cannot tell them apart" in text
    assert text.endswith("To tell them apart: Heat for 4 h, then let it cool for 6 h.")


def test_what_is_not_confirmed_is_not_asserted():
    text = headline(answer(effects=(memory_effect(ZERO, suspected=True),)))
    assert "may leave out" in text
    assert "not confirmed on another programme" in text


def test_an_error_that_does_not_fall_is_said_so():
    found = answer()
    fit = dict(found.fit)
    fit["Z"] = replace(fit["Z"], heldout=Errors(1.0, 1.01))
    assert "does not fall (1.00 and 1.01 µm)" in headline(replace(found, fit=fit))


def test_what_another_response_shows_has_its_own_sentence():
    found = answer()
    held = found.fit["Y"].heldout
    assert f"It shows in Y too: the error of Y falls from {held.rmse_before:.2f} to " in headline(found)
    assert "It shows" not in headline(replace(found, fit={"Z": found.fit["Z"]}))


@pytest.mark.parametrize("verdict", ["missing-physics", "miscalibrated"])
def test_a_simulation_of_the_opposite_sign_is_told_first(verdict):
    gain = {"gain": Quantity(-1.0, "1", -1.1, -0.9)}
    same = answer(verdict, recalibration={"Z": gain})
    # a gain below 0 makes room for something else where both move alike
    assert "sign" not in headline(same)
    turned = replace(same.comparison, recorded=same.comparison.recorded | {"Z": -same.comparison.recorded["Z"]})
    found = replace(same, comparison=turned)
    assert headline(found).endswith("Z is simulated with the opposite sign: its gain should be −1.00.")
    assert what_to_do(found)[0].startswith("Turn the sign of the simulation before anything else: Z is")
    unsure = replace(found, recalibration={"Z": {"gain": Quantity(-1.0, "1", -2.1, 0.1)}})
    assert "sign" not in headline(unsure)


def test_nothing_held_out_is_said_and_promises_nothing():
    found = answer(effects=(memory_effect(ZERO, names=("Z", "Y"), channels=("Z",), suspected=True),))
    fit = dict(found.fit)
    fit["Z"] = replace(fit["Z"], heldout=Errors(np.nan, np.nan, 0.4), recalibrated_heldout=np.nan)
    found = replace(found, fit=fit)
    text = headline(found)
    assert "may leave out" in text
    assert "nothing of Z was held out to check it on" in text
    assert text.endswith("where it was fitted.")
    held = found.as_dict()["fit"]["Z"]
    assert held["heldout"]["rmse_after"] is None
    assert held["recalibrated_heldout_rmse"] is None


def test_physics_comes_before_faults_of_the_recording():
    found = answer(effects=(zero_effect(ZERO), memory_effect(ZERO)))
    text = headline(found)
    assert text.startswith("The simulation leaves out memory of past heating")
    assert "The recording is at fault too: the zero of a channel in Z (97 % sure)." in text
    assert what_to_do(found)[0].startswith("Correct the recording before anything else")
    unsure = replace(found, effects=(replace(found.effects[0], confidence=0.6), found.effects[1]))
    assert "what happened to the machine there" in what_to_do(unsure)[0]


def test_a_fault_of_the_recording_is_no_missing_physics():
    text = headline(answer("data-fault"))
    assert text.startswith("The recording is at fault, not the simulation: Z is recorded 3.65 µm too low in run r3 (")
    assert "corrected, the error of Z" in text


def test_miscalibration_gives_the_numbers_that_matter():
    text = headline(answer("miscalibrated"))
    assert "Z needs offset 3.10 µm (2.90 to 3.30)" in text
    assert "gain" not in text  # its interval holds 1


def test_nothing_missing_says_how_large_the_noise_is():
    found = answer("nothing-missing")
    assert headline(found) == (
        f"Nothing is missing: what is left in Z ({amount(found.fit['Z'].heldout.rmse_after, 'um')} rms) and "
        f"Y ({amount(found.fit['Y'].heldout.rmse_after, 'um')} rms) is noise."
    )


def test_noise_that_may_be_a_slow_effect_is_not_passed_off_as_noise():
    slow = Finding("slow-remainder", "info", "…", where=Where(channel="Z"))
    for verdict in ("nothing-missing", "miscalibrated"):
        text = headline(replace(answer(verdict), findings=(slow,)))
        assert text.endswith("What wanders slowly in Z may be more than noise: see the findings.")
        assert "is missing" not in text
        assert "wanders" not in headline(answer(verdict))


def test_the_unexplained_has_place_time_and_size_but_no_name():
    text = headline(answer("unexplained"))
    assert "Z, r1 from 30 min to 1 h 57 min, while spindle_speed > 1500 rpm and 2 other windows" in text
    told = re.search(r"where ([0-9.]+) µm rms beside noise is left, ([0-9.]+) % of how far Z moves\.", text)
    assert told is not None
    moved = np.std(answer("unexplained").comparison.recorded["Z"])
    assert float(told[2]) == pytest.approx(100.0 * float(told[1]) / moved, rel=0.05)  # two digits are told
    found = answer("unexplained")
    little = {"Z": found.comparison.recorded["Z"] / 1e3}
    much = replace(found.comparison, recorded=found.comparison.recorded | little)
    assert re.search(r", [0-9]{3,} % of how far Z moves", headline(replace(found, comparison=much)))
    assert not any(name_of(effect.id) in text for effect in catalogue())


def test_the_size_of_the_unexplained_is_without_the_noise():
    def told(noise):
        fit = {name: replace(one, heldout=replace(one.heldout, noise_floor=noise)) for name, one in found.fit.items()}
        size = re.search(r"where ([0-9.]+) µm rms beside noise is left", headline(replace(found, fit=fit)))
        return 0.0 if size is None else float(size[1])

    found = answer("unexplained")
    whole = told(0.0)
    assert told(0.8 * whole) == pytest.approx(0.6 * whole, rel=0.02)  # three digits are told
    assert told(1.1 * whole) == 0.0
    # and without what calibration takes away
    recorded = found.comparison.recorded
    halves = {name: recorded[name] - 0.5 * (recorded[name] - one.after) for name, one in found.fit.items()}
    found = replace(found, fit={name: replace(one, after=halves[name]) for name, one in found.fit.items()})
    assert told(0.0) == pytest.approx(0.5 * whole, rel=0.01)


def test_another_part_to_hold_out_is_named_where_only_one_run_was_fitted():
    found = answer("unexplained")
    runs = found.comparison.run_index
    assert not any("--holdout" in step for step in what_to_do(found))
    one_fitted = replace(found, comparison=replace(found.comparison, held_out=runs > 0))
    assert sum("Only r1 was fitted" in step and "--holdout 0.3" in step for step in what_to_do(one_fitted)) == 1
    shared = replace(found, comparison=replace(found.comparison, held_out=np.arange(len(runs)) % 300 > 200))
    assert not any("--holdout" in step for step in what_to_do(shared))


@pytest.mark.parametrize(
    ("delay", "error", "gain", "is_told"),
    [(-106.0, 9.0, 1.0, True), (106.0, 9.0, 1.0, False), (-65.0, 9.0, 1.0, False), (-106.0, 80.0, 1.0, False),
     (106.0, 9.0, -1.0, True)],
    ids=["late", "early", "as much as a clock", "not sure", "late and of the other sign"],
)  # fmt: skip
@pytest.mark.parametrize("verdict", ["missing-physics", "miscalibrated"])
def test_a_simulation_that_has_to_be_advanced_is_told(delay, error, gain, is_told, verdict):
    """By more than two samples of 30 s; the fit adds a delay to the course as it was simulated."""
    fitted = {"delay": Quantity(delay, "s", delay - error, delay + error), "gain": Quantity(gain, "1", gain, gain)}
    text = headline(answer(verdict, recalibration={"Z": fitted}))
    assert ("Z comes 106 s (97.0 to 115) later in the simulation" in text) == is_told


def test_what_explains_half_but_is_not_borne_out_is_told_with_the_verdict():
    found = answer("unexplained")
    courses = {"Z": np.zeros(len(found.comparison.time_s))}
    memory = memory_effect(courses["Z"], share=0.82, suspected=True)
    text = headline(replace(found, also_seen=(memory,)))
    assert f"Nearest comes {name_of('thermal.memory')}, 82 % of the fitted mismatch in Z" in text
    for other in (replace(memory, share=0.4), replace(zero_effect(courses["Z"]), share=0.9)):
        assert "Nearest" not in headline(replace(found, also_seen=(other,)))


@pytest.mark.parametrize(
    "verdict", ["missing-physics", "data-fault", "miscalibrated", "nothing-missing", "unexplained"]
)
def test_every_verdict_says_what_to_do(verdict):
    steps = what_to_do(answer(verdict))
    assert steps
    assert all(step.endswith(".") and ".." not in step for step in steps)


def test_every_shipped_effect_has_a_name_for_sentences():
    assert not [effect.id for effect in catalogue() if name_of(effect.id) == effect.id]


def test_held_out_rows_in_words():
    of = answer().comparison
    assert held_out_words(of) == "the unseen run r3"
    ends = (np.arange(900) % 300) >= 210
    assert held_out_words(replace(of, held_out=ends)) == "the unseen end of r1, r2 and r3"


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (-83.64, "um", "−83.6 µm"),
        (0.0, "s", "0 s"),
        (9.996, "N", "10.0 N"),
        (1234.5, "rpm", "1234 rpm"),
        (0.05, "1", "0.0500"),
        (1.97e-6, "m", "1.97 µm"),
        (0.0123, "m", "12.3 mm"),
        (2.5, "um/K", "2.50 µm/K"),
    ],
)
def test_amounts(value, unit, text):
    assert amount(value, unit) == text


@pytest.mark.parametrize("name", ["Verlagerung Z", "Z", "Kopf", "Ü"])
def test_names_of_channels_are_never_changed(name):
    found = answer()
    channels = tuple(replace(one, name=name) if one.name == "T1" else one for one in found.comparison.channels)
    comparison = replace(found.comparison, channels=channels)
    effect = replace(found.effects[0], statement=f"{name} is followed 41 min late.")
    text = headline(replace(found, comparison=comparison, effects=(effect,)))
    assert f": {name} is followed 41 min late" in text


def test_what_only_begins_like_a_channel_begins_small():
    found = answer()
    effect = replace(found.effects[0], statement="Zones of the bed follow.")
    assert ": zones of the bed follow" in headline(replace(found, effects=(effect,)))


def test_an_interval_without_width_is_none():
    effect = replace(memory_effect(ZERO), parameters={"tau_s": Quantity(1080.0, "s", 1080.0, 1080.0)})
    assert effect.parameters["tau_s"] == Quantity(1080.0, "s")
    assert "1080 s" in effect.parameters["tau_s"].words()
    wide = Quantity(1080.0, "s", 900.0, 1200.0)
    assert replace(effect, parameters={"tau_s": wide}).parameters["tau_s"] == wide
    assert wide.words() == "1080 s (900 to 1200)"


def test_a_delay_that_only_one_shape_has_is_said_to_be_rough():
    shape = {"tau_s": Quantity(1080.0, "s")}
    fitted = Fitted("Z", "um", Variant(np.ones((9, 1)), ("T1",), shape), np.ones(1), np.ones(1), {}, 1.0, 2.0)
    alone = replace(fitted, shape_intervals={"tau_s": (1080.0, 1080.0)})
    assert delay_of(alone) == "with a delay of about 18 min"
    assert told(alone, "").parameters["tau_s"].low is None
    wide = replace(fitted, shape_intervals={"tau_s": (960.0, 1200.0)})
    assert delay_of(wide) == "with a delay of 18 min (16 min to 20 min)"
