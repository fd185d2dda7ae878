"""Effects of other packages are found by their entry point; what is no new effect is refused."""

from __future__ import annotations

import sys
from itertools import groupby

import pytest

from selector.cli import exit_status
from selector.diagnosis.effects.catalogue import catalogue, effect_of
from selector.errors import OptionError

MODULE = """
from dataclasses import replace
from selector.diagnosis.effects.thermal.ambient import EFFECT as shipped
EFFECT = replace(shipped, id="acme.draught", title="draught")
NO_EFFECT = 7
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A function that installs a package whose entry point names this."""

    def install(target: str) -> None:
        (tmp_path / "acme_effects.py").write_text(MODULE, encoding="utf-8")
        info = tmp_path / "acme_effects-1.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-effects\nVersion: 1\n", encoding="utf-8")
        (info / "entry_points.txt").write_text(f"[selector.effects]\nours = {target}\n", encoding="utf-8")
        catalogue.cache_clear()

    monkeypatch.syspath_prepend(str(tmp_path))
    yield install
    catalogue.cache_clear()
    sys.modules.pop("acme_effects", None)


def test_an_effect_of_another_package_stands_beside_the_shipped_ones(installed, capsys):
    before = [effect.id for effect in catalogue()]
    installed("acme_effects:EFFECT")
    assert [effect.id for effect in catalogue()] == [*before, "acme.draught"]
    assert exit_status(["effects", "acme.draught"]) == 0
    assert "draught" in capsys.readouterr().out


@pytest.mark.parametrize("target", ["acme_effects:NO_EFFECT", "acme_effects:shipped"])
def test_what_is_no_new_effect_is_refused_with_its_package(installed, target):
    installed(target)
    with pytest.raises(OptionError, match="acme-effects"):
        catalogue()


def test_an_unknown_id_is_told_with_those_that_there_are():
    with pytest.raises(OptionError, match=r"thermal\.memory"):
        effect_of("thermal.ghost")


def test_ids_are_unique_and_families_stand_together():
    ids = [effect.id for effect in catalogue()]
    assert len(ids) == len(set(ids))
    families = [family for family, _ in groupby(effect.family for effect in catalogue())]
    assert len(families) == len(set(families))
