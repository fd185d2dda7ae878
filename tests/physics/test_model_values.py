"""Sections that are made from dataclasses, and dataclasses that are made from sections."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from selector.errors import InputError
from selector.physics.model_fields import entry_of, refused, value_of


@dataclass(frozen=True)
class Inner:
    count: int
    depth_m: float = 0.5


@dataclass(frozen=True)
class Outer:
    mass_kg: float
    side: Literal["left", "right"] = "left"
    inner: Inner | None = None
    table_m: tuple[float, ...] = ()
    pair_um: tuple[float, float] = (0.0, 1.0)
    on: bool = False
    whole: Inner = field(default_factory=lambda: Inner(3))

    def __post_init__(self) -> None:
        if self.mass_kg <= 0:
            raise InputError(f"{self.mass_kg:g}", expected="above 0", where="mass_kg", advice="correct it")


numbers = st.floats(-1e6, 1e6)
inners = st.builds(Inner, st.integers(0, 100), numbers)


@given(
    st.builds(
        Outer, st.floats(1e-3, 1e6), st.sampled_from(["left", "right"]), st.none() | inners,
        st.lists(numbers, max_size=5).map(tuple), st.tuples(numbers, numbers), st.booleans(), inners,
    )
)  # fmt: skip
def test_a_value_comes_back_from_its_section(value):
    said = {
        name: vars(held) if isinstance(held, Inner) else held for name, held in vars(value).items() if held is not None
    }
    section = entry_of(Outer).model_validate(said)
    assert value_of(Outer, section) == value
    # what was said and nothing else is plain again
    assert section.model_dump(exclude_unset=True) == said


def test_what_is_left_out_is_the_default_of_the_value():
    section = entry_of(Outer).model_validate({"mass_kg": 2})
    assert value_of(Outer, section) == Outer(2.0)
    assert section.model_fields_set == {"mass_kg"}


@pytest.mark.parametrize(
    "bad",
    [
        {"mass_kg": "2"}, {"mass_kg": float("nan")}, {"mass_kg": 1e16}, {"mass_kg": True}, {"mass_kg": 1.0, "on": 1},
        {"mass_kg": 1.0, "side": "up"}, {"mass_kg": 1.0, "inner": {"count": 1.5}}, {"mass_kg": 1.0, "other": 1.0},
        {"mass_kg": 1.0, "pair_um": [1.0]}, {"mass_kg": 1.0, "table_m": ["a"]}, {},
    ],
    ids=str,
)  # fmt: skip
def test_values_of_another_kind_are_refused(bad):
    with pytest.raises(ValidationError):
        entry_of(Outer).model_validate(bad)


def test_a_kind_stands_before_the_fields_and_is_no_field():
    section = entry_of(Inner, called="inner").model_validate({"kind": "inner", "count": 2})
    assert value_of(Inner, section) == Inner(2)
    assert list(type(section).model_fields) == ["kind", "count", "depth_m"]


def test_what_the_value_refuses_is_refused_at_its_key():
    section = entry_of(Outer).model_validate({"mass_kg": -1.0})
    with pytest.raises(InputError) as refusal:
        value_of(Outer, section)
    assert refused(refusal.value, ("axes", "X"), section)[0] == ("axes", "X", "mass_kg")
    elsewhere = InputError("", expected="", where="a machine", advice="")
    assert refused(elsewhere, ("axes", "X"), section)[0] == ("axes", "X")


def test_a_field_that_no_file_can_hold_is_a_mistake_of_the_program():
    @dataclass(frozen=True)
    class Odd:
        when: bytes

    with pytest.raises(TypeError, match="bytes"):
        entry_of(Odd)
