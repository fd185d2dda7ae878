"""CONTRIBUTING.md speaks of the house that stands: its rows, its files, its programs; CITATION.cff of this version."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from selector import __version__
from tests.architecture.public_names import PACKAGE, ROOT

GUIDE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
MOST_LINES = 200
FOLDERS = "selector|tests|docs|benchmarks|fixtures|notebooks|.ci"
PLACEHOLDER = re.compile(r"\b(?:FAMILY|KIND|NAME)\b|/(?:FAMILY|KIND|NAME)\b")


def rows_of_the_contract() -> list[str]:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    return next(contract["layers"] for contract in contracts if contract["type"] == "layers")


def rows_of_the_guide(text: str) -> list[str]:
    """The first column of the picture: modules, and bars between neighbours."""
    picture = re.search(r"^```text\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    assert picture, "no picture of the house"
    return [re.split(r"\s{2,}", line, maxsplit=1)[0] for line in picture[1].splitlines()]


def named_paths(text: str) -> list[str]:
    """Paths from the root of the project, in code and in links, without those that hold a placeholder."""
    of_code = re.findall(rf"`((?:{FOLDERS})/[^`\s]*|[\w.-]+\.(?:toml|md|cff|yaml))`", text)
    of_links = [link for link in re.findall(r"\]\(([^)#]+)[^)]*\)", text) if "://" not in link]
    return [path for path in dict.fromkeys((*of_code, *of_links)) if not PLACEHOLDER.search(path)]


def rooms_of_the_table(text: str) -> list[str]:
    """Folders and files that the table of rooms names, below selector/."""
    found = []
    for row, inside in re.findall(r"^\| `([\w/]+)` \| (.*) \|$", text, flags=re.MULTILINE):
        found += [row, *(f"{row}/{name}" for name in re.findall(r"`([\w.]+)`", inside))]
    return found


def test_it_can_be_read_in_a_quarter_of_an_hour():
    assert len(GUIDE.splitlines()) <= MOST_LINES


def test_its_rows_are_those_of_the_contract():
    assert rows_of_the_guide(GUIDE) == rows_of_the_contract()


def test_every_path_in_it_exists():
    paths = named_paths(GUIDE)
    assert len(paths) > 60
    # those of a study folder are made by `select`
    made = {"study.toml", "machine.toml", "model.toml"}
    missing = [path for path in paths if path not in made and not (ROOT / path).exists()]
    assert not missing, "CONTRIBUTING.md names what is not there"


def test_every_room_in_its_table_exists():
    rooms = rooms_of_the_table(GUIDE)
    assert len(rooms) > 29
    missing = [room for room in rooms if not (PACKAGE / room).exists() and not room.endswith("/_")]
    assert not missing, "CONTRIBUTING.md names rooms that are not there"


@pytest.mark.parametrize(
    "name", ["physics/drive", "physics/thermal", "physics/gauging", "physics/vibration", "diagnosis"]
)
def test_no_room_is_forgotten(name):
    inside = {path.name for path in (PACKAGE / name).iterdir() if (path / "__init__.py").exists()}
    told = {room.removeprefix(f"{name}/") for room in rooms_of_the_table(GUIDE) if room.startswith(f"{name}/")}
    assert inside <= told


NAMED_IN = re.compile(r"`(\w+)`(?: beside it)? (?:in|of) `(selector/[\w/]+\.py)`")


def test_names_stand_in_the_files_that_are_said_to_have_them():
    pairs = NAMED_IN.findall(" ".join(GUIDE.split()))
    assert len(pairs) > 6
    wrong = [
        f"{name} in {file}"
        for name, file in pairs
        if not re.search(rf"\b{re.escape(name)}\b", (ROOT / file).read_text(encoding="utf-8"))
    ]
    assert not wrong


def test_the_checks_see_what_is_wrong():
    # guards the tests above against patterns that find nothing
    text = "```text\ncli      a\na | b    c\n```\n`selector/nowhere.py` `selector/FAMILY/x.py` [a](docs/b.md#c)"
    assert rows_of_the_guide(text) == ["cli", "a | b"]
    assert named_paths(text) == ["selector/nowhere.py", "docs/b.md"]
    assert rooms_of_the_table("| `physics/x` | `y` what · `z.py` |") == ["physics/x", "physics/x/y", "physics/x/z.py"]


def test_the_citation_is_of_this_version():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    said = dict(re.findall(r'^(version|date-released|license): "?([^"\n]+)"?$', citation, flags=re.MULTILINE))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert said["version"] == __version__
    assert (
        said["license"] == tomllib.loads(Path(ROOT, "pyproject.toml").read_text(encoding="utf-8"))["project"]["license"]
    )
    assert f"## {__version__} ({said['date-released']})" in changes
