"""Wilkinson's notation as terms: what it means, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from selector.errors import OptionError
from selector.models.design import ListedTerms, Scaling, Term, hierarchical, physical_transform
from selector.models.formula import formula_of


def written(text: str) -> list[str]:
    return [str(term) for term in formula_of(text).terms]


@pytest.mark.parametrize(
    ("text", "terms"),
    [
        ("Z ~ T1 + T3 + T1:T3", ["T1", "T3", "T1·T3"]),
        ("Z ~ T1*T3", ["T1", "T3", "T1·T3"]),
        ("Z ~ (T1 + T2 + T3)**2 - T1:T2", ["T1", "T2", "T3", "T1·T3", "T2·T3"]),
        ("Z~T1+I(T1**2)+I(T1^3)", ["T1", "T1^2", "T1^3"]),
        ("Z ~ T1 + {T3**2}:T1", ["T1", "T3^2·T1"]),
        ("Z ~ `Öl vorne [°C]` + I(`T 1`**2)", ["Öl vorne [°C]", "T 1^2"]),
        ("Z ~ `a+ +b` + `T/`", ["a+ +b", "T/"]),
        ("Z ~ 1 + T3 + T1 + T3", ["T3", "T1"]),
        ("Z ~ T1:T3", ["T1·T3"]),
    ],
)
def test_what_it_says(text, terms):
    assert written(text) == terms


def test_several_responses_stand_left_of_the_tilde():
    assert formula_of("Z + Y ~ T3 + T1").responses == ("Z", "Y")
    assert formula_of("Z + Y ~ T3 + T1").variables == ("T3", "T1")


@pytest.mark.parametrize(
    "text",
    [
        "Z", "T1 + T3", "Z ~", "Z ~ 1", "~ T1", "Z ~ T1 +", "Z ~ T1 ~ T2", "Z ~ T1 | T3", "Z ~ T1 - 1", "",
        "Z ~ T1 + T1^2", "Z ~ I(T1**4)", "Z ~ T1:T2:T3:T4", "Z ~ log(T1)", "Z ~ I(T1 + T2)", "Z ~ 0 + T1", "Z ~ 2:T1",
        "log(Z) ~ T1", "Z:Y ~ T1", "Z ~ __import__('os').getcwd()", "Z ~ " + "(" * 5000 + "T1", "Z ~ .", "Z ~ `T1",
        "Z ~ (" + "+".join(f"T{i}" for i in range(30)) + ")**2", "Z ~ T1\x1b[31m", "Z ~ T1 @ T2", "Z ~ T1**2",
        "Z ~ (T1 + T2)**9", "Z ~  + T1", "Z ~ T1 + + T3", "Z ~ T1 : ", "Z ~ T1 + * T3", "+ Z ~ T1 +",
    ],
)  # fmt: skip
def test_what_is_no_polynomial_with_an_intercept_is_refused(text):
    with pytest.raises(OptionError) as caught:
        formula_of(text)
    assert caught.value.where == "--formula"
    assert "\x1b" not in caught.value.expected


def test_a_list_knows_whether_products_stand_without_their_factors():
    assert ListedTerms(formula_of("Z ~ T1*T3 + I(T1**2)").terms).is_hierarchical
    assert not ListedTerms(formula_of("Z ~ T1 + T1:T3").terms).is_hierarchical
    assert not ListedTerms(formula_of("Z ~ I(T1**2)").terms).is_hierarchical


def test_the_closure_adds_every_factor_once():
    added = hierarchical([Term.of({"T1": 2, "T3": 1})])
    assert {str(term) for term in added} == {"T1", "T3", "T1^2", "T1·T3", "T1^2·T3"}
    assert ListedTerms(added).is_hierarchical


def test_about_zero_a_product_stays_alone_in_the_readings():
    scaling = Scaling(("T1", "T3"), (5.0, -2.0), (2.0, 4.0)).about_zero()
    terms, matrix = physical_transform([Term.of({"T1": 1, "T3": 1})], scaling)
    assert [str(term) for term in terms] == ["T1·T3"]
    np.testing.assert_array_equal(matrix, [[1.0, 0.0], [0.0, 1 / 8]])
