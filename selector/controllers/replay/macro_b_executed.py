"""The generated FANUC macros, executed block by block: only what `writers.fanuc` and `timed_program` write.

A block of another form, too long, with a lower-case letter or with brackets deeper than five is refused, so that a
program that runs here is inside the subset.
"""

import dataclasses
import math
import operator
import re
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from selector.controllers.evaluator import axes_of
from selector.controllers.guard.decided import LONGEST_S, SAMPLE_S
from selector.controllers.model_file import ModelFile
from selector.controllers.replay.parts import Answers, Rows, reference_answers
from selector.controllers.writers import fanuc
from selector.types import Array

ALARM = 3000
DEEPEST_BRACKETS = 5
MOST_BLOCKS = 100_000
_TOKEN = re.compile(r"\d+\.\d*|\.\d+|\d+|#\d+|ABS|FIX|[\[\]+\-*/]")
_COMMENT = re.compile(r"\([A-Z0-9 .,+\-*/=\[\]]*\)")
_BLOCK = re.compile(
    r"(?:N(?P<label>\d+))?(?:IF\[(?P<condition>.*)\](?:GOTO(?P<jump>\d+)|THEN#(?P<then>\d+)=(?P<value>.+))"
    r"|GOTO(?P<goto>\d+)|#(?P<to>\d+)=(?P<assigned>.+)|G10L2P0(?P<axis>[A-Z])(?P<offset>\[.*\])|G(?P<modal>9[01])|(?P<end>M99))?"
)
_COMPARED: dict[str, Callable[[float, float], bool]] = {
    "EQ": operator.eq, "NE": operator.ne, "GT": operator.gt, "GE": operator.ge, "LT": operator.lt, "LE": operator.le,
}  # fmt: skip
_PYTHON = {"[": "(", "]": ")", "ABS": "abs", "FIX": "fix"}
_Read = Callable[[int], float | None]  #: From the number of a variable to what it holds; None: it is vacant.
_Value = Callable[[_Read], float | None]


class MacroError(ValueError):
    """A block is not in the subset."""


class MacroB:
    """A macro, from ``%`` to ``%``, with its variables, which stay from call to call; one that is not there is vacant.

    `modal` has #4003 (90 or 91) and #4006 (20 or 21), unless the control has no such group; `offsets` per axis what G10
    wrote to the external work offset [mm, or inch].
    """

    def __init__(self, text: str) -> None:
        self.variables: dict[int, float] = {}
        self.modal = {fanuc.ABSOLUTE_OR_NOT: 90.0, fanuc.INCH_OR_MM: 21.0}
        self.offsets: dict[str, float] = {}
        lines = text.split("\n")
        if lines[0] != "%" or lines[-2:] != ["%", ""] or not re.fullmatch(r"O\d{4}\([A-Z ]*\)", lines[1]):
            raise MacroError("no % ... O0000(NAME) ... %")
        self._blocks = [self._block(line) for line in lines[2:-2]]
        self._labels = {int(block["label"]): k for k, block in enumerate(self._blocks) if block["label"]}

    def call(self) -> None:
        """One call, to M99."""
        at = 0
        for _ in range(MOST_BLOCKS):
            block, at = self._blocks[at], at + 1
            goto = block["goto"]
            if block["condition"] and _condition(block["condition"])(self._read):
                goto = block["jump"]
                if block["then"]:
                    self._assign(block["then"], block["value"])
            if block["to"]:
                self._assign(block["to"], block["assigned"])
            if block["axis"]:
                if self.modal.get(fanuc.ABSOLUTE_OR_NOT) == 91.0:
                    raise MacroError("G10 in incremental mode")
                self.offsets[block["axis"]] = _number(_value(block["offset"])(self._read))
            if block["modal"]:
                if fanuc.ABSOLUTE_OR_NOT not in self.modal:
                    raise MacroError("G90 is a turning cycle here")
                self.modal[fanuc.ABSOLUTE_OR_NOT] = float(block["modal"])
            if block["end"]:
                return
            if goto:
                if int(goto) not in self._labels:
                    raise MacroError(f"GOTO{goto} without its N")
                at = self._labels[int(goto)]
        raise MacroError("no M99 is reached")

    def _block(self, line: str) -> dict[str, str]:
        if len(line) > fanuc.LONGEST_BLOCK:
            raise MacroError(f"longer than {fanuc.LONGEST_BLOCK}: {line}")
        match = _BLOCK.fullmatch(_COMMENT.sub("", line))
        if match is None:
            raise MacroError(line)
        return {name: text or "" for name, text in match.groupdict().items()}

    def _assign(self, to: str, text: str) -> None:
        value = _value(text)(self._read)
        if int(to) == ALARM:
            raise MacroError(f"alarm {3000 + _number(value):.0f}")
        self.variables.pop(int(to), None)
        if value is not None:
            self.variables[int(to)] = value

    def _read(self, number: int) -> float | None:
        return self.modal.get(number, self.variables.get(number))


