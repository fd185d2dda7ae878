"""The bound of single precision is never below what is measured, and no idle talk."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.controllers import Fallback, Guard, Input, ModelFile, Output, OutputLimits, PositionPart, State, Term
from selector.controllers.evaluator import axes_of
from selector.controllers.model_file import read_model
from selector.controllers.replay.parts import Rows, reference_answers
from selector.controllers.single_precision import (
    WORTH_A_WARNING_UM,
    largest_reading,
    rounding_errors_um,
    single_precision_findings,
)
from tests.controllers.model_builders import PATENT, rise_model

UNITS = [("temperature", "degC", 12.0), ("spindle_speed", "rpm", 8000.0), ("position", "m", 0.7)]


@st.composite
def models(draw: st.DrawFn) -> ModelFile:
    """Up to four inputs of any role and range with memory, absurd centres, terms that cancel, a slope, a fallback."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    far = draw(st.sampled_from([0.0, 0.0, 1e3, 1e6]))
    inputs, states = [], []
    for k in range(draw(st.integers(1, 4))):
        role, unit, span = draw(st.sampled_from(UNITS))
        width = span * rng.uniform(0.1, 1.0)
        low = float(rng.choice([-0.2, 0.0, 3.0])) * width
        reference = "rise" if low <= 0.0 and unit == "degC" else "absolute"
        scaling = {"centre": far + float(low + width * rng.uniform(-1.0, 2.0)), "scale": width * rng.uniform(0.1, 2.0)}
        inputs.append(Input(name=f"i{k}", role=role, unit=unit, reference=reference, valid_min=low,
                            valid_max=low + width, **scaling))  # fmt: skip
        states.append(State(name=f"s{k}", source=f"i{k}", tau_s=10.0 ** rng.uniform(0.0, 5.5), **scaling))
    names = [of.name for of in (*inputs, *states)]
    size = 10.0 ** rng.uniform(-2.0, 2.0) / (1.0 if far == 0.0 else 1e3)

    def terms() -> tuple[Term, ...]:
        products = {}
        for _ in range(int(rng.integers(1, 5))):
            chosen = sorted(rng.choice(names, min(len(names), int(rng.integers(1, 4))), replace=False))
            products[frozenset(chosen)] = {str(name): int(rng.integers(1, 3)) for name in chosen}
        found = [Term(powers=powers, coefficient=float(rng.normal(0.0, size))) for powers in products.values()]
        if draw(st.booleans()):
            # a sensor and its memory are nearly the same: what cancels is a thousand times what stays
            found = [
                Term(powers={"i0": 3}, coefficient=1e3 * size),
                *found,
                Term(powers={"s0": 3}, coefficient=-1e3 * size),
            ]
        unique = {frozenset(term.powers.items()): term for term in found}
        return tuple(unique.values())

    part = PositionPart(axis="Y", reference_m=0.2501, valid_min_m=-0.1, valid_max_m=0.6, intercept=3.0, terms=terms())
    outputs = (Output(name="Z", intercept=1.23, terms=terms()), Output(name="Y", intercept=0.1, position=part))
    clamp = float(rng.choice([20.0, 1e6, 1e8]))
    limits = tuple(OutputLimits(output=o.name, clamp_um=clamp, slew_um_per_s=1e9) for o in outputs)
    fallbacks, on_fault = (), "hold"
    if len(inputs) > 1 and draw(st.booleans()):
        less = (
            Output(name="Z", intercept=0.3, terms=(Term(powers={"i1": 2}, coefficient=size),)),
            outputs[1].model_copy(update={"position": part.model_copy(update={"terms": ()})}),
        )
        fallbacks, on_fault = (Fallback(without=("i0",), inputs=tuple(inputs[1:]), outputs=less),), "fallback"
    return ModelFile(name="random", inputs=tuple(inputs), states=tuple(states), outputs=outputs, fallbacks=fallbacks,
                     guard=Guard(limits=limits, on_fault=on_fault, recover_after_s=0.0))  # fmt: skip


