"""What a writer gives for one control: files with a head, a sheet, a sign test, or a refusal."""

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from string import Template
from typing import Any

from selector import __version__
from selector.controllers.evaluator import formula_text
from selector.controllers.guard.decided import Mode, decided_limits, is_turned, longest_test_s
from selector.controllers.model_file import ModelFile, equations_sha256
from selector.controllers.program.language import plain
from selector.errors import InputError
from selector.findings import Finding

TEST_UM = 10.0  #: Large enough for an indicator of 1 µm, too small to break anything.

_UNLESS = (
    f"If the mode is not {Mode.TEST:d}, there is no test and the reading counts for nothing: command 0, let the "
    "program run for some seconds, and command the line again."
)


def require_own_axes(model: ModelFile, where: str) -> None:
    """Refuses two outputs on one axis: a control that moves it would move it twice, or by the last of them."""
    for axis, (first, second, *_) in _shared_axes(model).items():
        raise ExportRefusedError(
            f"outputs {first} and {second} both correct axis {axis}",
            expected="one output for one axis",
            where=where,
            advice="leave one of them out, or name the axis that it moves in the model file",
        )


def _shared_axes(model: ModelFile) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for output in model.outputs:
        found.setdefault(output.axis_or_name.upper(), []).append(output.name)
    return {axis: names for axis, names in found.items() if len(names) > 1}


def _wired_once(model: ModelFile) -> list[str]:
    """What is to be said where outputs are variables, and a person decides which of them moves an axis."""
    return [
        f"{' and '.join(names)} each correct the whole axis {axis}: wire one of them to it, that of the place where "
        "the tool cuts. Never add them: the axis would be corrected twice."
        for axis, names in _shared_axes(model).items()
    ]


def require_axes(axes: Iterable[str], known: str, why: str, where: str) -> None:
    """Refuses an axis that is not among the letters `known`; `why` says why there are no others."""
    for axis in axes:
        if axis.upper() not in tuple(known):
            raise ExportRefusedError(
                f"axis {axis!r}",
                expected=f"{', '.join(known[:-1])} or {known[-1]}: {why}",
                where=where,
                advice="name the axis of the output in the model file (outputs.axis), or leave the output out",
            )


@dataclass(frozen=True)
class Commanded:
    """The test of one output."""

    output: str
    axis: str
    command: str  #: What is to be set
    shown: str  #: What the control shows then
    expected_um: float  #: What the indicator has to read
    wait_s: float  #: For so long the correction is on its way; 0 where it comes at once


OfOutput = Callable[[int, float], Mapping[str, object]]


@dataclass(frozen=True)
class SignTest:
    """The test on one control."""

    before: str  #: How the correction is brought to zero first
    commanded: tuple[Commanded, ...]  #: Per output
    after: str  #: How the test ends
    by: str  #: What commands the correction, and until when
    wrong: str  #: What to do if the indicator reads the other sign
    unless: str  #: How it is seen that there is no test, and what to do; empty: there always is


def _sign_test(
    model: ModelFile, words: Mapping[str, Any], values: Mapping[str, object], of_output: OfOutput
) -> SignTest:
    limits, _ = decided_limits(model)
    lines = []
    for k, output in enumerate(model.outputs, 1):
        of, axis = limits[output.name], output.axis_or_name
        um = min(TEST_UM, of.clamp_um)
        units = {"um": um, "mm": um / 1000.0, "tenths": round(10.0 * um), "mode": int(Mode.TEST)}
        own = {**values, **units, "k": k, "axis": axis.upper(), "small": axis.lower(), **of_output(k, um)}
        command, shown = (words[part].format(**own) for part in ("command", "shown"))
        expected_um = words.get("direction", 1.0) * (-um if is_turned(output) else um)
        wait_s = 0.0 if "by" in words else um / of.own_slew_um_per_s
        lines.append(Commanded(output.name, output.axis or "", command, shown, expected_um, wait_s))
    before, after = (words[part].format(**values) for part in ("before", "after"))
    by = words.get("by", "")
    return SignTest(before, tuple(lines), after, by or _by_program(model), _wrong(model), "" if by else _UNLESS)


def _by_program(model: ModelFile) -> str:
    minutes = math.floor(longest_test_s(model) / 60.0)
    return (
        "The program itself commands the correction; the model has no say meanwhile. It does so only after a call in "
        f"which nothing was commanded while the axis was ready, and for {minutes} min at most. After that, and after a "
        "restart, the correction goes to zero and stays there until 0 was commanded."
    )


