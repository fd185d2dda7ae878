"""The generated FANUC macro, executed block by block: only what `selector.controllers.writers.fanuc` writes.

A block of another form, too long, with a lower-case letter or with brackets deeper than five is refused, so that a
program that runs here is inside the subset.
"""

from __future__ import annotations

import dataclasses
import operator
import re
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import axes_of
from selector.controllers.replay.reduced_guard import held, rows_at, sampled_rows
from selector.controllers.replay.rows import Answers, Rows
from selector.controllers.writers.fanuc import FILE, STATUS, TIME, fanuc_export, macro_variables
from selector.controllers.writers.macro_b import LONGEST_BLOCK
from selector.controllers.writers.macro_b_offset import ABSOLUTE_OR_NOT, INCH_OR_MM

ALARM = 3000
DEEPEST_BRACKETS = 5
MOST_BLOCKS = 100_000
_TOKEN = re.compile(r"\d+\.\d*|\.\d+|\d+|#\d+|ABS|EQ|NE|GT|GE|LT|LE|[\[\]+\-*/]")
_COMMENT = re.compile(r"\([A-Z0-9 .,+\-*/=\[\]]*\)")
_BLOCK = re.compile(
    r"(?:N(?P<label>\d+))?(?:IF\[(?P<condition>.*)\](?:GOTO(?P<jump>\d+)|THEN#(?P<then>\d+)=(?P<value>.+))"
    r"|GOTO(?P<goto>\d+)|#(?P<to>\d+)=(?P<assigned>.+)|G10L2P0(?P<axis>[A-Z])(?P<offset>\[.*\])|G(?P<modal>9[01])|(?P<end>M99))?"
)
_COMPARED: dict[str, Callable[[float, float], bool]] = {
    "EQ": operator.eq, "NE": operator.ne, "GT": operator.gt, "GE": operator.ge, "LT": operator.lt, "LE": operator.le,
}  # fmt: skip


class MacroError(ValueError):
    """A block is not in the subset."""


class MacroB:
    """A macro with its variables, which stay from call to call.

    Parameters
    ----------
    text : str
        From ``%`` to ``%``.

    Attributes
    ----------
    variables : dict of int to float
        What is not in it is vacant.
    modal : dict of int to float
        #4003 (90 or 91) and #4006 (20 or 21); a control that has no such group lacks it.
    offsets : dict of str to float
        Per axis, what G10 wrote to the external work offset [mm, or inch].

    Raises
    ------
    MacroError
        A block is not in the subset.
    """

    def __init__(self, text: str) -> None:
        self.variables: dict[int, float] = {}
        self.modal = {ABSOLUTE_OR_NOT: 90.0, INCH_OR_MM: 21.0}
        self.offsets: dict[str, float] = {}
        lines = text.split("\n")
        if lines[0] != "%" or lines[-2:] != ["%", ""] or not re.fullmatch(r"O\d{4}\([A-Z ]*\)", lines[1]):
            raise MacroError("no % ... O0000(NAME) ... %")
        self._blocks = [self._block(line) for line in lines[2:-2]]
        self._labels = {int(block["label"]): k for k, block in enumerate(self._blocks) if block["label"]}

    def call(self) -> None:
        """One call, to M99.

        Raises
        ------
        MacroError
            It does not end, jumps to a label that is not there, ends in an alarm, or has G90 where there is none.
        """
        at = 0
        for _ in range(MOST_BLOCKS):
            block, at = self._blocks[at], at + 1
            goto = block["goto"]
            if block["condition"] and self._holds(block["condition"]):
                goto = block["jump"]
                if block["then"]:
                    self._assign(block["then"], block["value"])
            if block["to"]:
                self._assign(block["to"], block["assigned"])
            if block["axis"]:
                if self.modal.get(ABSOLUTE_OR_NOT) == 91.0:
                    raise MacroError("G10 in incremental mode")
                self.offsets[block["axis"]] = _number(self._value(block["offset"]))
            if block["modal"]:
                if ABSOLUTE_OR_NOT not in self.modal:
                    raise MacroError("G90 is a turning cycle here")
                self.modal[ABSOLUTE_OR_NOT] = float(block["modal"])
            if block["end"]:
                return
            if goto:
                if int(goto) not in self._labels:
                    raise MacroError(f"GOTO{goto} without its N")
                at = self._labels[int(goto)]
        raise MacroError("no M99 is reached")

    def _block(self, line: str) -> dict[str, str]:
        if len(line) > LONGEST_BLOCK:
            raise MacroError(f"longer than {LONGEST_BLOCK}: {line}")
        match = _BLOCK.fullmatch(_COMMENT.sub("", line))
        if match is None:
            raise MacroError(line)
        return {name: text or "" for name, text in match.groupdict().items()}

    def _assign(self, to: str, text: str) -> None:
        value = self._value(text)
        if int(to) == ALARM:
            raise MacroError(f"alarm {3000 + _number(value):.0f}")
        self.variables.pop(int(to), None)
        if value is not None:
            self.variables[int(to)] = value

    def _holds(self, text: str) -> bool:
        tokens = list(_tokens(text))
        left = self._sum(tokens)
        compare = _COMPARED[tokens.pop(0)]
        right = self._sum(tokens)
        if tokens:
            raise MacroError(text)
        if left is None or right is None:
            # vacant equals #0 alone; the generated text compares with it by EQ only
            return (
                bool(compare(left is None, right is None)) if "#0" in text else compare(_number(left), _number(right))
            )
        return bool(compare(left, right))

    def _value(self, text: str) -> float | None:
        tokens = list(_tokens(text))
        value = self._sum(tokens)
        if tokens:
            raise MacroError(text)
        return value

    def _sum(self, tokens: list[str]) -> float | None:
        total = self._term(tokens)
        while tokens and tokens[0] in "+-":
            sign, right = tokens.pop(0), self._term(tokens)
            total = _number(total) + _number(right) if sign == "+" else _number(total) - _number(right)
        return total

    def _term(self, tokens: list[str]) -> float | None:
        total = self._factor(tokens)
        while tokens and tokens[0] in "*/":
            sign, right = tokens.pop(0), self._factor(tokens)
            total = _number(total) * _number(right) if sign == "*" else _number(total) / _number(right)
        return total

    def _factor(self, tokens: list[str]) -> float | None:
        word = tokens.pop(0) if tokens else ""
        if word == "-":
            return -_number(self._factor(tokens))
        if word == "ABS" and tokens and tokens[0] == "[":
            return abs(_number(self._factor(tokens)))
        if word == "[":
            value = self._sum(tokens)
            if not tokens or tokens.pop(0) != "]":
                raise MacroError("a bracket is not closed")
            return value
        if word.startswith("#"):
            return {**self.variables, **self.modal}.get(int(word[1:]))
        if not word[:1].isdigit():
            raise MacroError(f"{word!r} is no value")
        return float(word)


