"""Names with letters that controls do not know stay readable in every written file."""

from __future__ import annotations

import tomllib
import unicodedata
from pathlib import Path

import pytest

from selector.controllers import Guard, Input, ModelFile, Output, OutputLimits, Term
from selector.controllers.program.language import plain
from selector.controllers.writers import exported
from selector.controllers.writers.targets import TARGETS
from tests.controllers.golden_text import texts_of


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("Spindellager vorne (Öl)", "Spindellager vorne (Oel)"),
        ("Ständer oben", "Staender oben"),
        ("außen, GRÖẞE, Übermaß", "aussen, GROeSSE, Uebermass"),
        ("tête, cœur, señal, çà", "tete, coeur, senal, ca"),
        ("Łożysko, čelo, ůhel, lejeløs", "Lozysko, celo, uhel, lejeloes"),
        ("10 µm/°C, 3 μm·m⁻², ½ – Δ", "10 um/degC, 3 um*m^-2, 1/2 - d"),
        ("温度 1", "_ 1"),
        ("ж1", "?1"),
        ("＊／ x；／＊ ？？／", "_ x;_ _/"),
    ],
)
def test_letters_are_spelled(name, told):
    assert plain(name) == plain(unicodedata.normalize("NFD", name)) == told


@pytest.mark.parametrize("target", TARGETS)
def test_no_written_file_has_a_question_mark_for_an_umlaut(target):
    name = "Ständer (Öl)"
    item = Input(name=name, reference="absolute", valid_min=15.0, valid_max=40.0, centre=25.0, scale=2.0)
    output = Output(name="Höhe", axis="Z", intercept=0.1, terms=(Term(powers={name: 1}, coefficient=3.0),))
    limits = (OutputLimits(output="Höhe", clamp_um=100.0, slew_um_per_s=2.0),)
    model = ModelFile(name="Fräse", inputs=(item,), outputs=(output,), guard=Guard(limits=limits))
    files = texts_of(TARGETS[target].write(model).files)
    assert all(text.isascii() for text in files.values())
    whole = "\n".join(files.values())
    assert "fraese" in whole.lower()
    assert "staender" in whole.lower()
    assert not any(lost in whole for lost in ("Fr?se", "St?nder", "H?he", "?l)"))


def test_every_target_has_a_sheet_and_none_is_left_over():
    sheets = tomllib.loads(Path(exported.__file__).with_name("sheets.toml").read_text(encoding="utf-8"))
    assert set(sheets) == set(TARGETS)
    assert {part for told in sheets.values() for part in told} == {"install", "silently", "sign"}
