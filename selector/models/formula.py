"""A model in Wilkinson's notation, ``Z ~ T1 + T3 + T1:T3``, read as terms; nothing in it is evaluated."""

import functools
import re
from dataclasses import dataclass

from formulaic.errors import FormulaicError
from formulaic.parser import DefaultFormulaParser
from formulaic.parser.types import Factor, OrderedSet
from formulaic.parser.types import Term as WrittenTerm
from formulaic.utils.structured import Structured

from selector.errors import OptionError
from selector.models.design import MAX_DEGREE, Term

LONGEST = 4000
#: A run of some hundred samples teaches no more coefficients; a formula beyond is a slip, such as ``(…)**3``.
MOST_TERMS = 100
WHERE = "--formula"
EXAMPLE = (
    "e.g. 'Z ~ T1 + `oil tank` + T1:T3' in single quotes: most shells run what stands in backticks (cmd.exe: double)"
)
_POWER = re.compile(r"^(?:I\()?\s*(?P<name>`[^`]+`|[^\s`*^()]+)\s*(?:\*\*|\^)\s*(?P<power>\d+)\s*\)?$")
_PROTECTED = re.compile(r"I\([^()]*\)|\{[^{}]*\}")
_BARE_POWER = re.compile(r"(`[^`]+`|[^\W\d][\w.]*)\s*(?:\*\*|\^)\s*(\d+)")
_QUOTED = re.compile(r"`[^`]*`")
_NO_TERM = re.compile(r"[~+:/]\s*(?:[+:*/]|$)|\*\s*(?:[+:/]|$)")
_ANY_POWER = re.compile(r"(?:\*\*|\^)\s*(\d+)")


@dataclass(frozen=True)
class Formula:
    """What a formula says."""

    responses: tuple[str, ...]  #: Left of the tilde
    terms: tuple[Term, ...]  #: Right of it, without the intercept, by total degree

    @property
    def variables(self) -> tuple[str, ...]:
        """Every channel that a term needs, in the order of their first terms."""
        return tuple(dict.fromkeys(name for term in self.terms for name in term.variables))


@functools.lru_cache(maxsize=64)
def formula_of(text: str) -> Formula:
    """The responses and terms of a formula: ``+ : * / ( )**n`` as in Wilkinson and Rogers (1973), ``I(T1**2)`` squares.

    A name that is not a word stands in backticks. Every model has an intercept.

    Raises OptionError: it is no such formula, or not a polynomial in channels up to a total degree of three.
    """
    written = _written(text)
    left, right = (getattr(written, side, None) for side in ("lhs", "rhs"))
    if not (isinstance(left, OrderedSet) and isinstance(right, OrderedSet)):
        raise _refused(repr(text), "one response or more, one tilde, and terms")
    responses = [_plain(term, "left of the tilde") for term in left]
    terms: dict[tuple[tuple[str, int], ...], Term] = {}
    has_intercept = False
    for one in right:
        term = _term(one)
        has_intercept |= not term.powers
        if term.degree > MAX_DEGREE:
            raise _refused(
                f"{term} of total degree {term.degree}", f"at most {MAX_DEGREE}: higher ones extrapolate wildly"
            )
        terms.setdefault(tuple(sorted(term.powers)), term)
    terms.pop((), None)
    if not has_intercept:
        raise _refused(
            f"no intercept in {text!r}", "a model with one", "leave -1 and 0 out: R² means another thing without"
        )
    if not terms or not responses:
        raise _refused(
            f"no {'term' if responses else 'response'} in {text!r}", "a response, a tilde, and at least one sensor"
        )
    if len(terms) > MOST_TERMS:
        raise _refused(f"{len(terms)} terms", f"at most {MOST_TERMS}")
    return Formula(tuple(dict.fromkeys(responses)), tuple(sorted(terms.values(), key=lambda term: term.degree)))


def _written(text: str) -> Structured[OrderedSet[WrittenTerm]]:
    bare = _BARE_POWER.search(_PROTECTED.sub("", text))
    if bare:
        name, power = bare.groups()
        raise _refused(
            f"{bare.group()} (in this notation the same as {name})", f"I({name}**{power}) for a power of a sensor"
        )
    if _NO_TERM.search(_QUOTED.sub("x", text)):
        raise _refused(f"{text!r}, with an operator beside nothing", "a name on both sides of each")
    powers = [int(power) for power in _ANY_POWER.findall(text[:LONGEST])]
    if len(text) > LONGEST or max(powers, default=1) > MAX_DEGREE:
        what = f"{len(text)} characters" if len(text) > LONGEST else f"a power of {max(powers)}"
        raise _refused(what, f"at most {LONGEST} characters, and powers up to {MAX_DEGREE}")
    try:
        return DefaultFormulaParser().get_terms(text)
    except (FormulaicError, SyntaxError, ValueError, RecursionError) as error:
        said = re.sub(r"\x1b\[[0-9;]*m|[⧛⧚]", "", str(error)).split("\n")[0].strip()
        raise _refused(f"{text!r} ({said})", "Wilkinson's notation, names with blanks in backticks") from None


def _plain(term: WrittenTerm, where: str) -> str:
    powers = _term(term).powers
    if len(powers) != 1 or powers[0][1] != 1:
        raise _refused(f"{term} {where}", "the name of a channel")
    return powers[0][0]


def _term(written: WrittenTerm) -> Term:
    powers: dict[str, int] = {}
    for factor in written.factors:
        name, power = _factor(factor)
        if name:
            powers[name] = powers.get(name, 0) + power
    return Term.of(powers)


def _factor(factor: Factor) -> tuple[str, int]:
    """(name of a channel, power); no name for the intercept."""
    method = factor.eval_method.value
    if method == "lookup":
        return factor.expr, 1
    if method == "literal" and factor.expr == "1":
        return "", 0
    power = _POWER.match(factor.expr)
    if power is None:
        raise _refused(f"{factor.expr} in a term", "names of channels, products T1:T3 and powers I(T1**2)")
    return power["name"].strip("`"), int(power["power"])


def _refused(found: str, expected: str, advice: str = EXAMPLE) -> OptionError:
    return OptionError(found, expected=expected, where=WHERE, advice=advice)
