"""Findings are declared once, in the table of the room that makes them; no id and no level is written twice."""

from __future__ import annotations

import ast
from functools import cache
from importlib import import_module
from pathlib import Path

from selector.findings import Kinds
from tests.architecture.public_names import GROUND, PACKAGE, ROOT, parsed

TABLES = sorted(PACKAGE.rglob("finding_table.py"))
SOURCES = [path for path in sorted([*PACKAGE.rglob("*.py"), *GROUND.rglob("*.py")]) if path not in TABLES]


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


@cache
def tables() -> dict[str, Kinds]:
    return {module_of(path): import_module(module_of(path)).FINDINGS for path in TABLES}


@cache
def constants() -> dict[str, str]:
    """Name → id, of the ids that other code compares."""
    return {
        name: value
        for module in tables()
        for name, value in vars(import_module(module)).items()
        if name.isupper() and isinstance(value, str)
    }


def choices(node: ast.expr) -> set[str] | None:
    """What an expression can be: a text, one of two texts; None where only the running program knows."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return {node.value}
    if isinstance(node, ast.IfExp):
        both = choices(node.body), choices(node.orelse)
        return None if both[0] is None or both[1] is None else both[0] | both[1]
    return None


def last_name(node: ast.expr) -> str | None:
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else None


@cache
def all_calls() -> list[tuple[Path, ast.Call]]:
    return [(path, node) for path in SOURCES for node in ast.walk(parsed(path)) if isinstance(node, ast.Call)]


@cache
def calls(name: str) -> list[tuple[Path, ast.Call]]:
    last = name.rpartition(".")[2]
    return [(path, one) for path, one in all_calls() if last_name(one.func) == last and ast.unparse(one.func) == name]


@cache
def table_used_by(path: Path) -> Kinds:
    [module] = {
        node.module or ""
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.ImportFrom) and any(alias.name == "FINDINGS" for alias in node.names)
    }
    return tables()[module]


def place(path: Path, node: ast.AST) -> str:
    return f"{path.relative_to(ROOT).as_posix()}:{getattr(node, 'lineno', 0)}"


def test_an_id_is_declared_once():
    declared = {}
    for module, kinds in tables().items():
        for id_, kind in kinds.items():
            assert declared.setdefault(id_, kind) is kind, f"{module} declares {id_!r} again"
    assert len(declared) > 200
    assert all(kind.title and kind.levels for kind in declared.values())


def test_a_finding_is_made_of_a_declared_kind():
    written = [place(path, call) for path, call in calls("Finding") if call.args and choices(call.args[0]) is not None]
    assert not written, "FINDINGS.finding(…) makes it of the table"
    wrong = []
    for path, call in calls("FINDINGS.finding"):
        kinds, ids = table_used_by(path), choices(call.args[0])
        if ids is not None and not ids <= set(kinds):
            wrong.append(place(path, call))
    assert not wrong


def test_levels_are_those_of_the_table():
    wrong = []
    for path, call in calls("FINDINGS.finding"):
        kinds, ids = table_used_by(path), choices(call.args[0])
        given = next((keyword.value for keyword in call.keywords if keyword.arg == "level"), None)
        for kind in (kinds[id_] for id_ in ids or ()):
            if given is None and len(kind.levels) > 1:
                wrong.append(f"{place(path, call)} says no level")
            elif given is not None and not (choices(given) or set()) <= set(kind.levels):
                wrong.append(f"{place(path, call)} says another level")
    assert not wrong


def test_every_declared_finding_is_made_somewhere():
    said = {
        constants().get(text, text)
        for path in SOURCES
        for node in ast.walk(parsed(path))
        for text in (
            [node.value] if isinstance(node, ast.Constant) else [node.id] if isinstance(node, ast.Name) else []
        )
        if isinstance(text, str)
    }
    assert not {id_ for kinds in tables().values() for id_ in kinds} - said


def test_constants_are_ids_of_the_tables():
    assert set(constants().values()) <= {id_ for kinds in tables().values() for id_ in kinds}


def test_ids_are_compared_by_the_constants_of_the_table():
    ids = {id_ for kinds in tables().values() for id_ in kinds}
    literal = [
        place(path, node)
        for path in SOURCES
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Compare) and isinstance(node.left, ast.Attribute) and node.left.attr == "id"
        for other in ast.walk(node.comparators[0])
        if isinstance(other, ast.Constant) and other.value in ids
    ]
    assert not literal
