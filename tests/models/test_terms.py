"""Terms, forms, scaling, and the way back to physical units."""

from __future__ import annotations

import numpy as np
import pytest

from selector.errors import OptionError
from selector.models.design import Form, Scaling, Term, design_matrix, physical_transform, polynomial_terms


def names(terms):
    return [str(term) for term in terms]


@pytest.mark.parametrize(
    ("degree", "interactions", "expected"),
    [
        (1, False, ["a", "b", "c"]),
        (1, True, ["a", "b", "c", "a·b", "a·c", "b·c"]),
        (2, False, ["a", "b", "c", "a^2", "b^2", "c^2"]),
        (2, True, ["a", "b", "c", "a^2", "a·b", "a·c", "b^2", "b·c", "c^2"]),
        (3, False, ["a", "b", "c", "a^2", "b^2", "c^2", "a^3", "b^3", "c^3"]),
    ],
)
def test_terms_of_a_form(degree, interactions, expected):
    assert names(polynomial_terms(["a", "b", "c"], degree, interactions=interactions)) == expected


def test_cubic_with_products_has_all_monomials_up_to_degree_three():
    # C(3 + 3, 3) − 1 monomials of degree 1 to 3 in three variables
    terms = polynomial_terms(["a", "b", "c"], 3, interactions=True)
    assert len(terms) == 19
    assert len(set(terms)) == 19


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("interactions", [False, True])
def test_every_form_is_hierarchical(degree, interactions):
    """Taking one factor away from a term gives a term that is there too."""
    terms = set(polynomial_terms(["a", "b", "c"], degree, interactions=interactions))
    for term in terms:
        for name, power in term.powers:
            smaller = {n: p - (n == name) for n, p in term.powers if p - (n == name) > 0}
            assert not smaller or Term.of(smaller) in terms, (str(term), name, power)


def test_simpler_forms_are_nested():
    forms = Form(2, True).simpler()
    assert forms == (Form(1), Form(1, True), Form(2), Form(2, True))
    for form in forms:
        assert set(form.terms("ab")) <= set(Form(2, True).terms("ab"))
    assert Form(3).simpler() == (Form(1), Form(2), Form(3))


@pytest.mark.parametrize("degree", [0, 4, -1])
def test_other_degrees_are_refused(degree):
    with pytest.raises(OptionError, match=f"degree {degree}"):
        Form(degree)


def test_term_knows_its_degree_and_variables():
    term = Term.of({"T1": 2, "T3": 1})
    assert (term.degree, term.variables, str(term)) == (3, ("T1", "T3"), "T1^2·T3")


def test_design_matrix_is_the_products():
    rng = np.random.default_rng(0)
    z = rng.normal(size=(20, 3))
    terms = polynomial_terms(["a", "b", "c"], 3, interactions=True)
    made = design_matrix(z, ["a", "b", "c"], terms)
    position = {"a": 0, "b": 1, "c": 2}
    for j, term in enumerate(terms):
        direct = np.prod([z[:, position[name]] ** power for name, power in term.powers], axis=0)
        assert made[:, j] == pytest.approx(direct, rel=1e-14)  # a few roundings of a product of at most three


def test_design_matrix_of_a_list_that_is_not_hierarchical():
    z = np.array([[2.0, 3.0]])
    assert design_matrix(z, ["a", "b"], [Term((("a", 2), ("b", 1)))]).tolist() == [[12.0]]
    assert design_matrix(z, ["a", "b"], [Term((("b", 3),)), Term((("a", 1),))]).tolist() == [[27.0, 2.0]]
    assert design_matrix(z, ["a", "b"], []).shape == (1, 0)


def test_scaling_of_some_variables_in_another_order():
    scaling = Scaling(("a", "b", "c"), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    assert scaling.only(["c", "a"]) == Scaling(("c", "a"), (3.0, 1.0), (6.0, 4.0))
    assert scaling.scaled(np.array([[5.0, 7.0, 9.0]])).tolist() == [[1.0, 1.0, 1.0]]


def test_physical_transform_by_hand():
    """((x − 3)/2)² = x²/4 − 3x/2 + 9/4."""
    terms, matrix = physical_transform([Term((("x", 1),)), Term((("x", 2),))], Scaling(("x",), (3.0,), (2.0,)))
    assert names(terms) == ["x", "x^2"]
    assert matrix @ [0.0, 0.0, 1.0] == pytest.approx([2.25, -1.5, 0.25])


def test_physical_transform_adds_the_terms_that_an_expansion_needs():
    terms, matrix = physical_transform([Term((("x", 1), ("y", 1)))], Scaling(("x", "y"), (3.0, 5.0), (1.0, 1.0)))
    assert names(terms) == ["x·y", "y", "x"] or names(terms) == ["x·y", "x", "y"]
    found = dict(zip(["", *names(terms)], matrix @ [0.0, 1.0], strict=True))
    assert found == {"": 15.0, "x": -5.0, "y": -3.0, "x·y": 1.0}