def macro_b_answers(model: ModelFile, rows: Rows, files: Mapping[str, str] | None = None) -> Answers:
    """What the generated macro leaves in the external work offset, called in every row, and the mode that it tells.

    Only `dt_s`, `readings`, `is_wanted` and `test_um` of the rows are looked at; what is not finite is vacant. Which
    sensor is bad it tells for one only: sensor codes are 0.
    """
    macro = MacroB((files or fanuc_export(model).files)[FILE])
    names = macro_variables(model)
    numbers = [*names.readings.values(), *names.tests.values()]
    written = np.column_stack([rows.readings, rows.tests_um(len(model.outputs))]).tolist()
    found = Answers.empty(len(rows), len(model.outputs), len(model.inputs), len(axes_of(model)))
    for k, time_s in enumerate(np.cumsum(rows.dt_s).tolist()):
        macro.variables[TIME] = time_s
        macro.variables[names.off] = float(not rows.is_wanted[k])
        for number, reading in zip(numbers, written[k], strict=True):
            macro.variables.pop(number, None)
            if np.isfinite(reading):
                macro.variables[number] = reading
        macro.call()
        found.correction_um[k] = [1000.0 * macro.offsets[str(output.axis).upper()] for output in model.outputs]
        found.mode[k] = int(macro.variables[STATUS])
    found.k0_um[:] = found.correction_um
    return found


def macro_b_called_at_most_once_a_second(model: ModelFile, rows: Rows, files: Mapping[str, str]) -> Answers:
    """As `macro_b_answers`, called as its sheet says; its offset stays until the next call."""
    calls = sampled_rows(rows)
    answers = macro_b_answers(model, rows_at(rows, calls), files)
    return Answers(*(held(getattr(answers, field.name), calls, len(rows)) for field in dataclasses.fields(Answers)))


def _number(value: float | None) -> float:
    return 0.0 if value is None else value


@cache
def _tokens(text: str) -> tuple[str, ...]:
    tokens = _TOKEN.findall(text)
    if "".join(tokens) != text:
        raise MacroError(text)
    depth = deepest = 0
    for token in tokens:
        depth += {"[": 1, "]": -1}.get(token, 0)
        deepest = max(deepest, depth)
    if depth != 0 or deepest > DEEPEST_BRACKETS:
        raise MacroError(f"brackets: {text}")
    return tuple(tokens)
