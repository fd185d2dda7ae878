"""The meta commands of RepRapFirmware 3.5 in 32-bit numbers, written from its documentation and its source.

Nothing of it is used by the writer or by the replay. What is done as the firmware does it, line by line
(github.com/Duet3D/RepRapFirmware, branch 3.5-dev: ExpressionParser.cpp, StringParser.cpp, Variable.cpp, GCodes2.cpp;
github.com/Duet3D/RRFLibraries: NumericConverter.cpp), also where it is odd: ``a <= b`` is not ``a > b``; what ``&&``
and ``||`` leave out is read and is null, and a sign before null is an error; `&&` and `||` have one priority.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

LONGEST = 255
DIGITS = 7


class MetaError(ValueError):
    """What the console would show; the macro is aborted."""


@dataclass(frozen=True)
class Float:
    """A number of 32 bits, and how many digits after the point it is printed with."""

    value: np.float32
    digits: int

    def __str__(self) -> str:
        most, limit = DIGITS, np.float32(1.0)
        while most > 1 and self.value >= limit:
            limit *= np.float32(10.0)
            most -= 1
        return f"{float(self.value):.{min(self.digits, most)}f}"


@dataclass(frozen=True)
class DateTime:
    """Seconds since 1970."""

    seconds: int


@cache
def literal(text: str) -> int | Float:
    """NumericConverter: nine or ten digits in an integer, powers of ten in double precision, then 32 bits."""
    mantissa, _, exponent = text.lower().partition("e")
    whole, point, part = mantissa.partition(".")
    if not point and not exponent:
        return int(text)
    digits, tens = int(whole + part), int(exponent or 0) - len(part)
    if digits >= 2**32:
        raise MetaError(f"more digits than the firmware reads: {text}")
    value = float(digits)
    while tens:
        power = min(abs(tens), 10)
        value = value / 10.0**power if tens < 0 else value * 10.0**power
        tens += power if tens < 0 else -power
    return Float(np.float32(value), min(max(len(part) - int(exponent or 0), 1), DIGITS))


_PRIORITY = {
    "^": 2,
    "&&": 3,
    "||": 3,
    "==": 4,
    "!=": 4,
    "<": 4,
    ">": 4,
    "<=": 4,
    ">=": 4,
    "+": 5,
    "-": 5,
    "*": 6,
    "/": 6,
}
_UNARY = 10
_TOKEN = re.compile(r'\s*("[^"]*"|\d+\.?\d*(?:[eE][-+]?\d+)?|[A-Za-z_]\w*|&&|\|\||[<>=!]=|[-+*/^<>!#(){}\[\].,])')


@cache
def parsed(text: str) -> tuple:
    """An expression as a tree."""
    tokens, at = [], 0
    while at < len(text.rstrip()):
        match = _TOKEN.match(text, at)
        if match is None:
            raise MetaError(f"not an expression: {text[at:]}")
        tokens.append(match[1])
        at = match.end()
    tree, left = _operand(tokens, 0)
    if left:
        raise MetaError(f"Unexpected characters after expression: {left}")
    return tree


def _operand(tokens: list[str], priority: int) -> tuple[tuple, list[str]]:
    if not tokens:
        raise MetaError("expected an expression")
    first, rest = tokens[0], tokens[1:]
    if first in ("-", "+", "!"):
        of, rest = _operand(rest, _UNARY)
        tree: tuple = (first, of)
    elif first in "({":
        tree, rest = _operand(rest, 0)
        rest = _after({"(": ")", "{": "}"}[first], rest)
    elif first[0] == '"':
        tree = ("text", first[1:-1])
    elif first[0].isdigit():
        tree = ("number", first)
    else:
        tree, rest = _name(first, rest)
    while rest and _PRIORITY.get(rest[0], 0) > priority:
        sign = rest[0]
        right, rest = _operand(rest[1:], _PRIORITY[sign])
        tree = ("operation", sign, tree, right)
    return tree, rest


def _after(sign: str, tokens: list[str]) -> list[str]:
    if not tokens or tokens[0] != sign:
        raise MetaError(f"expected {sign}")
    return tokens[1:]


def _name(first: str, rest: list[str]) -> tuple[tuple, list[str]]:
    if first in ("true", "false", "null"):
        return ("constant", {"true": True, "false": False, "null": None}[first]), rest
    if rest and rest[0] == "(":
        of, rest = _operand(rest[1:], 0)
        return ("call", first, of), _after(")", rest)
    path: list[Any] = [first]
    while rest and rest[0] in (".", "["):
        if rest[0] == ".":
            path.append(rest[1])
            rest = rest[2:]
        else:
            index, rest = _operand(rest[1:], 0)
            path.append(index)
            rest = _after("]", rest)
    return ("path", tuple(path)), rest


@cache
def split(text: str) -> tuple[tuple[int, str], ...]:
    """(indent, code without its comment) of every line: a macro is run thousands of times and read once."""
    return tuple(map(_split, text.split("\n")))


def _split(line: str) -> tuple[int, str]:
    bare = line.lstrip(" ")
    code, in_quotes = [], False
    for character in bare:
        in_quotes ^= character == '"'
        if character == ";" and not in_quotes:
            break
        code.append(character)
    return len(line) - len(bare), "".join(code).rstrip()


@dataclass
class Axis:
    """What a program sees of an axis [mm]."""

    homed: bool = True
    babystep: np.float32 = field(default_factory=lambda: np.float32(0.0))
    moves: list[np.float32] = field(default_factory=list)  #: Babysteps after every M290


class Duet:
    """The board: files, object model, variables. `second` is called by G4 S1 with the new time."""

    def __init__(self, files: dict[str, str], second: Any = None) -> None:
        self.running: type[Running] = Running
        self.files, self.second = dict(files), second
        self.globals: dict[str, Any] = {}
        self.up_s, self.time = 5, None
        self.axes = [Axis() for _ in "XYZ"]
        self.analog: list[dict[str, Any] | None] = []
        self.lines = 0  #: That were executed or passed over
        self.said: list[str] = []  #: In the console

    def babystep(self, letter: str, mm: float, *, absolute: bool = False) -> None:
        """M290 as GCodes2.cpp has it."""
        axis, value = self.axes["XYZ".index(letter)], np.float32(mm)
        with np.errstate(all="ignore"):
            step = value - axis.babystep if absolute else np.clip(value, np.float32(-1.0), np.float32(1.0))
            if not axis.homed and not absolute:
                raise MetaError("insufficient axes homed")
            axis.babystep = np.float32(axis.babystep + step)
        axis.moves.append(axis.babystep)

    def run(self, name: str) -> None:
        """A macro."""
        with np.errstate(all="ignore"):
            self.running(self, self.files[name]).all_lines()

    def console(self, line: str) -> None:
        """A line of a person."""
        with np.errstate(all="ignore"):
            self.running(self, line).all_lines()

    def of_model(self, path: list[Any]) -> Any:
        """A value of the object model."""
        match path:
            case ["state", "upTime"]:
                return self.up_s
            case ["state", "time"]:
                return self.time
            case ["move", "axes", int(k), "homed"]:
                return self.axes[k].homed
            case ["move", "axes", int(k), "babystep"]:
                return Float(self.axes[k].babystep, 3)
            case ["sensors", "analog", int(k), what] if what in ("lastReading", "state"):
                if not 0 <= k < len(self.analog):
                    raise MetaError("array index out of bounds")
                sensor = self.analog[k]
                if sensor is None:
                    raise MetaError("reached null object before end of selector string")
                return Float(np.float32(sensor[what]), 2) if what == "lastReading" else sensor[what]
        raise MetaError(f"unknown value {path}")


@dataclass
class _Block:
    indent: int
    kind: str = "plain"
    line: int = 0


class Running:
    """A file that is being executed."""

    def __init__(self, duet: Duet, text: str) -> None:
        self.duet, self.blocks, self.skip_to = duet, [_Block(0)], None
        self.variables: dict[str, tuple[int, Any]] = {}
        self.source = split(text)
        self.at = 0

    def all_lines(self) -> None:
        while True:
            if self.at >= len(self.source):
                if not self._restarted(0):
                    return
                continue
            indent, code = self.source[self.at]
            self.at += 1
            self.duet.lines += 1
            if not code:
                continue
            if len(code) > LONGEST:
                raise MetaError(f"GCode command too long: {len(code)}")
            skipped = "plain"
            if self.skip_to is not None:
                if self.skip_to < indent:
                    continue
                if self.skip_to == indent:
                    skipped, self.blocks[-1].kind = self.blocks[-1].kind, "plain"
                self.skip_to = None
            if self._restarted(indent):
                continue
            if indent > self.blocks[-1].indent:
                self.blocks.append(_Block(indent))
            self._line(code, skipped)

    def _restarted(self, indent: int) -> bool:
        """Ends blocks; whether that went back to the head of a loop."""
        while indent < self.blocks[-1].indent:
            self.blocks.pop()
            nesting = len(self.blocks) - 1
            self.variables = {name: of for name, of in self.variables.items() if of[0] <= nesting}
            if self.blocks[-1].kind == "loop":
                self.at = self.blocks[-1].line
                return True
        return False

    def _line(self, code: str, skipped: str) -> None:
        block = self.blocks[-1]
        word, _, rest = code.partition(" ")
        if word == "if":
            self._entered(self._condition(rest), "true", "none true")
        elif word == "while":
            if block.kind != "loop":
                block.kind, block.line = "loop", self.at - 1
            if not self._condition(rest):
                block.kind, self.skip_to = "plain", block.indent
        elif word == "else":
            if skipped == "none true":
                block.kind = "plain"
            elif skipped == "had true" or block.kind == "true":
                block.kind, self.skip_to = "plain", block.indent
            else:
                raise MetaError("'else' did not follow 'if'")
        elif word in ("var", "global"):
            self._declared(word, rest)
        elif word == "set":
            self._set(rest)
        elif word == "echo":
            self._echo(rest)
        elif code == "G4 S1":
            self.duet.up_s += 1
            if self.duet.second is not None:
                self.duet.second(self.duet)
        elif match := re.fullmatch(r'M98 P"([^"]+)"', code):
            self.duet.run(match[1])
        elif match := re.fullmatch(r"M290 R0 ([XYZ])(?:\{(.*)\}|(-?[\d.]+))", code):
            value = self.value(match[2]) if match[2] else literal(match[3])
            self.duet.babystep(match[1], float(_as_float(value, evaluate=True).value), absolute=True)
        else:
            raise MetaError(f"unknown command: {code}")

    def _entered(self, holds: bool, yes: str, no: str) -> None:
        self.blocks[-1].kind = yes if holds else no
        if not holds:
            self.skip_to = self.blocks[-1].indent

    def _declared(self, word: str, rest: str) -> None:
        match = re.fullmatch(r"([A-Za-z]\w*) *=(.*)", rest)
        if match is None:
            raise MetaError(f"expected a new variable name: {rest}")
        if match[1] in (self.variables if word == "var" else self.duet.globals):
            raise MetaError(f"variable '{match[1]}' already exists")
        value = self.value(match[2])
        if word == "var":
            self.variables[match[1]] = (len(self.blocks) - 1, value)
        else:
            self.duet.globals[match[1]] = value

    def _set(self, rest: str) -> None:
        match = re.fullmatch(r"(global|var)\.([A-Za-z]\w*) *=(.*)", rest)
        if match is None:
            raise MetaError(f"expected a global or local variable: {rest}")
        known: dict[str, Any] = self.duet.globals if match[1] == "global" else self.variables
        if match[2] not in known:
            raise MetaError(f"unknown variable '{match[2]}'")
        value = self.value(match[3])
        known[match[2]] = value if match[1] == "global" else (known[match[2]][0], value)

    def _echo(self, rest: str) -> None:
        match = re.fullmatch(r'(>>?)"([^"]+)" (.*)', rest)
        if match is None:
            self.duet.said.append(_as_text(self.value(rest)))
            return
        text = _as_text(self.value(match[3])) + "\n"
        self.duet.files[match[2]] = text if match[1] == ">" else self.duet.files.get(match[2], "") + text

    def _condition(self, text: str) -> bool:
        return _as_bool(self.value(text), evaluate=True)

    def value(self, text: str) -> Any:
        """Of an expression."""
        return self._of(parsed(text), evaluate=True)

    def _of(self, tree: tuple, *, evaluate: bool) -> Any:
        kind = tree[0]
        if kind == "operation":
            return self._operation(*tree[1:], evaluate=evaluate)
        if kind == "number":
            return literal(tree[1])
        if kind in ("text", "constant"):
            return tree[1]
        if kind == "path":
            return self._at(tree[1]) if evaluate else None
        if kind == "call":
            return self._call(tree[1], tree[2], evaluate=evaluate)
        value = self._of(tree[1], evaluate=evaluate)
        if kind == "!":
            return not _as_bool(value, evaluate=evaluate)
        # as the firmware has it: also where nothing is evaluated
        if kind == "+" and isinstance(value, DateTime):
            return value.seconds
        if isinstance(value, bool) or not isinstance(value, int | Float):
            raise MetaError(f"expected numeric value after '{kind}'")
        if kind == "+":
            return value
        return -value if isinstance(value, int) else Float(-value.value, value.digits)

    def _at(self, path: tuple) -> Any:
        if path[0] == "global":
            if path[1] not in self.duet.globals:
                raise MetaError(f"unknown variable '{path[1]}'")
            return self.duet.globals[path[1]]
        if path[0] == "var":
            if path[1] not in self.variables:
                raise MetaError(f"unknown variable '{path[1]}'")
            return self.variables[path[1]][1]
        return self.duet.of_model([self._of(one, evaluate=True) if isinstance(one, tuple) else one for one in path])

    def _call(self, name: str, of: tuple, *, evaluate: bool) -> Any:
        if name == "exists":
            try:
                return evaluate and self._at(of[1]) is not None
            except MetaError:
                return False
        if name == "fileexists":
            return self._of(of, evaluate=evaluate) in self.duet.files
        raise MetaError(f"unknown function {name}")

    def _operation(self, sign: str, one: tuple, other: tuple, *, evaluate: bool) -> Any:
        left = self._of(one, evaluate=evaluate)
        if sign in ("&&", "||"):
            left = _as_bool(left, evaluate=evaluate)
            decides = left if sign == "||" else not left
            right = self._of(other, evaluate=evaluate and not decides)
            return left if decides else _as_bool(right, evaluate=evaluate)
        right = self._of(other, evaluate=evaluate)
        if sign == "^":
            return _as_text(left) + _as_text(right)
        if sign in ("==", "!="):
            return _is_same(left, right, evaluate=evaluate) == (sign == "==")
        if sign == "/":
            left, right = _as_float(left, evaluate=evaluate), _as_float(right, evaluate=evaluate)
            return Float(np.float32(left.value / right.value), DIGITS)
        left, right = _balanced(left, right, evaluate=evaluate)
        a, b = (of.value if isinstance(of, Float) else of for of in (left, right))
        if sign in (">", "<="):
            return bool(a > b) == (sign == ">")
        if sign in ("<", ">="):
            return bool(a < b) == (sign == "<")
        result = a + b if sign == "+" else a - b if sign == "-" else a * b
        return Float(np.float32(result), max(left.digits, right.digits)) if isinstance(left, Float) else int(result)


def _as_bool(value: Any, *, evaluate: bool) -> bool:
    if isinstance(value, bool):
        return value
    if evaluate:
        raise MetaError(f"expected Boolean operand, not {value!r}")
    return False


def _as_float(value: Any, *, evaluate: bool) -> Float:
    if isinstance(value, Float):
        return value
    if isinstance(value, int) and not isinstance(value, bool):
        return Float(np.float32(value), 1)
    if evaluate:
        raise MetaError(f"expected numeric operand, not {value!r}")
    return Float(np.float32(0.0), 1)


def _balanced(left: Any, right: Any, *, evaluate: bool) -> tuple[Any, Any]:
    if isinstance(left, Float) or isinstance(right, Float):
        return _as_float(left, evaluate=evaluate), _as_float(right, evaluate=evaluate)
    if all(isinstance(of, int) and not isinstance(of, bool) for of in (left, right)):
        return left, right
    if evaluate:
        raise MetaError(f"expected numeric operands, not {left!r} and {right!r}")
    return 0, 0


def _is_same(left: Any, right: Any, *, evaluate: bool) -> bool:
    if left is None or right is None:
        return left is right
    if type(left) is type(right) and not isinstance(left, int | Float):
        return bool(left == right)
    if isinstance(left, bool) and isinstance(right, bool):
        return left == right
    a, b = _balanced(left, right, evaluate=evaluate)
    return bool((a.value == b.value) if isinstance(a, Float) else (a == b))


def _as_text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return "null" if value is None else str(value)