def calls(model: ModelFile, seed: int, n: int = 120) -> tuple[Rows, dict[str, float]]:
    """Readings in and beyond the valid ranges, corners, some missing, a restart; the largest magnitudes of readings."""
    rng = np.random.default_rng(seed)
    readings = np.empty((n, len(model.inputs)))
    for k, item in enumerate(model.inputs):
        share = rng.choice([0.0, 1.0, -0.1, 1.2, 0.5], n) if rng.random() < 0.5 else rng.uniform(0.0, 1.0, n)
        readings[:, k] = item.valid_min + share * (item.valid_max - item.valid_min)
        if item.reference == "rise":
            readings[0, k] = 0.0
            readings[:, k] += rng.uniform(-20.0, 60.0)
        readings[rng.random(n) < 0.03, k] = np.nan
    dt_s = rng.choice([0.125, 1.0, 1.0, 10.0, 60.0, 3600.0], n)
    yes, positions = np.ones(n, dtype=bool), rng.choice([-0.1, 0.6, 0.2501, 0.1234567], (n, len(axes_of(model))))
    rows = Rows(dt_s, readings, positions, yes, yes, np.arange(n) == n // 2, np.full(n, 600.0))
    largest = np.nanmax(np.abs(readings), axis=0).tolist()
    return rows, dict(zip((item.name for item in model.inputs), largest, strict=True))


@settings(max_examples=40)
@given(models(), st.integers(0, 2**32 - 1))
def test_the_bound_holds(model, seed):
    rows, largest = calls(model, seed)
    single, double = reference_answers(model, rows, np.float32), reference_answers(model, rows)
    # readings at the very end of a range do not make another verdict: ranges limit here
    np.testing.assert_array_equal(single.mode, double.mode)
    errors = rounding_errors_um(model, largest, calls_per_s=1)
    for k, output in enumerate(model.outputs):
        assert np.abs(single.correction_um - double.correction_um)[:, k].max() <= errors[output.name]


@pytest.mark.parametrize("which", ["patent", "far", "cancelling"])
def test_the_bound_is_no_idle_talk(which):
    """At most some hundred times what is measured: roundings are not all at their worst at once."""
    model = {
        "patent": read_model(PATENT),
        "far": rise_model(
            inputs=(
                Input(name="T1", centre=1e6, scale=2.0, valid_min=0.0, valid_max=9.7),
                Input(name="T3", centre=3.0, scale=1.5, valid_min=-1.0, valid_max=8.0),
            ),
            outputs=(Output(name="Z", intercept=5e5, terms=(Term(powers={"T1": 1}, coefficient=1.0),)),),
        ),
        "cancelling": rise_model(
            states=(State(name="late", source="T1", tau_s=100.0),),
            outputs=(
                Output(
                    name="Z",
                    intercept=0.0,
                    terms=(Term(powers={"T1": 2}, coefficient=1e5), Term(powers={"late": 2}, coefficient=-1e4)),
                ),
            ),
        ),
    }[which]
    limits = tuple(OutputLimits(output=o.name, clamp_um=1e8, slew_um_per_s=1e9) for o in model.outputs)
    model = model.model_copy(update={"guard": Guard(limits=limits, recover_after_s=0.0), "fallbacks": ()})
    rows, largest = calls(model, 3, 2000)
    measured = reference_answers(model, rows, np.float32).correction_um - reference_answers(model, rows).correction_um
    bound = rounding_errors_um(model, largest, calls_per_s=1)["Z"]
    assert np.abs(measured[:, 0]).max() <= bound <= 300.0 * np.abs(measured[:, 0]).max()


def test_memory_of_hours_stands_still_as_far_from_its_aim_as_the_bound_says():
    item = Input(name="T1", reference="absolute", valid_min=0.0, valid_max=10.0)
    model = rise_model(
        inputs=(item,),
        states=(State(name="late", source="T1", tau_s=3000.0),),
        outputs=(Output(name="Z", intercept=0.0, terms=(Term(powers={"late": 1}, coefficient=1.0),)),),
        guard=Guard(limits=(OutputLimits(output="Z", clamp_um=100.0, slew_um_per_s=1e9),)),
    )
    n = 12_000
    readings = np.full((n, 1), 8.0014)
    readings[0] = 8.0
    yes = np.ones(n, dtype=bool)
    rows = Rows(np.ones(n), readings, np.zeros((n, 0)), yes, yes, ~yes, np.zeros(n))
    single, double = (reference_answers(model, rows, number).correction_um[:, 0] for number in (np.float32, float))
    # from the first minute on, in which start readings become believed
    assert np.ptp(single[100:]) == 0.0 < np.ptp(double[100:])
    bound = rounding_errors_um(model, calls_per_s=1)["Z"]
    assert 0.3 * bound < np.abs(single - double).max() <= bound
    # looked at once a minute, it goes on
    assert rounding_errors_um(model, calls_per_s=1, shortest_s=60.0)["Z"] < 0.1 * bound


def test_a_bound_beyond_a_hundredth_of_a_micrometre_is_a_warning():
    (fine,) = single_precision_findings(rise_model(), "x.c")
    assert (fine.level, fine.suggestion) == ("info", "")
    assert 0.0 < fine.evidence["bound_um"] < WORTH_A_WARNING_UM
    far = rise_model(inputs=tuple(item.model_copy(update={"centre": 1e6}) for item in rise_model().inputs))
    (finding,) = single_precision_findings(far, "x.c")
    assert finding.level == "warning"
    # nothing is larger than twice the clamp, also where numbers overflow
    huge = rise_model(outputs=(Output(name="Z", intercept=0.0, terms=(Term(powers={"T1": 3}, coefficient=1e38),)),))
    clamped = huge.model_copy(update={"guard": Guard(limits=(OutputLimits(output="Z", clamp_um=7.0),))})
    assert rounding_errors_um(clamped)["Z"] == pytest.approx(14.0, rel=1e-4)


def test_readings_are_as_large_as_their_limits_or_as_a_warm_machine():
    free = Input(name="T1", valid_min=-2.0, valid_max=10.0)
    assert largest_reading(free) == 70.0
    assert largest_reading(free.model_copy(update={"reading_min": -15.0, "reading_max": 45.0})) == 45.0
    assert largest_reading(free.model_copy(update={"reference": "absolute"})) == 10.0
    model = rise_model()
    small, large = (rounding_errors_um(model, {"T1": size, "T3": size})["Z"] for size in (10.0, 1000.0))
    assert large > 5.0 * small
