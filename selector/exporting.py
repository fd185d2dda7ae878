"""From a model file to the folder of a control: the program, its proof on recordings, the commissioning sheet."""

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from selector.atomic_file import folder_written_whole, refuse_to_replace_input, require_writable_folder
from selector.controllers.application import other_sampling, without_displacement_faults
from selector.controllers.evaluator import output_bound_um
from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard import decided as deciding
from selector.controllers.model_file import Input, ModelFile, OutputLimits, equations_sha256, write_model
from selector.controllers.replay.replayed import Replay, replay_findings, replayed
from selector.controllers.self_check import sealed, usable_model
from selector.controllers.writers.exported import Exported
from selector.controllers.writers.targets import LARGEST_MARGIN_PERCENT, TARGETS, Target
from selector.errors import NotExecutableError, OptionError
from selector.findings import Finding
from selector.physics.simulation_kind import Progress
from selector.quality.finding_table import GAUGE_BEGINS_LATE
from selector.readers import Overrides, Reading, read
from selector.telling.account import Account
from selector.telling.commissioning import commissioning_account
from selector.telling.page import write_account
from selector.text_file import shell_word

SCHEMA = "selector.export/1"
SHEET = "commissioning.html"
MODEL = "model.json"
_FEWEST_DIGITS = 8
_LIMITS_BELOW = 1e6


@dataclass(frozen=True)
class ExportOptions:
    """What is decided for one machine; the defaults leave the model as it is and replay nothing."""

    #: Output → largest correction [µm], a number or its text; what is not here is as the model file says
    clamp_um: Mapping[str, float | str] = field(default_factory=dict)
    #: Output → largest change of the correction [µm/s], likewise
    slew_um_per_s: Mapping[str, float | str] = field(default_factory=dict)
    invert: Sequence[str] = ()  #: Outputs whose axis the control counts the other way
    #: How far a program follows a sensor beyond its valid range, in % of the width of that range
    margin_percent: float = 0.0
    is_sign_verified: bool = False  #: The sign test of the commissioning sheet was passed
    #: Target and first digits (8 or more) of the equations SHA-256 of the program that passed it, ``st:1a2b3c4d``;
    #: another program is refused
    tested: str | None = None
    replay: Sequence[Path] = ()  #: Recordings to run through the program; a folder stands for those in it
    machine: Path | None = None  #: Machine file of these recordings
    overrides: Overrides = field(default_factory=Overrides)  #: How they are read, where that is not to be inferred


@dataclass(frozen=True, eq=False)
class Export:
    """What was written for a control."""

    target: str  #: A key of `TARGETS`
    folder: Path
    files: tuple[str, ...]  #: Names in the folder: programs, model file, commissioning sheet
    model: ModelFile  #: As the program has it: signs as asked for, no limit left open
    replay: Replay | None  #: None: nothing to replay, or nothing on this computer that executes the program
    findings: tuple[Finding, ...]
    is_sign_verified: bool
    sheet: Account  #: What the commissioning sheet says

    def as_dict(self) -> dict[str, Any]:
        """The object `selector.export/1`."""
        return {
            "schema": SCHEMA,
            "target": self.target,
            "files": list(self.files),
            "sign_verified": self.is_sign_verified,
            "replay": None if self.replay is None else self.replay.as_dict(),
            "findings": [finding.as_dict() for finding in self.findings],
        }


