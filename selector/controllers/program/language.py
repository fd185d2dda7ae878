"""A program that every control can run: real numbers, flags, codes, assignments and IF; printed, and executed."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

Kind = Literal["real", "flag", "code"]
#: Outputs are kept from call to call, too; what is retained outlives a restart of the control.
Place = Literal["input", "output", "kept", "retained", "temporary"]
#: Places that last, with what is said above their variables.
PLACES = {"input": "inputs", "output": "outputs", "retained": "to be kept when the control is off", "kept": "state"}


def _joined(sign: str) -> Callable[[Expression, Expression | float], Operation]:
    return lambda left, right: Operation(sign, left, expression(right))


class Expression:
    """A real number, a code or a condition; built with the operators of Python."""

    __add__, __sub__, __mul__, __truediv__ = _joined("+"), _joined("-"), _joined("*"), _joined("/")
    __lt__, __le__, __gt__, __ge__ = _joined("<"), _joined("<="), _joined(">"), _joined(">=")
    __and__, __or__ = _joined("and"), _joined("or")

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
    """A program that is called again and again."""

    name: str  #: Of the model, for the reader
    #: Every one that occurs, in the order in which they were declared; names are ASCII, at most 24 characters
    variables: tuple[Variable, ...]
    body: tuple[Statement, ...]

    def of(self, place: Place) -> tuple[Variable, ...]:
        """The variables of one place."""
        return tuple(one for one in self.variables if one.place == place)

    def with_flags(self, known: Mapping[str, bool]) -> Program:
        """The program for inputs that never change: what never happens is left out."""
        body = tuple(_happening(self.body, known))
        used = {one for statement in body for one in _named(statement)}
        return Program(self.name, tuple(v for v in self.variables if v.name in used), body)


def _happening(body: Sequence[Statement], known: Mapping[str, bool]) -> Iterator[Statement]:
    for one in body:
        if isinstance(one, If):
            is_true = _truth(one.condition, known)
            then, otherwise = tuple(_happening(one.then, known)), tuple(_happening(one.otherwise, known))
            if is_true is None:
                yield If(one.condition, then, otherwise)
            else:
                yield from then if is_true else otherwise
        elif not isinstance(one, Assign) or _truth(one.value, known) is None or isinstance(one.value, Flag):
            yield one


def _truth(of: Expression, known: Mapping[str, bool]) -> bool | None:
    """Whether a condition holds whatever the other variables are; None: that depends on them."""
    if isinstance(of, Variable):
        return known.get(of.name)
    if isinstance(of, Not):
        inner = _truth(of.of, known)
        return None if inner is None else not inner
    if isinstance(of, Operation) and of.sign in ("and", "or"):
        sides = _truth(of.left, known), _truth(of.right, known)
        decides = of.sign == "or"
        return decides if decides in sides else None if None in sides else not decides
    return None


def _named(of: Statement | Expression) -> Iterator[str]:
    if isinstance(of, Variable):
        yield of.name
    for part in vars(of).values():
        for inner in part if isinstance(part, tuple) else (part,):
            if isinstance(inner, Expression | Assign | If):
                yield from _named(inner)


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

    def assign(self, to: Variable, value: Expression | float, **bounds: Expression | float) -> None:
        """Appends an assignment, and that `to` stays within bounds, see `limit`."""
        self._open[-1].append(Assign(to, _as_kind(to.kind, value)))
        self.limit(to, **bounds)

    def limit(
        self, of: Variable, *, least: Expression | float | None = None, most: Expression | float | None = None
    ) -> None:
        """Appends: `of` becomes `least` if below it, `most` if above it."""
        if least is not None:
            with self.when(of < least):
                self.assign(of, least)
        if most is not None:
            with self.when(of > most):
                self.assign(of, most)

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


_RANK = {"or": 1, "and": 2, "<": 4, "<=": 4, ">": 4, ">=": 4, "==": 4, "+": 5, "-": 5, "*": 6, "/": 6}
_OF_COMPARISON, _OF_NAME = 4, 8


class Language:
    """Words of a language in which a program is printed."""

    signs: Mapping[str, str] = {}  #: Of the operations, where they differ from the program's own
    negation: str = ""  #: Before a condition
    assignment: str = ""  #: Format with ``{to}`` and ``{value}``
    #: condition, otherwise and end: Lines around the branches of an IF; ``{condition}``. An empty `end` is left out.
    condition: str = ""
    otherwise: str = ""
    end: str = ""
    nothing: str = ""  #: The statement of an empty branch; empty where none is needed
    remark: str = ""  #: Format with ``{text}``
    prefixes: Mapping[str, str] = {}  #: Place of a variable → what goes before its name
    indent: str = "    "
    #: What has a sign of its own stands in parentheses inside operations of a higher rank than this
    signed_above: int = _OF_COMPARISON

    def real(self, value: float) -> str:
        """A real literal."""
        return repr(value)

    def flag(self, value: bool) -> str:
        """True or false."""
        return str(value)

    def code(self, value: int) -> str:
        """An integer literal."""
        return str(value)

    def initial(self, variable: Variable) -> str:
        """The literal of the initial value of a variable."""
        if variable.kind == "real":
            return self.real(float(variable.initial))
        return self.flag(bool(variable.initial)) if variable.kind == "flag" else self.code(int(variable.initial))

    def name(self, variable: Variable) -> str:
        """A variable as it is written inside the program."""
        return self.prefixes.get(variable.place, "") + variable.name

    def lines(self, body: tuple[Statement, ...], depth: int = 0) -> Iterator[str]:
        """Statements as lines without line ends."""
        before = self.indent * depth
        for one in body:
            if isinstance(one, Assign):
                yield before + self.assignment.format(to=self.name(one.to), value=self.expression(one.value))
            elif isinstance(one, Remark):
                yield before + self.remark.format(text=plain(one.text))
            else:
                yield from self._branches(one, depth)

    def expression(self, of: Expression, outer: int = 0, *, is_right: bool = False) -> str:
        """An expression with the parentheses that keep its tree: all sums and products group from the left."""
        if isinstance(of, Variable):
            return self.name(of)
        if isinstance(of, Flag):
            return self.flag(of.value)
        if isinstance(of, Code):
            return self.code(of.value)
        if isinstance(of, Real):
            text = self.real(of.value)
            return f"({text})" if text.startswith("-") and outer > self.signed_above else text
        if isinstance(of, Negative):
            text = "-" + self.expression(of.of, _OF_NAME)
            return f"({text})" if outer > self.signed_above else text
        if isinstance(of, Not):
            return self.negation + "(" + self.expression(of.of) + ")"
        if not isinstance(of, Operation):
            raise TypeError(of)
        rank = _RANK[of.sign]
        left = self.expression(of.left, rank)
        right = self.expression(of.right, rank, is_right=True)
        text = f"{left} {self.signs.get(of.sign, of.sign)} {right}"
        # every language has its own order of AND, OR and comparison
        is_condition_inside = rank <= _OF_COMPARISON and 0 < outer != rank
        needs = rank < outer or (rank == outer and is_right) or is_condition_inside
        return f"({text})" if needs else text

    def _branches(self, one: If, depth: int) -> Iterator[str]:
        before = self.indent * depth
        yield before + self.condition.format(condition=self.expression(one.condition))
        yield from self._branch(one.then, depth)
        if one.otherwise:
            yield before + self.otherwise
            yield from self._branch(one.otherwise, depth)
        if self.end:
            yield before + self.end

    def _branch(self, body: tuple[Statement, ...], depth: int) -> Iterator[str]:
        if self.nothing and all(isinstance(one, Remark) for one in body):
            yield self.indent * (depth + 1) + self.nothing
        yield from self.lines(body, depth + 1)


_SPELLED = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ẞ": "SS", "æ": "ae", "Æ": "Ae",
     "œ": "oe", "Œ": "Oe", "ø": "oe", "Ø": "Oe", "ł": "l", "Ł": "L", "đ": "d", "Đ": "D", "ı": "i", "þ": "th", "Þ": "Th",
     "µ": "u", "μ": "u", "°": "deg", "Δ": "d", "−": "-", "–": "-", "·": "*", "⁄": "/"}
)  # fmt: skip
_SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def plain(text: str) -> str:
    """ASCII without anything that would end a remark in any language.

    Letters are spelled as their languages do without them, else lose their accents; what is left becomes ``?``.

    >>> plain("Ständer außen, Tête [°C]")
    'Staender aussen, Tete [degC]'
    """
    spelled = unicodedata.normalize("NFC", text).translate(_SPELLED)
    spelled = re.sub("[⁻⁰¹²³⁴-⁹]+", lambda power: "^" + power[0].translate(_SUPERSCRIPTS), spelled)
    parts = unicodedata.normalize("NFKD", spelled).translate(_SPELLED)
    bare = "".join(character for character in parts if not unicodedata.combining(character))
    ascii_text = bare.encode("ascii", "replace").decode("ascii")
    for end in ("*/", "/*", "*)", "(*", "//", "\\", "{", "}", "]]>", "??", "\x00"):
        ascii_text = ascii_text.replace(end, "_")
    return "".join(character if character.isprintable() else " " for character in ascii_text)


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