def macro_b_answers(model: ModelFile, rows: Rows, files: Mapping[str, str] | None = None) -> Answers:
    """What the generated macro leaves in the external work offset, called in every row, with its mode and codes.

    `is_ready` and `positions_m` are not looked at, and a restart is a pause; what is not finite is vacant.
    """
    macro = MacroB((files or fanuc.fanuc_export(model).files)[fanuc.FILE])
    names = fanuc.macro_variables(model)
    numbers = [*names.readings.values(), *names.tests.values()]
    codes = [names.program[f"sensor_{k}"] for k in range(1, len(model.inputs) + 1)]
    written = np.column_stack([rows.readings, rows.tests_um(len(model.outputs))]).tolist()
    found = Answers.empty(len(rows), len(model.outputs), len(model.inputs), len(axes_of(model)))
    for k, time_s in enumerate(np.cumsum(_passed_s(rows)).tolist()):
        macro.variables[fanuc.TIME] = time_s
        macro.variables[names.off] = float(not rows.is_wanted[k])
        for number, reading in zip(numbers, written[k], strict=True):
            macro.variables.pop(number, None)
            if np.isfinite(reading):
                macro.variables[number] = reading
        macro.call()
        found.correction_um[k] = [1000.0 * macro.offsets[str(output.axis).upper()] for output in model.outputs]
        found.mode[k] = int(macro.variables[fanuc.STATUS])
        found.sensors[k] = [int(macro.variables[code]) for code in codes]
    found.k0_um[:] = found.correction_um
    return found


def macro_corrections_um(model: ModelFile, rows: Rows) -> Array:
    """What the macro has to give, to the last bit but those of mm, of shape (n_rows, n_outputs) [µm]."""
    n, never = len(rows), np.zeros(len(rows), dtype=np.bool_)
    passed_s = _passed_s(rows)
    is_pause = (passed_s < 0.0) | (passed_s > fanuc.LONGEST_PAUSE_S)
    passed_s = np.where(passed_s < 0.0, SAMPLE_S, np.minimum(passed_s, LONGEST_S))
    readings = np.where(is_pause[:, None] | ~np.isfinite(rows.readings), np.nan, rows.readings)
    called = dataclasses.replace(
        rows, dt_s=passed_s, readings=readings, positions_m=np.zeros((n, 0)), is_ready=~never, is_restart=never
    )
    return reference_answers(fanuc.macro_model(model), called, literal=fanuc.literal_value).correction_um


def _passed_s(rows: Rows) -> Array:
    """The clock of the readings runs on while the control is off."""
    return rows.dt_s + np.where(rows.is_restart, rows.standstill_s, 0.0)


@cache
def _value(text: str) -> _Value:
    """The value of an expression, from what the variables hold; of a variable alone also that it is vacant."""
    if re.fullmatch(r"#\d+", text):
        number = int(text[1:])
        return lambda read: read(number)
    words = (f"number(read({word[1:]}))" if word[0] == "#" else _PYTHON.get(word, word) for word in _tokens(text))
    try:
        # numbers, signs and brackets only: the tokens are no others
        value: _Value = eval("lambda read: " + " ".join(words), {"number": _number, "abs": abs, "fix": math.trunc})  # noqa: S307
    except SyntaxError:
        raise MacroError(text) from None
    return value


@cache
def _condition(text: str) -> Callable[[_Read], bool]:
    match = re.fullmatch(r"(.+?)(EQ|NE|GT|GE|LT|LE)(.+)", text)
    if match is None:
        raise MacroError(text)
    left, compare, right = _value(match[1]), _COMPARED[match[2]], _value(match[3])
    if match[3] == "#0":
        # vacant equals #0 alone; the generated text compares with it by EQ only
        return lambda read: compare(left(read) is None, True)
    return lambda read: compare(_number(left(read)), _number(right(read)))


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