def export_model(
    model: str | Path,
    target: str,
    folder: str | Path,
    options: ExportOptions | None = None,
    progress: Progress | None = None,
) -> Export:
    """Write the program of a model for a control, guarded against broken sensors, and its commissioning sheet.

    With `ExportOptions.replay`, the written program is executed on recordings and compared with the model, sample by
    sample. The folder is written whole or not at all; files of an earlier export to the same control are replaced.

    `target` is a key of `selector.controllers.writers.targets.TARGETS`: ``"c"``, ``"st"``, ``"sinumerik"`` … `progress`
    is called with runs done, runs in all, and what is being done, before each replayed run.

    Raises OptionError: an unknown target or output, a limit that is none, an untested program, or a folder that cannot
    be written. ModelFileError: The model file contradicts itself. ExportRefusedError: The control cannot take this
    model. InputError: Recordings cannot be read, or lack what the model needs.
    """
    model, folder, options = Path(model), Path(folder), options or ExportOptions()
    if target not in TARGETS:
        word = target.lower()
        meant = [name for name, one in TARGETS.items() if word and word in one.title.lower()]
        # or the ending of a program, which may be that of several controls
        ended = [
            name for name, one in TARGETS.items() if f".{word}" in {Path(of.file).suffix.lower() for of in one.parts}
        ]
        near = meant or difflib.get_close_matches(word, TARGETS, n=1) or ended * (len(ended) == 1)
        advice = f"did you mean {near[0]}?" if near else "choose one"
        raise OptionError(repr(target), expected="one of " + ", ".join(TARGETS), where="--for", advice=advice)
    chosen = TARGETS[target]
    usable, of_model = usable_model(model)
    # the model itself may lie there: it stays as it is
    own = [] if (folder / MODEL).exists() and (folder / MODEL).samefile(model) else [MODEL]
    require_writable_folder(folder, "--out", (SHEET, *own))
    usable, of_touch_offs = _as_can_be_adapted(usable, chosen)
    wider, of_margin = _with_margin(deciding.with_turned_signs(usable, options.invert), chosen, options.margin_percent)
    wanted = _with_limits(wider, chosen, options)
    of_limits = deciding.decided_limits(wanted)[1] if chosen.has_guard else ()
    of_sign = tuple(_of_sign(wanted, target, options))
    decided = sealed(deciding.with_decided_limits(wanted), is_kept=True)
    program = chosen.write(decided, is_sign_verified=options.is_sign_verified)
    files = (*program.files, *own, SHEET)
    how = replace(options.overrides, needed=tuple(item.name for item in usable.inputs))
    reading = read(options.replay, machine=options.machine, overrides=how) if options.replay else None
    machine_files = () if options.machine is None else (options.machine,)
    recorded = () if reading is None else tuple(file for file, _ in reading.files)
    for name in files:
        refuse_to_replace_input(folder / name, (model, *machine_files, *recorded), "--out")
    proof, of_replay = (None, ()) if reading is None else _replayed(decided, chosen, program.files, reading, progress)
    of_folder = (*_of_other_targets(target, folder, files), *([] if own else _of_model_there(usable, decided, folder)))
    findings = (*of_model, *of_touch_offs, *of_margin, *of_limits, *program.findings, *of_replay, *of_sign, *of_folder)
    is_verified = options.is_sign_verified
    sheet = commissioning_account(
        decided, program, chosen, target, replay=proof, findings=findings, is_sign_verified=is_verified
    )
    export = Export(target, folder, files, decided, proof, findings, is_verified, sheet)
    _write(export, program)
    return export


def _as_can_be_adapted(model: ModelFile, target: Target) -> tuple[ModelFile, tuple[Finding, ...]]:
    """The model without its adaptation, and a finding, where the control cannot take touch-offs."""
    if model.adaptation is None or target.takes_touch_offs:
        return model, ()
    names = [of.output for of in model.adaptation.outputs]
    told = FINDINGS.finding(
        "adaptation-not-exported",
        f"{target.title} cannot take touch-offs: {', '.join(names)} is corrected by the model alone.",
        evidence={"outputs": names},
    )
    return model.model_copy(update={"adaptation": None}), (told,)


