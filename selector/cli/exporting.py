"""`export`: a model file becomes the program of a control, with its commissioning sheet and the proof of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli import showing
from selector.cli.files import folder_written_whole, refuse_to_replace_input, require_writable_folder, written_folder
from selector.cli.models import Model
from selector.cli.progress import counted_progress
from selector.cli.showing import AsJson
from selector.cli.source import Source, pairs, with_source
from selector.errors import ModelFileError, OptionError
from selector.findings import Finding

if TYPE_CHECKING:
    from selector.controllers.model_file import ModelFile
    from selector.controllers.replay.replayed import Replay
    from selector.controllers.writers.targets import Target
    from selector.readers import Reading

SCHEMA = "selector.export/1"
SHEET = "commissioning.html"
MODEL = "model.json"
_FEWEST_DIGITS = 8
_LIMITS_BELOW = 1e6

For = Annotated[
    str,
    typer.Option(
        "--for", metavar="TARGET", help="c, st, tcpou, linuxcnc, sinumerik, beckhoff, fanuc, rexroth, python."
    ),
]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", parser=written_folder, help="Folder for the files.")]
ReplayOf = Annotated[
    list[Path] | None,
    typer.Option("--replay", metavar="PATH", help="Run recordings through the generated program; repeat."),
]
Inverts = Annotated[
    list[str] | None,
    typer.Option("--invert", metavar="OUTPUT", help="The control counts this output's axis the other way; repeat."),
]
SignVerified = Annotated[
    bool, typer.Option("--sign-verified", metavar="", help="You have done the sign test of the commissioning sheet.")
]
Tested = Annotated[
    str | None,
    typer.Option(
        "--tested",
        metavar="SHA-256",
        help="With --sign-verified: equations SHA-256 of the program that passed the test (its head has it); another "
        "program is refused.",
    ),
]
Clamps = Annotated[
    list[str] | None, typer.Option("--clamp", metavar="OUTPUT=µm", help="Largest correction of an output; repeat.")
]
Slews = Annotated[
    list[str] | None, typer.Option("--slew", metavar="OUTPUT=µm/s", help="Largest change of a correction; repeat.")
]


@partial(with_source, runs=ReplayOf)
def export(
    source: Source,
    model: Model,
    target: For,
    out: Out,
    clamp: Clamps = None,
    slew: Slews = None,
    invert: Inverts = None,
    sign_verified: SignVerified = False,
    tested: Tested = None,
    as_json: AsJson = False,
) -> None:
    """Writes the program of a model for a control, guarded against broken sensors, and a commissioning sheet.

    With --replay the generated program is executed on recordings and compared with the model, sample by sample.
    """
    from selector.controllers.guard import decided_limits, with_decided_limits
    from selector.controllers.signs import with_turned_signs
    from selector.controllers.writers.targets import TARGETS

    if target not in TARGETS:
        raise OptionError(repr(target), expected="one of " + ", ".join(TARGETS), where="--for", advice="choose one")
    chosen = TARGETS[target]
    if not source.runs:
        source.refuse_unread("--replay")
    require_writable_folder(out, "--out")
    usable, of_model = _usable(model)
    turned = with_turned_signs(usable, invert or ())
    if not chosen.has_guard:
        _refuse_limits(chosen, clamp, slew)
    read = _with_limits(turned, pairs(clamp, "--clamp"), pairs(slew, "--slew"))
    of_limits = decided_limits(read)[1] if chosen.has_guard else ()
    of_sign = tuple(_of_sign(read, sign_verified, tested))
    read = with_decided_limits(read)
    exported = chosen.write(read, is_sign_verified=sign_verified)
    findings = [*of_model, *of_limits, *exported.findings]
    # the model itself may lie there: it stays as it is
    own = [] if (out / MODEL).exists() and (out / MODEL).samefile(model) else [MODEL]
    files = [*exported.files, *own, SHEET]
    reading = source.reading() if source.runs else None
    recorded = [] if reading is None else [run.file for run in reading.runs]
    for name in files:
        refuse_to_replace_input(out / name, [model, *source.machine_files, *recorded], "--out")
    proof = None
    if reading is not None:
        proof, of_replay = _replayed(read, chosen, exported.files, reading)
        findings += of_replay
    findings += of_sign
    findings += _of_other_targets(target, out, files)
    _write(out, files, read, chosen, exported, proof, findings, sign_verified)
    answer: dict[str, Any] = {
        "schema": SCHEMA,
        "target": target,
        "files": files,
        "sign_verified": sign_verified,
        "replay": None if proof is None else proof.as_dict(),
        "findings": findings,
    }
    if as_json:
        showing.print_json(answer)
        return
    _show(chosen, proof, findings, out, files)


def _usable(path: Path) -> tuple[ModelFile, tuple[Finding, ...]]:
    from selector.controllers.model_io import read_model
    from selector.controllers.self_check import model_findings

    read = read_model(path)
    findings = model_findings(read)
    wrong = [finding.statement for finding in findings if finding.level == "error"]
    if wrong:
        raise ModelFileError(
            "; ".join(wrong),
            expected="a model file whose test vectors and numbers agree with each other",
            where=str(path),
            advice="do not export this file; make it again with `selector select --out DIR`",
        )
    return read, findings


def _with_limits(model: ModelFile, clamps: dict[str, str], slews: dict[str, str]) -> ModelFile:
    from selector.controllers.model_file import OutputLimits

    names = [output.name for output in model.outputs]
    given = {limits.output: limits for limits in model.guard.limits}
    for option, field, values in (("--clamp", "clamp_um", clamps), ("--slew", "slew_um_per_s", slews)):
        for name, text in values.items():
            if name not in names:
                raise OptionError(
                    f"no output {name!r}",
                    expected="one of " + ", ".join(names),
                    where=option,
                    advice="correct the name",
                )
            limits = given.get(name, OutputLimits(output=name))
            given[name] = limits.model_copy(update={field: _limit(text, option, name)})
    guard = model.guard.model_copy(update={"limits": tuple(given[name] for name in names if name in given)})
    return model.model_copy(update={"guard": guard})


def _limit(text: str, option: str, name: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < _LIMITS_BELOW:
        unit, example = ("µm", 50) if option == "--clamp" else ("µm/s", 1)
        raise OptionError(
            text,
            expected=f"a number above 0 and below {_LIMITS_BELOW:.0f} {unit}",
            where=f"{option} {name}",
            advice=f"e.g. {option} {name}={example}",
        )
    return value


def _replayed(
    model: ModelFile, target: Target, files: Mapping[str, str], reading: Reading
) -> tuple[Replay | None, list[Finding]]:
    from selector.controllers.compared import without_displacement_faults
    from selector.controllers.replay.replay_findings import replay_findings
    from selector.controllers.replay.replayed import replayed
    from selector.controllers.sampling import other_sampling
    from selector.controllers.writers.targets import NotExecutableError

    recording, quality = without_displacement_faults(model, reading.recording)
    left_out = [finding for finding in quality if finding.action != "none"]
    total = len(recording.runs)
    with counted_progress("replaying") as say:
        done = iter(range(total))
        try:
            proof = replayed(
                model,
                files,
                recording,
                target.parts,
                lambda run: say(next(done), total, f"run {run}"),
            )
        except NotExecutableError as error:
            return None, [
                Finding(
                    "replay-not-run",
                    "warning",
                    f"The program was not executed: {error.found}.",
                    suggestion=error.advice,
                )
            ]
    of_clock = other_sampling(model, reading.recording, is_guarded=target.has_guard)
    return proof, [*reading.findings, *left_out, *of_clock, *replay_findings(proof, has_guard=target.has_guard)]


def _refuse_limits(target: Target, clamps: list[str] | None, slews: list[str] | None) -> None:
    for option, given in (("--clamp", clamps), ("--slew", slews)):
        if given:
            raise OptionError(
                f"{option} {given[0]}",
                expected=f"no limits: {target.title} has neither a clamp nor a slew limit",
                where=option,
                advice="leave the option out, and limit the temperature that the control passes on",
            )


def _of_sign(model: ModelFile, is_verified: bool, tested: str | None) -> Iterator[Finding]:
    """What is known of the sign; refuses to call another program verified than the one that was tested."""
    from selector.controllers.model_io import equations_sha256
    from selector.controllers.signs import is_turned

    own = equations_sha256(model)
    if tested is not None and not is_verified:
        raise OptionError(
            "--tested alone",
            expected="--sign-verified beside it",
            where="--tested",
            advice="say --sign-verified when the sign test was passed, or leave --tested out",
        )
    if tested is not None and (len(tested) < _FEWEST_DIGITS or not own.startswith(tested.lower())):
        raise OptionError(
            repr(tested),
            expected=f"{_FEWEST_DIGITS} digits or more of {own}, the equations SHA-256 of what would be written",
            where="--tested",
            advice="export the model that was tested, with the same --invert; or do the sign test with this program",
        )
    if not is_verified:
        yield Finding(
            "sign-unverified",
            "warning",
            "SIGN UNVERIFIED: nobody has said that the sign test was passed.",
            suggestion="do the sign test of the commissioning sheet, then export again with the same options, "
            f"--sign-verified and --tested {own[:16]}",
        )
    elif tested is None:
        yield Finding(
            "sign-taken-on-trust",
            "info",
            f"Sign verified is written on the program with equations SHA-256 {own[:16]}…; nobody said which one was "
            "tested.",
            evidence={"equations_sha256": own},
            suggestion="compare it with the head of the program that passed the sign test, or say --tested with the "
            "digits from there",
        )
    for output in model.outputs:
        if is_turned(output):
            yield Finding(
                "sign-turned",
                "info",
                f"The correction of {output.name} is turned round: it is the displacement itself, for a control that "
                "counts the axis the other way.",
                evidence={"output": output.name},
                suggestion="do the sign test of the sheet with this program",
            )


def _of_other_targets(target: str, out: Path, files: list[str]) -> Iterator[Finding]:
    """Programs of other controls in the folder, which the new model and sheet do not belong to."""
    from selector.controllers.writers.targets import TARGETS

    left: dict[str, str] = {}
    for name, other in TARGETS.items():
        if name == target:
            continue
        patterns = [*(part.file for part in other.parts), *other.not_always]
        for file in sorted({path.name for pattern in patterns for path in out.glob(pattern)} - set(files)):
            left.setdefault(file, name)
    if left:
        listed = ", ".join(f"{file} ({name})" for file, name in left.items())
        yield Finding(
            "other-target-in-folder",
            "warning",
            f"{out} also holds programs of other controls: {listed}. {MODEL} and {SHEET} beside them are of this "
            "export and do not describe them.",
            evidence={"files": list(left)},
            suggestion="delete them with what was copied from them, or export again with an --out of its own for each "
            "control",
        )


def _write(
    out: Path,
    files: list[str],
    model: ModelFile,
    target: Target,
    exported: Any,
    proof: Replay | None,
    findings: list[Finding],
    sign_verified: bool,
) -> None:
    from selector.controllers.model_io import write_model
    from selector.report.commissioning import write_commissioning_sheet

    earlier = [path.name for pattern in target.not_always for path in out.glob(pattern)]
    with folder_written_whole(out, earlier) as part:
        for name, text in exported.files.items():
            (part / name).write_text(text, encoding="utf-8", newline="\n")
        if MODEL in files:
            write_model(model, part / MODEL)
        write_commissioning_sheet(
            part / SHEET,
            model,
            exported,
            target.title,
            replay=proof,
            findings=findings,
            is_sign_verified=sign_verified,
            has_guard=target.has_guard,
        )


def _show(target: Target, proof: Replay | None, findings: list[Finding], out: Path, files: list[str]) -> None:
    from selector.report.commissioning import errors_of, verdict_of

    console = showing.screen()
    console.print(f"{target.title}: {', '.join(files)}", style="bold", markup=False)
    if proof is not None:
        console.print(verdict_of(proof), markup=False)
        for part in proof.parts[len(proof.runs[0].accuracy) if proof.runs else 0 :]:
            console.print(
                f"{part.file}, {part.output}: {part.max_abs_difference_um:.3g} µm from what it has to give, "
                f"{part.allowed_um:.3g} µm allowed ({part.executed_by})",
                markup=False,
            )
        for line in errors_of(proof):
            console.print(line, markup=False)
    showing.show_findings(console, findings)
    console.print(f"wrote {out}", markup=False)
