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
    assert one.statement == ("transducer.probe.mass_kg is 20 kg; machines have 0.0001 to 1 kg. 20 g would be 0.02 kg.")
    assert one.suggestion == "write transducer.probe.mass_kg = 0.02 if g was meant"
    assert one.evidence["perhaps"] == pytest.approx(0.02)


@pytest.mark.parametrize("mass", [0.0, 1e-4, 1.0])
def test_what_is_usual_and_what_is_switched_off_is_not_told(mass):
    assert found({"transducer": {"probe": {"mass_kg": mass}}}) == []


def test_entries_of_arrays_count_from_1_and_no_unit_may_fit():
    (one,) = found({"grinding": {"stages": ({"feed": 1.0}, {"feed": -50.0})}})
    assert one.statement == "grinding.stages[2].feed is -50; machines have up to 10."
    assert one.evidence["perhaps"] is None
    assert one.suggestion == "correct it if it is a slip"