def _with_margin(model: ModelFile, target: Target, percent: float) -> tuple[ModelFile, tuple[Finding, ...]]:
    """The model with wider valid ranges, and per output how far it then reaches beyond what it has seen."""
    if not 0.0 <= percent <= LARGEST_MARGIN_PERCENT or (percent and not target.has_guard):
        expected = f"a number of % from 0 to {LARGEST_MARGIN_PERCENT:g}"
        expected = expected if target.has_guard else f"no margin: {target.title} has no valid range"
        advice = "e.g. --margin 10; what lies farther outside has to be recorded"
        raise OptionError(f"{percent:g}", expected=expected, where="--margin", advice=advice)
    if percent == 0.0:
        return model, ()

    def wider(item: Input) -> Input:
        more = 0.01 * percent * (item.valid_max - item.valid_min)
        return item.model_copy(update={"valid_min": item.valid_min - more, "valid_max": item.valid_max + more})

    fallbacks = (one.model_copy(update={"inputs": tuple(map(wider, one.inputs))}) for one in model.fallbacks)
    changed = model.model_copy(update={"inputs": tuple(map(wider, model.inputs)), "fallbacks": tuple(fallbacks)})
    told = []
    for output in model.outputs:
        seen_um, beyond_um = output_bound_um(model, output), output_bound_um(changed, output)
        told.append(
            FINDINGS.finding(
                "margin-extrapolates",
                f"{output.name}: sensors are followed {percent:g} % beyond the range of the recordings. No run has "
                f"shown what happens there: the terms, at most {seen_um:.3g} µm inside, reach {beyond_um:.3g} µm.",
                evidence={"output": output.name, "percent": percent, "inside_um": seen_um, "beyond_um": beyond_um},
            )
        )
    return changed, tuple(told)


def _with_limits(model: ModelFile, target: Target, options: ExportOptions) -> ModelFile:
    """The model with the limits that were given; refuses them where the control has none."""
    found = {limits.output: limits for limits in model.guard.limits}
    for option, limit, values in (
        ("--clamp", "clamp_um", options.clamp_um),
        ("--slew", "slew_um_per_s", options.slew_um_per_s),
    ):
        of_output: dict[str, str] = {}
        for name, given in values.items():
            if not target.has_guard:
                expected = f"no limits: {target.title} has neither a clamp nor a slew limit"
                advice = "leave the option out, and limit the temperature that the control passes on"
                raise OptionError(f"{option} {name}={given}", expected=expected, where=option, advice=advice)
            of = deciding.named_output(model, name, option)
            if of in of_output:
                expected, advice = f"one value for {of}", "keep one of them"
                raise OptionError(f"{of_output[of]!r} and {name!r}", expected=expected, where=option, advice=advice)
            of_output[of] = name
            limits = found.get(of, OutputLimits(output=of))
            found[of] = limits.model_copy(update={limit: _limit(given, option, name)})
    limits_of = tuple(found[output.name] for output in model.outputs if output.name in found)
    guard = model.guard.model_copy(update={"limits": limits_of})
    return model.model_copy(update={"guard": guard})


def _limit(given: float | str, option: str, name: str) -> float:
    try:
        value = float(given)
    except ValueError:
        value = math.nan
    if not 0.0 < value < _LIMITS_BELOW:
        unit, example = ("µm", 50) if option == "--clamp" else ("µm/s", 1)
        expected = f"a number above 0 and below {_LIMITS_BELOW:.0f} {unit}"
        advice = f"e.g. {option} {shell_word(name)}={example}"
        raise OptionError(str(given), expected=expected, where=f"{option} {name}", advice=advice)
    return value


def _replayed(
    model: ModelFile, target: Target, files: Mapping[str, str], reading: Reading, progress: Progress | None
) -> tuple[Replay | None, tuple[Finding, ...]]:
    recording, quality = without_displacement_faults(model, reading.recording)
    left_out = [one for one in quality if one.action != "none" or one.id == GAUGE_BEGINS_LATE]
    total, done = len(recording.runs), iter(range(len(recording.runs)))
    say = None if progress is None else lambda what: progress(next(done, total), total, what)
    try:
        proof = replayed(model, files, recording, target.parts, say)
    except NotExecutableError as error:
        lack = f"The program was not executed: {error.found}."
        return None, (FINDINGS.finding("replay-not-run", lack, suggestion=error.advice),)
    of_clock = other_sampling(model, reading.recording, is_guarded=target.has_guard)
    return proof, (*reading.findings, *left_out, *of_clock, *replay_findings(proof, has_guard=target.has_guard))


