"""Truths made by finite differences of heat in bars: the effect that was put in explains most of the mismatch.

Run with ``-s`` to see the whole matrix.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import least_squares

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.effects.effect import Fitted
from selector.diagnosis.shapes.signals import lagged
from tests.diagnosis.effects.explained_shares import shares
from tests.diagnosis.effects.heated_machine import TOP_RPM, Physics, comparison_of, recorded, regression, simulation

THERMAL = [effect for effect in catalogue() if effect.family == "thermal"]
HALL = replace(Physics(), hall=1.0)
PALMGREN = ((0.7, 5 / 3), (0.3, 1.0))
# true physics, what the simulation has instead, channels that were not recorded
TRUTHS: dict[str, tuple[Physics, Physics | str, tuple[str, ...]]] = {
    "memory/regression": (Physics(), "regression", ()),
    "memory/regression, no speed": (Physics(), "regression", ("n",)),
    "memory/regression, hall, no speed": (HALL, "regression", ("n",)),
    "memory/no column": (HALL, replace(HALL, column=False), ()),
    "memory/two modes": (Physics(), "modes", ()),
    "ambient/none": (HALL, Physics(), ()),
    "ambient/none, no speed": (HALL, Physics(), ("n",)),
    "coolant/strong": (replace(HALL, coolant_w_per_m2k=150.0), HALL, ()),
    "coolant/weak, no speed": (replace(HALL, coolant_w_per_m2k=25.0), HALL, ("n",)),
    "speed_heating/law": (replace(HALL, law=PALMGREN), replace(HALL, law=((1.0, 1.0),)), ()),
    "speed_heating/law too steep": (replace(HALL, law=((1.0, 1.0),)), replace(HALL, law=((1.0, 2.0),)), ()),
    "speed_heating/none": (HALL, replace(HALL, power_w=0.0), ()),
    "second_source/feed": (replace(HALL, feed_w=60.0), HALL, ()),
    "second_source/hydraulics, no speed": (replace(HALL, hydraulics_w=60.0), HALL, ("n",)),
    "second_source/by its temperature": (replace(HALL, hydraulics_w=60.0), HALL, ("hyd",)),
    "convection/weak fan": (replace(HALL, fan=0.5), HALL, ()),
    "convection/strong fan": (replace(HALL, fan=3.0), HALL, ()),
    "interaction/small": (replace(HALL, product=0.05), HALL, ()),
    "interaction/large": (replace(HALL, product=0.2), HALL, ()),
    "instant_speed/square": (replace(HALL, instant_um=3.0), HALL, ()),
    "instant_speed/linear": (replace(HALL, instant_um=-5.0, instant_exponent=1.0), HALL, ()),
}


@cache
def case(name: str, seed: int) -> Comparison:
    truth, believed, drop = TRUTHS[name]
    record = recorded(truth, seed)
    if isinstance(believed, Physics):
        simulated = simulation(believed, seed, record)
    elif believed == "regression":
        simulated = regression(record, ("T1", "T6") if truth.hall == 0.0 else ("T1", "T2"), 200)
    else:
        simulated = two_modes(record, 200)
    return comparison_of(record, simulated, drop=drop)


def two_modes(record: dict[str, np.ndarray], until: int) -> dict[str, np.ndarray]:
    """Two lags of the heat with the time constants that fit the first rows, a warm-up, best."""
    clock = comparison_of(record, record)
    heat = (record["n"] / TOP_RPM) ** 1.4
    result = {}
    for name in ("Z", "Y"):

        def modelled(logs: np.ndarray, target: np.ndarray = record[name]) -> np.ndarray:
            modes = np.column_stack([lagged(clock, heat, float(np.exp(x))) for x in logs])
            return modes @ np.linalg.lstsq(modes[:until], target[:until], rcond=None)[0]

        logs = least_squares(lambda x: (modelled(x) - record[name])[:until], np.log([600.0, 5000.0])).x  # noqa: B023
        result[name] = modelled(logs)
    return result


# rho 0.6 as under coloured noise. Seen: 0.79 to 1.00 for the right effect; within 0.02 of the runner-up
# only where two modes lack a third (0.4 µm of mismatch), 0.04 or more above it elsewhere.
@pytest.mark.parametrize("name", TRUTHS)
def test_the_effect_that_was_put_in_explains_most(name):
    right = "thermal." + name.split("/")[0]
    for response in ("Z", "Y"):
        found = {key: share for key, (share, _) in shares(case(name, 1), response, THERMAL, rho=0.6).items()}
        print(f"{name:36} {response} " + " ".join(f"{key[8:15]}={share:.3f}" for key, share in found.items()))
        others = max(share for key, share in found.items() if key != right)
        assert found[right] > 0.7
        assert found[right] > others + 0.01


def test_free_convection_is_hardly_told_from_memory():
    """Film that grows with warmth, against a constant one of the same mean: what is left looks like other delays."""
    truth = replace(HALL, free=1.0, film=4.0)
    record = recorded(truth, 2)
    comparison = comparison_of(record, simulation(replace(HALL, film=4.0 * 2.45), 2, record))
    for response in ("Z", "Y"):
        found = shares(comparison, response, THERMAL, rho=0.6)
        convection, memory = found["thermal.convection"][0], found["thermal.memory"][0]
        assert convection > 0.8
        # Both explain nearly all: the pair stands in the confounders of both.
        assert abs(convection - memory) < 0.12
    confounders = {effect.id: effect.confounders for effect in THERMAL}
    assert "thermal.memory" in confounders["thermal.convection"]
    assert "thermal.convection" in confounders["thermal.memory"]


@pytest.mark.parametrize("name", ["ambient/none", "coolant/strong", "second_source/feed", "interaction/large"])
def test_the_reading_says_what_moves_and_what_it_is_worth(name):
    comparison = case(name, 1)
    effect = next(effect for effect in THERMAL if effect.id == "thermal." + name.split("/")[0])
    variant = shares(comparison, "Z", [effect], rho=0.6)[effect.id][1]
    n = variant.columns.shape[1]
    fitted = Fitted("Z", "um", variant, np.ones(n), np.full(n, 0.1), {"tau_s": (600.0, 1800.0)}, 4.0, 12.3)
    reading = effect.reading(fitted, comparison)
    assert "Z " in reading.statement
    assert " 12.3 µm " in reading.statement
    assert reading.parameters["largest"].value == 12.3
    if "tau_s" in variant.shape:
        assert (reading.parameters["tau_s"].low, reading.parameters["tau_s"].high) == (600.0, 1800.0)
