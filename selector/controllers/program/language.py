"""A program that every control can run: real numbers, flags and codes; assignments and IF; no loop, no array, no call.

Real arithmetic is + − × ÷ with one rounding each, in the order of the tree, nothing contracted or reordered. Conditions
have no side effects, so that it does not matter whether a language evaluates both sides of AND.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

Kind = Literal["real", "flag", "code"]
Place = Literal["input", "output", "kept", "retained", "temporary"]
"""Outputs are kept from call to call, too; what is retained outlives a restart of the control."""


class Expression:
    """A real number, a code or a condition; built with the operators of Python."""

    def __add__(self, other: Expression | float) -> Operation:
        return Operation("+", self, expression(other))

    def __sub__(self, other: Expression | float) -> Operation:
        return Operation("-", self, expression(other))

    def __mul__(self, other: Expression | float) -> Operation:
        return Operation("*", self, expression(other))

    def __truediv__(self, other: Expression | float) -> Operation:
        return Operation("/", self, expression(other))

    def __lt__(self, other: Expression | float) -> Operation:
        return Operation("<", self, expression(other))

    def __le__(self, other: Expression | float) -> Operation:
        return Operation("<=", self, expression(other))

    def __gt__(self, other: Expression | float) -> Operation:
        return Operation(">", self, expression(other))

    def __ge__(self, other: Expression | float) -> Operation:
        return Operation(">=", self, expression(other))

    def __and__(self, other: Expression) -> Operation:
        return Operation("and", self, other)

    def __or__(self, other: Expression) -> Operation:
        return Operation("or", self, other)

    def __neg__(self) -> Negative:
        return Negative(self)

    def __invert__(self) -> Not:
        return Not(self)


@dataclass(frozen=True, eq=False)
class Real(Expression):
    """A real literal."""

    value: float


@dataclass(frozen=True, eq=False)
class Code(Expression):
    """An integer literal; codes are assigned and compared, never calculated with."""

    value: int


@dataclass(frozen=True, eq=False)
class Flag(Expression):
    """True or false."""

    value: bool


@dataclass(frozen=True, eq=False)
class Variable(Expression):
    """A variable; `initial` is of the first call, and of inputs that are not wired."""

    name: str
    kind: Kind
    place: Place
    about: str = ""
    initial: float = 0.0


@dataclass(frozen=True, eq=False)
class Operation(Expression):
    """Two expressions and one of ``+ - * / < <= > >= and or``."""

    sign: str
    left: Expression
    right: Expression


@dataclass(frozen=True, eq=False)
class Negative(Expression):
    """A real number with the other sign."""

    of: Expression


@dataclass(frozen=True, eq=False)
class Not(Expression):
    """The opposite of a condition."""

    of: Expression


@dataclass(frozen=True, eq=False)
class Assign:
    """variable := expression."""

    to: Variable
    value: Expression


@dataclass(frozen=True, eq=False)
class If:
    """IF condition THEN … ELSE … END_IF."""

    condition: Expression
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...] = ()


@dataclass(frozen=True, eq=False)
class Remark:
    """A line for the reader of the program."""

    text: str


Statement = Assign | If | Remark


@dataclass(frozen=True, eq=False)
class Program:
    """A program that is called again and again.

    Attributes
    ----------
    name : str
        Of the model, for the reader.
    variables : tuple of Variable
        Every one that occurs, in the order in which they were declared; names are ASCII, at most 24 characters.
    body : tuple of Statement
    """

    name: str
    variables: tuple[Variable, ...]
    body: tuple[Statement, ...]

    def of(self, place: Place) -> tuple[Variable, ...]:
        """The variables of one place."""
        return tuple(one for one in self.variables if one.place == place)


class Writing:
    """A program while it is written, statement by statement."""

    def __init__(self) -> None:
        self._variables: dict[str, Variable] = {}
        self._open: list[list[Statement]] = [[]]

    def variable(
        self, name: str, kind: Kind = "real", place: Place = "temporary", about: str = "", initial: float = 0.0
    ) -> Variable:
        """A variable; a temporary one is declared once, however often it is asked for."""
        if name not in self._variables or place != "temporary":
            if name in self._variables:
                raise ValueError(f"{name} is declared twice")
            self._variables[name] = Variable(name, kind, place, about, initial)
        return self._variables[name]

    def assign(self, to: Variable, value: Expression | float) -> None:
        """Appends an assignment."""
        self._open[-1].append(Assign(to, _as_kind(to.kind, value)))

    def limit(self, of: Variable, low: Expression | float, high: Expression | float) -> None:
        """Appends: `of` becomes low if below it, high if above it."""
        self.at_least(of, low)
        self.at_most(of, high)

    def at_least(self, of: Variable, low: Expression | float) -> None:
        """Appends: `of` becomes low if below it."""
        with self.when(of < low):
            self.assign(of, low)

    def at_most(self, of: Variable, high: Expression | float) -> None:
        """Appends: `of` becomes high if above it."""
        with self.when(of > high):
            self.assign(of, high)

    def remark(self, text: str) -> None:
        """Appends a line for the reader."""
        self._open[-1].append(Remark(text))

    @contextmanager
    def when(self, condition: Expression) -> Iterator[None]:
        """What is appended inside happens if the condition holds."""
        self._open.append([])
        yield
        then = self._open.pop()
        self._open[-1].append(If(condition, tuple(then)))

    @contextmanager
    def otherwise(self) -> Iterator[None]:
        """What is appended inside happens if the condition of the IF before does not hold."""
        before = self._open[-1].pop()
        if not isinstance(before, If) or before.otherwise:
            raise ValueError("otherwise without an IF before it")
        self._open.append([])
        yield
        self._open[-2].append(If(before.condition, before.then, tuple(self._open.pop())))

    def program(self, name: str) -> Program:
        """The finished program."""
        (body,) = self._open
        return Program(name, tuple(self._variables.values()), tuple(body))


def expression(value: Expression | float) -> Expression:
    """The value, or its literal."""
    return value if isinstance(value, Expression) else Real(float(value))


def is_code(variable: Variable, code: int) -> Operation:
    """Whether a code has this value."""
    return Operation("==", variable, Code(code))


def _as_kind(kind: Kind, value: Expression | float) -> Expression:
    if isinstance(value, Expression):
        return value
    if kind == "flag":
        return Flag(bool(value))
    return Code(int(value)) if kind == "code" else Real(float(value))