def _of_sign(model: ModelFile, target: str, options: ExportOptions) -> Iterator[Finding]:
    """What is known of the sign; refuses to call another program verified than the one that was tested."""
    own, tested, is_verified = equations_sha256(model), options.tested, options.is_sign_verified
    if tested is not None and not is_verified:
        advice = "say --sign-verified when the sign test was passed, or leave --tested out"
        raise OptionError("--tested alone", expected="--sign-verified beside it", where="--tested", advice=advice)
    on, _, digits = (tested or "").rpartition(":")
    if tested is not None and (on != target or len(digits) < _FEWEST_DIGITS or not own.startswith(digits.lower())):
        raise OptionError(
            repr(tested),
            expected=f"{target}: and {_FEWEST_DIGITS} digits or more of {own}, target and equations SHA-256 of what "
            "would be written",
            where="--tested",
            advice="export what was tested, with the same --for and --invert; or do the sign test with this program",
        )
    if not is_verified:
        yield FINDINGS.finding(
            "sign-unverified",
            "SIGN UNVERIFIED: nobody has said that the sign test was passed.",
            suggestion="do the sign test of the commissioning sheet, then export again with the same options, "
            f"--sign-verified and --tested {target}:{own[:16]}",
        )
    elif tested is None:
        yield FINDINGS.finding(
            "sign-taken-on-trust",
            f"Sign verified is written on the program with equations SHA-256 {own[:16]}…; nobody said which one was "
            "tested.",
            evidence={"equations_sha256": own},
        )
    for output in model.outputs:
        if deciding.is_turned(output):
            yield FINDINGS.finding(
                "sign-turned",
                f"The correction of {output.name} is turned round: it is the displacement itself, for a control that "
                "counts the axis the other way.",
                evidence={"output": output.name},
            )


def _of_other_targets(target: str, folder: Path, files: Sequence[str]) -> Iterator[Finding]:
    """Programs of other controls in the folder, which the new model and sheet do not belong to."""
    left: dict[str, str] = {}
    for name, other in TARGETS.items():
        if name == target:
            continue
        patterns = [*(part.file for part in other.parts), *other.not_always]
        for file in sorted({path.name for pattern in patterns for path in folder.glob(pattern)} - set(files)):
            left.setdefault(file, name)
    if left:
        listed = ", ".join(f"{file} ({name})" for file, name in left.items())
        yield FINDINGS.finding(
            "other-target-in-folder",
            f"{folder} also holds programs of other controls: {listed}. {MODEL} and {SHEET} beside them are of this "
            "export and do not describe them.",
            evidence={"files": list(left)},
        )


def _of_model_there(asked: ModelFile, decided: ModelFile, folder: Path) -> Iterator[Finding]:
    """The exported model lies where the program goes, and does not say what was decided since."""
    if asked.guard != decided.guard or asked.outputs != decided.outputs:
        yield FINDINGS.finding(
            "model-not-of-program",
            f"{folder / MODEL} is the model that was exported and stays as it is: limits, signs and margin of the "
            "program are not in it.",
        )


def _write(export: Export, program: Exported) -> None:
    folder = export.folder
    earlier = [path.name for pattern in TARGETS[export.target].not_always for path in folder.glob(pattern)]
    with folder_written_whole(folder, earlier) as part:
        for name, content in program.files.items():
            (part / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        if MODEL in export.files:
            write_model(export.model, part / MODEL)
        write_account(export.sheet, part / SHEET)
