"""`selector effects` lists every effect once, explains one, and tells what there is when an id is unknown."""

from __future__ import annotations

import json

import pytest

from selector.cli import exit_status
from selector.diagnosis.effects.catalogue import catalogue


def printed(capsys, *arguments: str) -> str:
    assert exit_status(["effects", *arguments]) == 0
    return capsys.readouterr().out


def test_every_effect_has_a_line(capsys):
    lines = printed(capsys).splitlines()
    for effect in catalogue():
        assert sum(line.split()[:1] == [effect.id] for line in lines) == 1


def test_one_effect_is_explained(capsys):
    effect = next(one for one in catalogue() if one.id == "thermal.memory")
    text = " ".join(printed(capsys, "thermal.memory").split())
    for part in (effect.physics, effect.needs, effect.refuted_by, effect.experiment, effect.reference):
        assert " ".join(part.split()) in text
    assert all(parameter.name in text for parameter in effect.parameters)


def test_json_holds_all_that_is_known(capsys):
    found = json.loads(printed(capsys, "--json"))
    assert found["schema"] == "selector.effects/1"
    assert [one["id"] for one in found["effects"]] == [effect.id for effect in catalogue()]
    for one, effect in zip(found["effects"], catalogue(), strict=True):
        assert one["confounders"] == list(effect.confounders)
        assert [parameter["unit"] for parameter in one["parameters"]] == [p.unit for p in effect.parameters]


def test_an_unknown_effect_is_bad_input(capsys):
    assert exit_status(["effects", "thermal.ghost"]) == 2
    told = capsys.readouterr().err
    assert "thermal.ghost" in told
    assert "thermal.memory" in told


@pytest.mark.parametrize("field", ["physics", "reference", "needs", "refuted_by", "experiment", "acts_at", "title"])
def test_nothing_of_an_effect_is_empty(field):
    assert not [effect.id for effect in catalogue() if not getattr(effect, field).strip()]


def test_confounders_are_effects():
    known = {effect.id for effect in catalogue()}
    assert not {(effect.id, other) for effect in catalogue() for other in effect.confounders if other not in known}
