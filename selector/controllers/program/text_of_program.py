"""What printed programs have in common: indented lines, parentheses only where a reader needs them."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from selector.controllers.program.language import (
    Assign,
    Code,
    Expression,
    Flag,
    If,
    Negative,
    Not,
    Operation,
    Real,
    Remark,
    Statement,
    Variable,
)

_RANK = {"or": 1, "and": 2, "<": 4, "<=": 4, ">": 4, ">=": 4, "==": 4, "+": 5, "-": 5, "*": 6, "/": 6}
_OF_COMPARISON, _OF_NAME = 4, 8


@dataclass(frozen=True)
class Language:
    """Words of a language in which a program is printed.

    Attributes
    ----------
    signs : mapping of str to str
        Of the operations, where they differ from the program's own.
    negation : str
        Before a condition.
    assignment : str
        Format with ``{to}`` and ``{value}``.
    condition, otherwise, end : str
        Lines around the branches of an IF; ``{condition}``. An empty `end` is left out.
    nothing : str
        The statement of an empty branch; empty where none is needed.
    remark : str
        Format with ``{text}``.
    prefixes : mapping of str to str
        Place of a variable → what goes before its name.
    signed_above : int
        What has a sign of its own stands in parentheses inside operations of a higher rank than this.
    """

    signs: Mapping[str, str]
    negation: str
    assignment: str
    condition: str
    otherwise: str
    end: str
    nothing: str
    remark: str
    prefixes: Mapping[str, str]
    indent: str = "    "
    signed_above: int = _OF_COMPARISON

    def real(self, value: float) -> str:
        """A real literal."""
        return repr(value)

    def flag(self, value: bool) -> str:
        """True or false."""
        return str(value)

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
            return str(of.value)
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
