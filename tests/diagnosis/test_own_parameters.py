"""An inertia or a friction that is little beside that of the simulation may be a parameter of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.diagnosis.workflow import diagnosis
from tests.diagnosis.effects.drive_axis import WITH_FRICTION, compared


def named(times: float, field: str, id_: str):
    truth = replace(WITH_FRICTION, **{field: times * getattr(WITH_FRICTION, field)})
    found = diagnosis(compared(truth, WITH_FRICTION, n_runs=2))
    return next(effect for effect in found.effects if effect.id == id_)


def test_a_few_per_cent_are_half_sure_and_told_as_a_parameter():
    effect = named(1.06, "table_kg", "drive.mass")
    assert effect.confidence <= 0.5
    assert "parameters of the simulation" in effect.statement


def test_a_few_per_cent_that_make_unseen_rows_no_better_are_no_name():
    truth = replace(WITH_FRICTION, viscous=1.04 * WITH_FRICTION.viscous)
    found = diagnosis(compared(truth, WITH_FRICTION, n_runs=2))
    assert (found.verdict, found.effects) == ("miscalibrated", ())
    assert [effect.id for effect in found.also_seen] == ["drive.viscous"]


@pytest.mark.parametrize(("field", "id_"), [("table_kg", "drive.mass"), ("coulomb", "drive.coulomb")])
def test_a_quarter_is_physics(field, id_):
    assert "parameters of the simulation" not in named(1.25, field, id_).statement


def test_an_inertia_from_one_run_on_is_a_workpiece_and_no_parameter():
    heavier = compared(replace(WITH_FRICTION, table_kg=1.3 * WITH_FRICTION.table_kg), WITH_FRICTION, every=40)
    as_simulated = compared(WITH_FRICTION, WITH_FRICTION, every=40)
    first = heavier.run_index == 0
    recorded = {name: np.where(first, as_simulated.recorded[name], values) for name, values in heavier.recorded.items()}
    effects = diagnosis(replace(heavier, recorded=recorded)).effects
    effect = next(one for one in effects if one.id == "drive.mass")
    assert "from run r2 on" in effect.statement
    assert "parameters of the simulation" not in effect.statement
