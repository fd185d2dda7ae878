"""What is public, with its parameters.

A package that says `__all__`, or imports names as themselves (`from … import A as A`), promises those names and keeps
its modules to itself. In any other module every name without an underscore is public.

Read from the source, so that nothing has to be imported and no optional dependency is needed.
`python -m tests.architecture.public_names` writes the list that `test_public_api.py` compares with.
"""

from __future__ import annotations

import ast
import gc
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "selector"
GROUND = ROOT / "proving_ground"
SNAPSHOT = Path(__file__).with_name("public_api.txt")
NOT_FOR_IMPORT = ("selector.cli",)
#: Packages whose modules are public beside what the package imports from them.
OPEN = ("selector.physics.thermal.field",)


@dataclass(frozen=True)
class Public:
    """One public name."""

    module: str
    name: str
    parameters: tuple[str, ...] | None
    docstring: str | None
    line: int

    def __str__(self) -> str:
        signature = "" if self.parameters is None else f"({', '.join(self.parameters)})"
        return f"{self.module}.{self.name}{signature}"


@cache
def public_names() -> tuple[Public, ...]:
    """Every public function, class, method and constant outside the command line, sorted."""
    return tuple(sorted([*_below("selector", PACKAGE), *_below("proving_ground", GROUND)], key=str))


def _below(module: str, path: Path) -> Iterator[Public]:
    """Public names of a module (a file) or of a package (a folder)."""
    if module.startswith(NOT_FOR_IMPORT) or path.name.startswith("_"):
        return
    if path.is_file():
        yield from _names_of(module, parsed(path))
        return
    tree = parsed(path / "__init__.py") if (path / "__init__.py").exists() else ast.Module([], [])
    promised = None if module in OPEN else _promised(tree)
    if promised is not None:
        yield from _promised_names(module, tree, promised)
        return
    yield from _names_of(module, tree)
    for entry in sorted(path.iterdir()):
        if entry.suffix == ".py" or (entry.is_dir() and any(entry.glob("*.py"))):
            yield from _below(f"{module}.{entry.stem}", entry)


def _promised(tree: ast.Module) -> list[str] | None:
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(ast.unparse(target) == "__all__" for target in node.targets):
            return list(ast.literal_eval(node.value))
    named = [alias for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    return [alias.name for alias in named if alias.asname == alias.name] or None


def _promised_names(module: str, tree: ast.Module, promised: list[str]) -> Iterator[Public]:
    """The names that a package promises, followed to where they are defined."""
    own = {name.name.split(".")[0]: name for name in _names_of(module, tree)}
    source = {
        alias.asname or alias.name: (node.module or "", alias.name)
        # also those that only a type checker imports, where a package is lazy
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    for name in promised:
        if name in own:
            yield from (found for found in _names_of(module, tree) if found.name.split(".")[0] == name)
            continue
        origin, original = source[name]
        defined = _defined(origin, original)
        assert defined, f"{module} promises {name!r}, which {origin} does not define"
        for found in defined:
            shown = found.name.replace(original, name, 1)
            yield Public(module, shown, found.parameters, found.docstring, found.line)


def _defined(module: str, name: str) -> list[Public]:
    place = ROOT.joinpath(*module.split("."))
    path = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    tree = parsed(path)
    found = [public for public in _names_of(module, tree) if public.name.split(".")[0] == name]
    if found:
        return found
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and any((alias.asname or alias.name) == name for alias in node.names):
            return _defined(node.module or "", next(a.name for a in node.names if (a.asname or a.name) == name))
    return []


@cache
def parsed(path: Path) -> ast.Module:
    """The source of a module, parsed once for everything that is asked of it."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    gc.freeze()  # 1.5 million nodes live to the end: readers that collect garbage would visit them, a second each time
    return tree


def _names_of(module: str, tree: ast.Module) -> Iterator[Public]:
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            if not node.name.startswith("_"):
                yield Public(module, node.name, _parameters(node), ast.get_docstring(node), node.lineno)
        elif isinstance(node, ast.ClassDef):
            if not node.name.startswith("_"):
                yield from _names_of_class(module, node)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                if isinstance(target, ast.Name) and not target.id.startswith("_"):
                    yield Public(module, target.id, None, None, node.lineno)


def _names_of_class(module: str, node: ast.ClassDef) -> Iterator[Public]:
    fields: list[str] = []
    init: tuple[str, ...] | None = None
    dataclass_ = any("dataclass" in ast.unparse(decorator) for decorator in node.decorator_list)
    for item in node.body:
        if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name):
            fields.append(item.target.id)
        elif isinstance(item, ast.FunctionDef):
            if item.name == "__init__":
                init = _parameters(item)
            elif not item.name.startswith("_"):
                is_property = any("property" in ast.unparse(decorator) for decorator in item.decorator_list)
                parameters = None if is_property else _parameters(item)
                yield Public(module, f"{node.name}.{item.name}", parameters, ast.get_docstring(item), item.lineno)
    parameters = init if init is not None else (tuple(fields) if dataclass_ else None)
    yield Public(module, node.name, parameters, ast.get_docstring(node), node.lineno)


def _parameters(node: ast.FunctionDef | ast.AsyncFunctionDef) -> tuple[str, ...]:
    arguments = node.args
    names = [argument.arg for argument in (*arguments.posonlyargs, *arguments.args)]
    if names and names[0] in ("self", "cls"):
        names = names[1:]
    names += [f"*{arguments.vararg.arg}"] if arguments.vararg else []
    names += [argument.arg for argument in arguments.kwonlyargs]
    names += [f"**{arguments.kwarg.arg}"] if arguments.kwarg else []
    return tuple(names)


def listing() -> str:
    """The public names as the snapshot holds them, one a line."""
    return "".join(f"{name}\n" for name in public_names())


if __name__ == "__main__":
    SNAPSHOT.write_text(listing(), encoding="utf-8", newline="\n")
    print(f"wrote {SNAPSHOT.relative_to(ROOT)}")
