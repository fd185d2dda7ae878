"""Modes of the same tests, which several predictions are made from, are searched once."""

from __future__ import annotations

import pickle
from collections.abc import Iterator

import pytest

from selector.physics.thermal.modes import choice


@pytest.fixture(scope="module")
def modes_chosen_once() -> Iterator[None]:
    """Within a module, `choose_modes` answers from memory what it was asked before: all of its tests and responses."""
    chosen, known = choice.choose_modes, {}

    def shared(tests, responses):
        asked = pickle.dumps((tests, responses))
        if asked not in known:
            known[asked] = chosen(tests, responses)
        return known[asked]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(choice, "choose_modes", shared)
        yield
