"""RepRapFirmware 3.5: a macro of meta commands that daemon.g calls once a second, and what config.g declares for it."""

from collections.abc import Iterator, Mapping

import numpy as np

from selector.controllers.model_file import ModelFile, kept_sha256
from selector.controllers.program import guarded_program, language
from selector.controllers.single_precision import single_precision_findings, single_precision_lines
from selector.controllers.writers import exported
from selector.controllers.writers.fanuc import macro_model, position_findings

STEP, START, DAEMON = "selector_correction.g", "selector_correction_start.g", "daemon.g"
AXES = "XYZ"
LONGEST_LINE = 255  #: Without its indent and comment.
_HOLDS = language.Variable("holds", "flag", "temporary")


class MetaCommands(language.Language):
    """Words of the firmware's meta commands; what is not temporary is global."""

    signs: Mapping[str, str] = {"and": "&&", "or": "||"}
    negation = "!"
    assignment = "set {to} = {value}"
    condition = "if {condition}"
    otherwise = "else"
    nothing = "set var.holds = true"
    remark = " ; {text}"
    prefixes = dict.fromkeys(language.PLACES, "global.selector_") | {"temporary": "var."}
    indent = "  "

    def real(self, value: float) -> str:
        """The fewest digits that are this number in binary32; without point and exponent it would be an integer."""
        return str(np.float32(value))

    def flag(self, value: bool) -> str:
        """In small letters."""
        return str(value).lower()

    def expression(self, of: language.Expression, outer: int = 0, *, is_right: bool = False) -> str:
        """``a <= b`` is not ``a > b`` there, true of NaN; and ``-x`` fails where ``&&`` or ``||`` leave x out."""
        if isinstance(of, language.Negative):
            return self.expression(language.Real(0.0) - of.of, 8)
        if isinstance(of, language.Operation) and of.sign in ("<=", ">="):
            less, same = (language.Operation(sign, of.left, of.right) for sign in (of.sign[0], "=="))
            return f"({self.expression(less)} || {self.expression(same)})"
        return super().expression(of, outer, is_right=is_right)

    def _branches(self, one: language.If, depth: int) -> Iterator[str]:
        if len(f"if {self.expression(one.condition)}") > LONGEST_LINE:
            yield from self.lines(tuple(_part_by_part(one.condition)), depth)
            one = language.If(_HOLDS, one.then, one.otherwise)
        yield from super()._branches(one, depth)


def _part_by_part(condition: language.Expression) -> Iterator[language.Assign]:
    """A condition that is too long for a line, in `_HOLDS`."""
    if isinstance(condition, language.Not):
        yield from _part_by_part(condition.of)
        yield language.Assign(_HOLDS, ~_HOLDS)
    elif isinstance(condition, language.Operation) and condition.sign in ("and", "or"):
        yield from _part_by_part(condition.left)
        yield language.Assign(_HOLDS, language.Operation(condition.sign, _HOLDS, condition.right))
    else:
        yield language.Assign(_HOLDS, condition)


def reprapfirmware_export(model: ModelFile, *, is_sign_verified: bool = False) -> exported.Exported:
    """The macro, what the end of config.g calls, and daemon.g."""
    where, axes = "RepRapFirmware, babysteps (M290)", [output.axis_or_name.upper() for output in model.outputs]
    exported.require_own_axes(model, where)
    exported.require_axes(axes, AXES, "their places in the firmware's object model are the same everywhere", where)
    own, kept = macro_model(model), f"selector_kept_{kept_sha256(model)[:8]}.g"
    head = [*exported.heading(own, is_sign_verified=is_sign_verified), *single_precision_lines(own)]
    files = _files(own, axes, [f" ; {language.plain(line)}" for line in head], kept)
    longest = max((line.split(" ;")[0].strip() for line in files[STEP].splitlines()), key=len)
    if len(longest) > LONGEST_LINE:
        raise exported.ExportRefusedError(
            f"a line of {len(longest)} characters, {longest[:40]} ...",
            expected=f"at most {LONGEST_LINE}",
            where=where,
            advice="select a model of a lower degree (`selector select --degree 2`)",
        )
    findings = (*position_findings(model, "babysteps"), *single_precision_findings(own, STEP))
    return exported.with_sheet(
        "reprapfirmware", model, files, findings=findings, step=STEP, start=START, daemon=DAEMON, kept=kept
    )


def _files(model: ModelFile, axes: list[str], head: list[str], kept: str) -> dict[str, str]:
    program, words, filled = guarded_program(model, has_zero=True), MetaCommands(), exported.filled
    initial = {one: f"{one.name} = {words.initial(one)}" for one in (*program.variables, _HOLDS)}
    blocks = []
    for k, item in enumerate(model.inputs, start=1):
        kind = "thermometer" if item.unit == "degC" else "other"
        blocks.append(filled(f"reprapfirmware_{kind}", k=k, about=language.plain(f"{item.name} [{item.unit}]")))
    for k, axis in enumerate(axes, start=1):
        blocks.append(filled("reprapfirmware_output", k=k, axis=axis, at=AXES.index(axis)))
    declared, called = zip(*(block.rstrip().split("\n---\n") for block in blocks), strict=True)
    # flags last: what a power failure cuts off is then not said to be there; a quotient is written with all its digits
    retained = sorted(program.of("retained"), key=lambda one: one.kind == "flag")
    exact = {"real": " / 1", "flag": ""}
    step = filled(
        "reprapfirmware_step",
        head=head,
        kept=kept,
        temporary=[f"var {text}" for one, text in initial.items() if one.place == "temporary"],
        inputs=list(called[: len(model.inputs)]),
        zero=[f"var is_zero_{k} = global.selector_is_zero_{k}" for k in range(1, len(axes) + 1)],
        ready=" && ".join(f"move.axes[{AXES.index(axis)}].homed" for axis in axes),
        program=list(words.lines(program.body)),
        outputs=list(called[len(model.inputs) :]),
        saved=[
            f'  echo >>"{kept}" "set {words.name(one)} = "^{{{words.name(one)}{exact[one.kind]}}}' for one in retained
        ],
    )
    lasting = [f"  global selector_{text} ; {one.about}" for one, text in initial.items() if one.place != "temporary"]
    variables = [*declared, " ; inputs, outputs and what is kept from call to call", *map(language.plain, lasting)]
    start = filled("reprapfirmware_start", head=head, start=START, variables=variables)
    return {STEP: step, START: start, DAEMON: filled("reprapfirmware_daemon", head=head, step=STEP)}