def _wrong(model: ModelFile) -> str:
    """What to do if the indicator reads the other sign: never to give the same program again."""
    turned = [output.name for output in model.outputs if is_turned(output)]
    straight = [output.name for output in model.outputs if not is_turned(output)]
    ways = []
    if straight:
        ways.append(f"of {', '.join(straight)}: export again with --invert and that name")
    if turned:
        ways.append(
            f"of {', '.join(turned)}: it is turned already, so export the model as selected, and do not invert it"
        )
    return "; ".join(ways) + ". Put that on the control and repeat the test; its sheet expects the other sign"


@dataclass(frozen=True)
class Exported:
    """Files for a control, and what the person has to know who puts them there."""

    files: Mapping[str, Any]  #: Name → text, in ASCII for programs; of an archive its bytes
    install: tuple[str, ...]  #: Steps on the control, in order: what to copy, wire, set; with units
    sign_test: SignTest  #: How the sign is proved on this control
    silently: tuple[str, ...] = ()  #: What this control does without telling anybody: clips, spreads, forgets, jumps
    findings: tuple[Finding, ...] = ()  #: What of the model this control cannot take, and what was done instead


@cache
def _sheets() -> dict[str, dict[str, Any]]:
    return tomllib.loads(Path(__file__).with_name("sheets.toml").read_text(encoding="utf-8"))


def with_sheet(
    target: str,
    model: ModelFile,
    files: Mapping[str, Any],
    findings: Iterable[Finding] = (),
    of_output: OfOutput = lambda _k, _um: {},
    **values: object,
) -> Exported:
    """The files with what ``sheets.toml`` says of them, values in the places of its {names}.

    In command and shown of the sign test stand also {k}, {axis}, {small}, {um}, {mm}, {tenths} of an output, and what
    `of_output` has of its number and {um}. A test in which something else than the program commands says so in `by`,
    and has it at once; a `direction` of −1: what is commanded has the sign of the displacement.
    """
    told = _sheets()[target]
    words = told["sign"]
    words = {**_sheets()[words["like"]]["sign"], **words} if "like" in words else words
    axes = [output.axis_or_name for output in model.outputs]
    values = {"axes": ", ".join(axes), "first": axes[0].upper(), "small": axes[0].lower(), **values}
    test = _sign_test(model, words, values, of_output)
    install, silently = (tuple(text.format(**values) for text in told[part]) for part in ("install", "silently"))
    return Exported(files, (*_wired_once(model), *install), test, silently, tuple(findings))


class _Template(Template):
    delimiter = "@"


def filled(template: str, **values: object) -> str:
    """A text of the folder ``templates``, values in the places of its ``@names``; lists are lines."""
    text = Path(__file__).with_name("templates").joinpath(f"{template}.txt").read_text(encoding="ascii")
    lines = {name: "\n".join(value) if isinstance(value, list) else value for name, value in values.items()}
    return _Template(text).substitute(lines)


UNVERIFIED = "SIGN UNVERIFIED: do the sign test of the commissioning sheet before cutting."
VERIFIED = "Sign verified, as the person said who exported it."


def heading(model: ModelFile, *, is_sign_verified: bool) -> list[str]:
    """Lines of ASCII: sign, formulas, units, hash of the equations, version."""
    lines = [
        UNVERIFIED if not is_sign_verified else VERIFIED,
        f"Model: {model.name}",
        *(f"  {line} [um]" for line in formula_text(model).splitlines()),
        "The correction of an axis is the negative of its displacement.",
        *_wired_once(model),
        *(
            f"TURNED ROUND: the correction of {output.name} is the displacement itself; the control counts the axis "
            "the other way."
            for output in model.outputs
            if is_turned(output)
        ),
        *(
            f"Touch-offs add offset{' + gain * displacement' if of.gain_limit > 0.0 else ''} to {of.output}, offset at "
            f"most {of.offset_limit_um:g} um."
            for of in (() if model.adaptation is None else model.adaptation.outputs)
        ),
        f"Equations SHA-256 {equations_sha256(model)}",
        f"Written by selector {__version__}",
    ]
    return [plain(line) for line in lines]


class ExportRefusedError(InputError):
    """A control cannot take a model; another target can, or another model."""
