"""Effects of other packages are found by their entry point; what is no new effect is refused."""

from __future__ import annotations

import sys
from itertools import groupby

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.diagnosis.effects.catalogue import catalogue, effect_of
from selector.diagnosis.matching.alignment import comparison_of
from selector.diagnosis.workflow import diagnosis
from selector.errors import OptionError
from selector.recording import Channel, Recording

MODULE = """
from dataclasses import replace
import numpy as np
from selector.diagnosis.effects.effect import Variant
from selector.diagnosis.effects.thermal.sources import EFFECTS

shipped = EFFECTS[0]
EFFECT = replace(shipped, id="acme.draught", title="draught")
NO_EFFECT = 7

def fails(*_):
    raise ZeroDivisionError("no such bearing")

def three_rows(comparison, response):
    return [Variant(np.ones((3, 1)), ("three",))]

def not_finite(comparison, response):
    return [Variant(np.full((len(comparison.time_s), 1), np.nan), ("nothing",))]

UNTESTABLE = replace(EFFECT, testable=fails)
WITHOUT_VARIANTS = replace(EFFECT, testable=lambda *_: None, variants=fails)
SHORT = replace(EFFECT, testable=lambda *_: None, variants=three_rows)
NOT_FINITE = replace(EFFECT, testable=lambda *_: None, variants=not_finite)
NO_VARIANTS = replace(EFFECT, testable=lambda *_: None, variants=lambda *_: [1.0])
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A function that installs a package whose entry point names this."""

    def install(target: str) -> None:
        (tmp_path / "acme_effects.py").write_text(MODULE, encoding="utf-8")
        info = tmp_path / "acme_effects-1.dist-info"
        info.mkdir(exist_ok=True)
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


@pytest.mark.parametrize(
    "target", ["acme_effects:NO_EFFECT", "acme_effects:shipped", "acme_effects:MISSING", "acme_nowhere:EFFECT"]
)
def test_what_is_no_new_effect_is_refused_with_its_package(installed, target):
    installed(target)
    with pytest.raises(OptionError, match="acme-effects"):
        catalogue()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("UNTESTABLE", "no such bearing"),
        ("WITHOUT_VARIANTS", "no such bearing"),
        ("SHORT", r"\(3, 1\)"),
        ("NOT_FINITE", "no finite numbers"),
        ("NO_VARIANTS", "float"),
    ],
)
def test_what_fails_in_an_effect_is_told_with_its_id_and_package(installed, name, words):
    installed(f"acme_effects:{name}")
    random, rows = np.random.default_rng(0), np.arange(300)
    table = {"Z": pd.DataFrame({"Z": random.normal(size=300)}, index=pd.Index(rows * 60.0))}
    simulated = {"Z": pd.DataFrame({"Z": np.sin(rows / 20.0)}, index=pd.Index(rows * 60.0))}
    channels = [Channel("Z", "displacement", "um")]
    comparison = comparison_of(Recording.from_runs(table, channels), Recording.from_runs(simulated, channels))
    with pytest.raises(OptionError, match=words) as refused:
        diagnosis(comparison, effects=[effect_of("acme.draught")])
    assert "acme.draught" in refused.value.where
    assert "acme-effects" in refused.value.where


def test_an_unknown_id_is_told_with_those_that_there_are():
    with pytest.raises(OptionError, match=r"thermal\.memory"):
        effect_of("thermal.ghost")


def test_ids_are_unique_and_families_stand_together():
    ids = [effect.id for effect in catalogue()]
    assert len(ids) == len(set(ids))
    families = [family for family, _ in groupby(effect.family for effect in catalogue())]
    assert len(families) == len(set(families))
