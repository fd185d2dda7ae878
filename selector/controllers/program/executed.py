"""A program as Python: the text that is exported, and statements executed in any number type."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from selector.controllers.program.language import PLACES, Language, Program, Variable

Number = Callable[[float], Any]  #: From a float to the type that everything is calculated in.


class PythonText(Language):
    """Words of Python; every variable but the temporary ones is an attribute."""

    negation = "not "
    assignment = "{to} = {value}"
    condition = "if {condition}:"
    otherwise = "else:"
    nothing = "pass"
    remark = "# {text}"
    prefixes = dict.fromkeys(PLACES, "self.")


class _Typed(PythonText):
    """Every literal is a number of the type in which the program calculates, made once."""

    def real(self, value: float) -> str:
        return f"number({value!r})"


class _Rounded(PythonText):
    """Every literal is what a control makes of its digits."""

    def __init__(self, literal: Number) -> None:
        self.literal = literal

    def real(self, value: float) -> str:
        return repr(self.literal(value))

    def initial(self, variable: Variable) -> str:
        return PythonText().initial(variable)


def executable(program: Program, number: Number = float, literal: Number | None = None) -> Any:
    """An object with an attribute for every variable, and ``call()``, which runs the statements once.

    `literal`: what a control makes of the literals of its program; default: all of their digits.
    """
    language = _Rounded(literal) if literal else PythonText() if number is float else _Typed()
    lines = ["class Block:", "    def __init__(self):"]
    lines += [f"        self.{v.name} = {language.initial(v)}" for v in program.variables if v.place != "temporary"]
    lines += ["    def call(self):", *language.lines(program.body, 2)]
    return _compiled("\n".join(lines), number)()


@lru_cache(maxsize=8)
def _compiled(source: str, number: Number) -> Any:
    names: dict[str, Any] = {"number": number}
    # our own statements: names of variables and numbers; names of the model stand in remarks only
    exec(compile(source, "guarded program", "exec"), names)  # noqa: S102
    return names["Block"]
