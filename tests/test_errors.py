"""Every error goes from one process to another and says the same there: pools and clusters send errors as they are."""

import importlib
import inspect
import pickle
import pkgutil
from collections.abc import Iterator

import pytest

import selector
from selector.errors import InputError, ReadError, SelectorError


def _modules() -> Iterator[str]:
    for found in pkgutil.walk_packages(selector.__path__, "selector."):
        if not found.name.endswith("__main__"):
            yield found.name


def _exceptions() -> list[type[Exception]]:
    found: dict[type[Exception], None] = {}
    for name in _modules():
        for one in vars(importlib.import_module(name)).values():
            if inspect.isclass(one) and issubclass(one, Exception) and one.__module__.startswith("selector."):
                found[one] = None
    return sorted(found, key=lambda one: one.__qualname__)


def _made(kind: type[Exception]) -> Exception:
    """One with every part said; parts without a default are named after themselves."""
    if "__init__" not in vars(kind) and not issubclass(kind, InputError):
        return kind("what was found")
    parts = list(inspect.signature(kind).parameters.values())
    named = {part.name: part.name for part in parts if part.kind is part.KEYWORD_ONLY}
    return kind(*(part.name for part in parts if part.kind is part.POSITIONAL_OR_KEYWORD), **named)


EXCEPTIONS = _exceptions()


def test_the_tree_is_among_them() -> None:
    assert {SelectorError, InputError, ReadError} <= set(EXCEPTIONS)
    assert len(EXCEPTIONS) >= 12


@pytest.mark.parametrize("kind", EXCEPTIONS, ids=lambda kind: kind.__name__)
def test_it_is_the_same_in_another_process(kind: type[Exception]) -> None:
    error = _made(kind)
    error.add_note("said on the way")
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert (str(again), again.args, vars(again)) == (str(error), error.args, vars(error))
