"""The command-line page is what the program says about itself."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
GENERATOR = runpy.run_path(str(ROOT / "docs" / "make_command_line.py"))
COMMANDS = dict(GENERATOR["commands"]())


def test_command_line_page_is_up_to_date():
    assert GENERATOR["PAGE"].read_text(encoding="utf-8") == GENERATOR["page"](), "run `make reference`"


def test_the_commands_of_the_contract_are_there():
    promised = {"describe", "convert", "apply", "model show", "model check", "audit-patent", "select", "demo"}
    promised |= {"predict", "simulate thermal"}
    assert {f"selector {name}" for name in promised} <= set(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_and_option_says_what_it_does(name):
    command = COMMANDS[name]
    assert command.help
    silent = [p.name for p in command.params if not p.help]
    assert not silent


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_documented(name):
    assert f"## `{name}`" in GENERATOR["PAGE"].read_text(encoding="utf-8")
