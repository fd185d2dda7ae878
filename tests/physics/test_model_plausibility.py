"""Numbers that no machine has are told with the unit that was perhaps meant, whatever the physics."""

from __future__ import annotations

from typing import Annotated

import pytest

from selector.physics.model_fields import Unit, Usual, unlikely_values
from selector.physics.model_text import Entry


class Probe(Entry):
    mass_kg: Annotated[float, Unit("kg"), Usual(1e-4, 1.0, {"g": 1e-3})]
    stiffness: float = 1.0


class Transducer(Entry):
    probe: Probe


class Stage(Entry):
    feed: Annotated[float, Usual(0.0, 10.0, {"mm": 1e3})]


class Grinding(Entry):
    stages: tuple[Stage, ...]


class File(Entry):
    transducer: Transducer | None = None
    grinding: Grinding | None = None


def found(values):
    return list(unlikely_values(File.model_validate(values)))


def test_the_unit_that_was_perhaps_meant_is_named():
    (one,) = found({"transducer": {"probe": {"mass_kg": 20.0, "stiffness": 1e9}}})
    assert one.id == "unlikely-value"
    for said in ("transducer.probe.mass_kg is 20 kg", "0.0001 to 1 kg", "20 g ", "0.02 kg"):
        assert said in one.statement
    assert "transducer.probe.mass_kg = 0.02" in one.suggestion
    assert one.evidence["perhaps"] == pytest.approx(0.02)


@pytest.mark.parametrize("mass", [0.0, 1e-4, 1.0])
def test_what_is_usual_and_what_is_switched_off_is_not_told(mass):
    assert found({"transducer": {"probe": {"mass_kg": mass}}}) == []


def test_entries_of_arrays_count_from_1_and_no_unit_may_fit():
    (one,) = found({"grinding": {"stages": ({"feed": 1.0}, {"feed": -50.0})}})
    assert "grinding.stages[2].feed is -50;" in one.statement
    assert one.statement.endswith(" 10.")
    assert one.evidence["perhaps"] is None
    # no other value is offered
    assert "=" not in one.suggestion
