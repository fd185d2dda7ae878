"""The public names are a promise: they change only on purpose."""

from __future__ import annotations

import difflib

import pytest

from tests.architecture.public_names import NOT_FOR_IMPORT, ROOT, SNAPSHOT, listing, public_names

UPDATE = "Run `make reference` when the change is meant, and say so in CHANGELOG.md."


def test_public_names_are_those_of_the_list():
    written = SNAPSHOT.read_text(encoding="utf-8").splitlines()
    difference = list(
        difflib.unified_diff(written, listing().splitlines(), "listed", "in the source", lineterm="", n=0)
    )
    assert not difference, "\n".join([*difference, UPDATE])


@pytest.mark.parametrize("kind", ["function or class"])
def test_everything_public_says_what_it_is(kind):
    silent = [
        f"selector/{name.module.removeprefix('selector.').replace('.', '/')} line {name.line}: {name.name}"
        for name in public_names()
        if name.parameters is not None and not name.docstring
    ]
    assert not silent, f"no docstring on this public {kind}:\n" + "\n".join(silent)


def test_the_collector_sees_what_is_known_to_be_public():
    # guards the two tests above against an empty collection
    names = {str(name) for name in public_names()}
    assert "selector.units.parse_unit(text)" in names
    assert "selector.recording.Recording.time_s(run)" in names
    assert "selector.recording.Recording(frame, channels, provenance, follows)" in names
    assert not any(name.startswith(NOT_FOR_IMPORT) for name in names)
    assert (ROOT / "selector").is_dir()
