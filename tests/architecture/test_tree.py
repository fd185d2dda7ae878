"""The tree reads like a paper: short files, telling names, nothing that belongs to one machine only."""

from __future__ import annotations

import ast
import platform
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

from tests.architecture.public_names import GROUND, PACKAGE, ROOT, parsed

LONGEST_FILE = 600
FORBIDDEN_NAMES = {"utils", "util", "helpers", "helper", "misc", "common", "manager", "base", "stuff"}
FORBIDDEN_PREFIXES = ("get_", "compute_")
SOURCES = sorted([*PACKAGE.rglob("*.py"), *GROUND.rglob("*.py")])


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def test_no_source_file_is_longer_than_one_question_needs():
    lengths = {relative(path): len(path.read_text(encoding="utf-8").splitlines()) for path in SOURCES}
    assert len(lengths) > 5
    too_long = {name: lines for name, lines in lengths.items() if lines > LONGEST_FILE}
    assert not too_long, f"more than {LONGEST_FILE} lines; split by question: {too_long}"


def test_every_module_says_which_question_it_answers():
    silent = [relative(path) for path in SOURCES if not ast.get_docstring(parsed(path))]
    assert not silent


def test_no_drawer_for_everything():
    drawers = [
        relative(path)
        for path in [*PACKAGE.rglob("*"), *GROUND.rglob("*"), *(ROOT / "tests").rglob("*.py")]
        if path.stem.lower() in FORBIDDEN_NAMES and "__pycache__" not in path.parts
    ]
    assert not drawers


def test_functions_are_named_for_what_they_return():
    wrong = []
    for path in SOURCES:
        for node in ast.walk(parsed(path)):
            # scikit-learn prescribes get_params, get_feature_names_out and the like; pydantic and typer their hooks
            if (
                isinstance(node, ast.FunctionDef)
                and node.name.lstrip("_").startswith(FORBIDDEN_PREFIXES)
                and path.name != "estimators.py"
                and node.name not in ("__get_pydantic_json_schema__", "get_command")
            ):
                wrong.append(f"{relative(path)}:{node.lineno} {node.name}")
    assert not wrong


def test_layer_contract_is_kept():
    """Who may import whom; a new module without a row of its own breaks the contract too."""
    run = subprocess.run(
        [sys.executable, "-c", "import sys; from importlinter.cli import lint_imports_command as c; sys.exit(c())"],
        cwd=ROOT, capture_output=True, text=True, encoding="utf-8", timeout=300, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr
    assert " 0 broken" in run.stdout


def test_layer_contract_is_exhaustive_and_has_no_exception():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    layers = [contract for contract in contracts if contract["type"] == "layers"]
    assert layers
    assert all(contract.get("exhaustive") for contract in layers)
    assert not any("ignore_imports" in contract for contract in contracts)


def test_computing_modules_import_no_drawing():
    """Results are data; only figures, the report, the workbench and the command line show them."""
    showing = {"cli", "workbench", "telling", "figures"}
    drawing = {"plotly", "typer", "dash", "jinja2", "rich", "matplotlib"}
    wrong = [
        f"{relative(path)} imports {name}"
        for path in SOURCES
        if path.is_relative_to(PACKAGE) and path.relative_to(PACKAGE).with_suffix("").parts[0] not in showing
        for name in imported_packages(path)
        if name in drawing
    ]
    assert not wrong


def test_only_the_command_knows_the_exam():
    knowing = {relative(path) for path in PACKAGE.rglob("*.py") if "proving_ground" in imported_packages(path)}
    assert knowing == {"selector/cli/proving.py"}


def test_every_imported_package_is_declared():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    import_names = {
        "scikit-learn": "sklearn",
        "scikit-fem": "skfem",
        "scikit-fuzzy": "skfuzzy",
        "npTDMS": "nptdms",
        "FMPy": "fmpy",
        "python-calamine": "python_calamine",
    }
    required = [*project["dependencies"], *(r for rs in project["optional-dependencies"].values() for r in rs)]
    names = [re.split(r"[<>=!~\[; ]", requirement, maxsplit=1)[0] for requirement in required]
    declared = {import_names.get(name, name) for name in names}
    undeclared = {
        f"{relative(path)}: {name}"
        for path in SOURCES
        for name in imported_packages(path)
        if name not in declared and name not in sys.stdlib_module_names and name not in ("selector", "proving_ground")
    }
    assert not undeclared


@cache
def imported_packages(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module.split(".")[0])
    return names


def tracked_files() -> list[Path]:
    run = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False, encoding="utf-8"
    )  # fmt: skip
    if run.returncode != 0:
        pytest.skip("not a git checkout, so nothing is tracked")
    return [ROOT / name for name in run.stdout.split("\0") if name and (ROOT / name).is_file()]


SOMEBODYS_FOLDER = re.compile(r"(?<![\w./])/(?:home|root|Users)/\w|\b[A-Z]:\\{1,2}Users\\")
ADDRESS_IN_A_PRIVATE_NET = re.compile(r"\b(?:10|192\.168|172\.(?:1[6-9]|2\d|3[01]))(?:\.\d{1,3}){2,3}(?=[:/]\w)")


@cache
def signs_of_this_machine() -> re.Pattern[str]:
    """The checkout's folder, its parent, and the machine's name where it is telling enough to search for."""
    folders = [f"{folder.as_posix()}/" for folder in (ROOT, ROOT.parent) if len(folder.parts) > 1]
    node = platform.node()
    signs = folders + ([node] if len(node) >= 8 and re.search(r"\d|-", node) else [])
    return re.compile(rf"(?<![\w./])(?:{'|'.join(map(re.escape, signs))})")


def names_a_machine(line: str) -> bool:
    signs = (SOMEBODYS_FOLDER, ADDRESS_IN_A_PRIVATE_NET, signs_of_this_machine())
    return any(sign.search(line) for sign in signs)


def test_no_tracked_file_names_a_machine_or_its_folders():
    wrong = []
    for path in tracked_files():
        content = path.read_bytes()
        if b"\0" in content[:8000] or path == Path(__file__):
            continue
        for number, line in enumerate(content.decode("utf-8", "replace").splitlines(), start=1):
            if names_a_machine(line):
                wrong.append(f"{relative(path)}:{number}: {line.strip()[:100]}")
    assert not wrong


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("see /home/anna/data", True),
        (r"C:\Users\anna", True),
        (f"in {ROOT.as_posix()}/selector", True),
        ("http://192.168.0.17:8080/x", True),
        ("selector describe r1.csv", False),
        ("https://doi.org/10.1145/3297858", False),
        ("a ratio m/home/unit", False),
    ],
)
def test_the_search_for_machines_finds_them(line, found):
    assert names_a_machine(line) is found


def test_constraints_hold_names_and_versions_only():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert pins
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.+!]+", pin) for pin in pins)
    assert pins == sorted(pins, key=str.lower)
