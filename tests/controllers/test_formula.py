"""The formula for people says exactly what the file computes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.controllers.evaluator import evaluate, formula_text, legend_text, physical_coefficients, physical_slopes
from selector.controllers.model_file import Input, ModelFile, Output, State, Term
from tests.controllers.model_builders import rich_model, rise_model


def one_output(terms: dict, intercept: float = 0.0, **inputs: dict) -> ModelFile:
    return ModelFile(
        name="m",
        inputs=[Input(name=name, **({"valid_min": 0, "valid_max": 10} | fields)) for name, fields in inputs.items()],
        outputs=[
            Output(
                name="Z",
                intercept=intercept,
                terms=[Term(powers=dict(powers), coefficient=value) for powers, value in terms.items()],
            )
        ],
    )


def test_expansion_by_hand():
    # 1 + 3(x1−4)/2 − 2(x3−3)/1.5 + 0.5(x1−4)(x3−3)/3
    intercept, terms = physical_coefficients(rise_model())["Z"]
    assert intercept == pytest.approx(1 - 6 + 4 + 2, abs=1e-15)
    assert terms == {
        (("T1", 1),): pytest.approx(1.0, rel=1e-15),
        (("T3", 1),): pytest.approx(-2.0, rel=1e-15),
        (("T1", 1), ("T3", 1)): pytest.approx(1 / 6, rel=1e-15),
    }
    assert formula_text(rise_model()) == "Z = 1 + 1·ΔT1 − 2·ΔT3 + 0.16667·ΔT1·ΔT3"


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_expanded_polynomial_computes_the_same(seed):
    rng = np.random.default_rng(seed)
    names = ["a", "b", "c"]
    model = ModelFile(
        name="random",
        inputs=[
            Input(
                name=name, reference="absolute", centre=rng.normal(20, 10), scale=rng.uniform(0.1, 9), valid_min=0,
                valid_max=60,
            )
            for name in names
        ],
        outputs=[
            Output(
                name="Z",
                intercept=rng.normal(),
                terms=[
                    Term(powers=powers, coefficient=rng.normal())
                    for powers in ({"c": 3}, {"b": 1, "a": 2}, {"a": 1, "b": 1, "c": 1}, {"a": 1}, {"b": 2})
                ],
            )
        ],
    )  # fmt: skip
    x = rng.uniform(0, 60, size=(20, 3))
    readings = {name: x[:, i] for i, name in enumerate(names)}
    given_by_file = evaluate(model, np.arange(20.0), readings)["Z"]
    intercept, terms = physical_coefficients(model)["Z"]
    parts = [np.full(20, intercept)]
    parts += [value * np.prod([readings[n] ** p for n, p in key], axis=0) for key, value in terms.items()]
    # the expanded form cancels: its rounding error is that of its largest part
    tolerance = 1e-14 * np.max(np.abs(parts), axis=0) * len(parts)
    assert np.all(np.abs(np.sum(parts, axis=0) - given_by_file) <= tolerance)


def test_everything_at_once():
    text = formula_text(rich_model())
    z, y = text.splitlines()
    assert z.startswith("Z = ")
    assert "lag(ΔT1, 1800 s)" in z
    assert "lag(n, 300 s)²" in z
    assert "ΔT1³" in z
    assert "[T амб]²" in z
    slope = 7.7 / 2.3
    assert physical_slopes(rich_model())["Y lower"][1][("T1", 1),] == pytest.approx(slope, rel=1e-15)
    at_zero = 3.0 - 7.7 * 4.1 / 2.3
    assert y.endswith(f" + (−{-at_zero:.5g} + {slope:.5g}·ΔT1)·(PY − 0.25 m)")


def test_terms_are_ordered_by_degree_then_by_sensor():
    terms = {(("T3", 1), ("T1", 1)): 4.0, (("T3", 1),): 2.0, (("T1", 2),): 3.0, (("T1", 1),): 1.0}
    assert formula_text(one_output(terms, T1={}, T3={})) == "Z = 1·ΔT1 + 2·ΔT3 + 4·ΔT1·ΔT3 + 3·ΔT1²"


@pytest.mark.parametrize(
    ("coefficient", "shown"),
    [
        (6.0476, "6.0476·ΔT1"),
        (-2.66666666, "−2.6667·ΔT1"),
        (1.23456789e-7, "1.2346·10⁻⁷·ΔT1"),
        (-4.0e12, "−4·10¹²·ΔT1"),
        (100000.0, "1·10⁵·ΔT1"),
        (99999.0, "99999·ΔT1"),
        (0.00011, "0.00011·ΔT1"),
    ],
)
def test_numbers_have_five_significant_digits(coefficient, shown):
    assert formula_text(one_output({(("T1", 1),): coefficient}, T1={})) == f"Z = {shown}"


def test_absolute_readings_have_no_delta():
    assert formula_text(one_output({(("T1", 1),): 2.0}, 5.0, T1={"reference": "absolute"})) == "Z = 5 + 2·T1"


def test_leftovers_of_cancelling_are_not_shown_but_kept():
    # ((x − 0.1)/0.3)² expands to x²/0.09 − 0.2/0.09·x + …; the second term takes the linear part back but for rounding
    terms = {(("T1", 2),): 1.0, (("T1", 1),): 2 * 0.1 / 0.3}
    model = one_output(terms, T1={"centre": 0.1, "scale": 0.3})
    linear = physical_coefficients(model)["Z"][1][("T1", 1),]
    assert 0.0 < abs(linear) < 1e-15
    assert formula_text(model) == "Z = −0.11111 + 11.111·ΔT1²"


def test_intercept_only_and_zero():
    assert formula_text(one_output({}, -1.5, T1={})) == "Z = −1.5"
    assert formula_text(one_output({}, 0.0, T1={})) == "Z = 0"


def test_coefficients_beyond_float64_are_infinite_not_an_error():
    model = one_output({(("T1", 3),): 1e300}, T1={"scale": 1e-300})
    assert physical_coefficients(model)["Z"][1][("T1", 3),] == np.inf


def test_names_that_would_read_as_formula_are_bracketed():
    assert formula_text(one_output({(("T-1 · 2", 1),): 2.0}, **{"T-1 · 2": {}})) == "Z = 2·Δ[T-1 · 2]"


def test_state_of_an_absolute_input():
    model = one_output({}, T1={"reference": "absolute"}).model_dump()
    model["states"] = (State(name="s", source="T1", tau_s=90.5, centre=20.0, scale=2.0),)
    model["outputs"] = (Output(name="Z", intercept=1.0, terms=(Term(powers={"s": 1}, coefficient=3.0),)),)
    assert formula_text(ModelFile.model_validate(model)) == "Z = −29 + 1.5·lag(T1, 90.5 s)"


def test_legend_says_what_the_symbols_are():
    lines = legend_text(rich_model()).splitlines()
    assert lines[0] == "ΔT1: temperature T1, rise against the start, 0 … 10 K"
    assert lines[1] == "[T амб]: ambient T амб, reading, 18 … 26 °C"
    assert lines[2] == "n: spindle_speed n, reading, 0 … 3000 rpm"
