"""Tables that stand beside the code: every line says what it is meant to."""

from __future__ import annotations

import pytest

from selector.readers.roles.names import _PATTERNS
from selector.units import _SPELLINGS, ROLES, parse_unit, same_dimension
from selector.workbench.typed import FIELDS


def test_words_speak_for_roles_that_there_are_and_none_for_every_name():
    assert set(_PATTERNS) <= set(ROLES)
    assert [role for role, pattern in _PATTERNS.items() if pattern.search("") or pattern.search("#")] == []


@pytest.mark.parametrize(("spelled", "unit"), sorted(_SPELLINGS.items()))
def test_every_spelling_is_found_and_stands_for_a_unit(spelled, unit):
    assert parse_unit(spelled) == unit
    assert same_dimension(unit, unit)


def test_options_have_titles():
    assert [option for option, title in FIELDS.items() if not (option.startswith("--") and title.strip())] == []
