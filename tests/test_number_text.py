"""Names without their middle, and names that stay different."""

from __future__ import annotations

import pytest

from selector.number_text import shortened, told_apart

HALL = "Werk 3 Linie B Spindelkasten"


@pytest.mark.parametrize("longest", [12, 20, 32])
def test_long_names_that_differ_stay_different_wherever_they_do(longest):
    names = [
        f"{HALL} vorderes Lager Temperatur oben links",
        f"{HALL} hinteres Lager Temperatur oben links",
        f"{HALL} hinteres Lager Temperatur oben rechts",
        "a" * 50 + "1" + "b" * 50,
        "a" * 50 + "2" + "b" * 50,
        "T1",
    ]
    shown = told_apart(names, longest)
    assert len(set(shown)) == len(names)
    assert max(map(len, shown)) <= longest
    assert shown[-1] == "T1"
    assert told_apart(names[:1] * 2, longest) == [shortened(names[0], longest)] * 2
    assert told_apart([], longest) == []


def test_what_fits_stays_as_it_is_and_two_alike_are_no_trap():
    assert told_apart(["x" * 12, "x" * 13, "x" * 14], 12)[0] == "x" * 12
    assert shortened("Verlagerung", 7) == "Ver…ung"
