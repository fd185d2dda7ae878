"""What is public: every name without an underscore that a module of the package defines, with its parameters.

Read from the source, so that nothing has to be imported and no optional dependency is needed.
`python -m tests.architecture.public_names` writes the list that `test_public_api.py` compares with.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "selector"
SNAPSHOT = Path(__file__).with_name("public_api.txt")
NOT_FOR_IMPORT = ("selector.cli",)


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


def modules() -> Iterator[tuple[str, Path]]:
    """(dotted name, file) of every module whose name has no underscore in front."""
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        if parts[-1] == "__init__":
            parts = parts[:-1]
        if any(part.startswith("_") for part in parts):
            continue
        yield ".".join(parts), path


def public_names() -> list[Public]:
    """Every public function, class, method and constant outside the command line, sorted."""
    names = []
    for module, path in modules():
        if module.startswith(NOT_FOR_IMPORT):
            continue
        names += _names_of(module, ast.parse(path.read_text(encoding="utf-8")))
    return sorted(names, key=str)


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
