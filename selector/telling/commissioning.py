"""The sheet that goes to the machine with an exported program: wiring, sign test, limits, restart, proof."""

from collections.abc import Iterator, Sequence

import numpy as np

from selector.controllers.guard.decided import LEAST_GOOD_SAMPLES, is_turned
from selector.controllers.model_file import ModelFile, equations_sha256
from selector.controllers.replay.replayed import CLOCK_S, JUMP_SHARE, NOISE_SHARE, OUTAGE_S, Replay
from selector.controllers.writers.exported import Exported, SignTest
from selector.controllers.writers.targets import Target
from selector.figures.panels import replayed_run
from selector.findings import Finding
from selector.number_text import number_text
from selector.telling import account
from selector.telling.model_card import STANDARD, card_blocks, formula_blocks, limits_table, sensors_table
from selector.telling.numbers import share_text

MOST_RUNS_DRAWN = 3


def commissioning_account(
    model: ModelFile,
    program: Exported,
    target: Target,
    name: str,
    *,
    replay: Replay | None,
    findings: Sequence[Finding],
    is_sign_verified: bool,
) -> account.Account:
    """What is told to the person who puts a program on a control, to be printed and signed."""
    turned, tested = _turned(model), f"{name}:{equations_sha256(model)[:16]}"
    label = (
        f"Turned round in this program: {turned}. The correction is the displacement itself, as the control was found "
        "to count the axis the other way."
    )
    return account.Account(
        f"Thermal correction: {target.title}",
        (
            *account.steps("commissioning.verified" if is_sign_verified else "commissioning.unverified", tested=tested),
            account.legend("commissioning.no-replay") if replay is None else verdict_of(replay),
        ),
        (
            account.Section(
                "sign", "Sign test", _sign_blocks(model, program.sign_test, target, tested, is_sign_verified)
            ),
            account.Section("install", "Installing", _install_blocks(program)),
            account.Section("wiring", "Wiring of the sensors", _wiring_blocks(model, target), link="Wiring"),
            *_touch_offs(model),
            account.Section(
                "limits", "Limits, faults and restarts", (_limits(model, target),), link="Limits and faults"
            ),
            account.Section(
                "silently",
                "What the control does silently",
                (account.Items(program.silently or ("Nothing is known.",)),),
            ),
            account.Section("replay", "Replay", _replay_blocks(model, replay)),
            *([account.Section("files", "Each file", (account.Captioned("", parts_table(replay)),))] if replay else []),
            account.Section(
                "card",
                "Model card",
                (account.Note(f"Headings after {STANDARD}."), *card_blocks(model, 3, has_guard=target.has_guard)),
            ),
            account.Section("findings", "Findings", (account.remarks_of(findings),)),
        ),
        about=model.name,
        label=label if turned else "",
        verdict="good" if is_sign_verified else "bad",
        brief=("replay",),
    )


def _turned(model: ModelFile) -> str:
    return ", ".join(output.name for output in model.outputs if is_turned(output))


def _sign_blocks(
    model: ModelFile, test: SignTest, target: Target, tested: str, is_verified: bool
) -> tuple[account.Block, ...]:
    too_quick = target.has_guard and any(item.rate_limit_per_min is not None for item in model.inputs)
    told = account.steps("commissioning.sign", **vars(test))
    if not is_verified:
        told += account.steps("commissioning.passed", tested=tested)
    form = account.table(
        ["output", "axis", "command", "wait", "the control shows", "the indicator has to read [µm]", "read [µm]",
         "right", "date, name"],
        [
            (one.output, one.axis or None, one.command, f"{one.wait_s:.0f} s" if one.wait_s else "none", one.shown,
             f"{one.expected_um:+g}".replace("-", "−"), "", "☐ yes ☐ no", "")
            for one in test.commanded
        ],
    )  # fmt: skip
    return (
        account.Paragraph(f"{test.by} For every axis, with the tool at rest, away from the workpiece:"),
        account.Items(told, are_steps=True),
        account.Form(form),
        account.Paragraph(
            account.legend("commissioning.in-doubt") + (account.legend("commissioning.too-quick") if too_quick else "")
        ),
    )


def _install_blocks(program: Exported) -> tuple[account.Block, ...]:
    files = "Files: " + ", ".join(f"`{file}`" for file in program.files) + ". This is not a safety function."
    return account.Paragraph(files), account.Items(tuple(f"☐ {step}" for step in program.install), are_steps=True)


def _wiring_blocks(model: ModelFile, target: Target) -> tuple[account.Block, ...]:
    turned = _turned(model)
    but = f", but of {turned} the displacement itself" if turned else ""
    return (
        account.Captioned("", sensors_table(model, has_guard=target.has_guard), on_screen=False),
        account.Heading("Formula", 3),
        *formula_blocks(model),
        account.Paragraph(f"These are displacements. The correction is their negative{but}."),
    )


def _touch_offs(model: ModelFile) -> tuple[account.Section, ...]:
    """How the machine keeps the model true; none where nothing is adapted."""
    if model.adaptation is None:
        return ()
    names = [output.name for output in model.outputs]
    inputs = ", ".join(f"`touch_um_{names.index(of.output) + 1}` ({of.output})" for of in model.adaptation.outputs)
    told = account.steps("commissioning.touch-offs", inputs=inputs)
    return (account.Section("touch-offs", "Touch-offs", (account.Items(told, are_steps=True),)),)


def _limits(model: ModelFile, target: Target) -> account.Block:
    if target.has_guard:
        return account.Captioned("", limits_table(model), on_screen=False)
    return account.Paragraph(account.legend("commissioning.no-limits"))


def _replay_blocks(model: ModelFile, replay: Replay | None) -> tuple[account.Block, ...]:
    if replay is None:
        return (account.Paragraph(account.legend("commissioning.to-replay")),)
    return (
        account.Paragraph(verdict_of(replay)),
        account.Captioned("", replay_table(replay)),
        *(account.Captioned("Faults rehearsed", rehearsal_table(replay)) for _ in replay.rehearsal[:1]),
        *_courses(model, replay),
    )


def verdict_of(replay: Replay) -> str:
    """The result of a replay in a sentence."""
    largest = replay.max_abs_difference_um
    told = "not at all: every bit is the same" if largest == 0.0 else f"by {number_text(largest)} µm at most"
    return (
        f"{replay.rows} recorded samples went through the generated program ({replay.executed_by}) and through the "
        f"reference: they differ {told}."
    )


def _beginnings(replay: Replay) -> list[str]:
    """How long nothing was corrected at the start of the runs; nothing where the control does not wait."""
    waited = [run.begins_s for run in replay.runs if run.begins_s > 0.0]
    if not waited:
        return []
    shortest, longest = f"{min(waited):.0f}", f"{max(waited):.0f}"
    first = longest if shortest == longest else f"{shortest} … {longest}"
    return [
        f"No correction in the first {first} s of a run: readings have to be good for some time first, in "
        f"{LEAST_GOOD_SAMPLES} samples or more, and the correction then grows at its slew limit; the largest errors "
        "may be from there. A control that has run for some time is past this."
    ]


def replay_table(replay: Replay) -> account.Table:
    """One row per run and output."""
    rows = []
    for run in replay.runs:
        for name, of in run.accuracy.items():
            alone = run.applied[name].rmse_um if name in run.applied else None
            errors = (run.max_abs_difference_um, of.before_rmse_um, alone, of.rmse_um, of.max_um)
            rows.append((run.run, name, str(len(run.time_s)), *errors, share_text(run.faulty_share)))
    return account.table(
        ["run", "output", ">samples", ">program − reference [µm]", ">without correction: rms [µm]",
         ">apply: rms [µm]", ">with correction: rms [µm]", ">with correction: largest [µm]", ">not the whole model"],
        rows,
        " ".join([account.legend("commissioning.before-and-after"), *_beginnings(replay)]),
    )  # fmt: skip


def parts_table(replay: Replay) -> account.Table:
    """One row per written file and output."""
    rows = []
    for part in replay.parts:
        smaller_guard = part.guard_difference_um if part.lacks else 0.0
        differences = (part.max_abs_difference_um, part.allowed_um, smaller_guard)
        rows.append((part.file, part.output, *differences, part.executed_by))
    return account.table(
        ["file", "output", ">largest difference [µm]", ">allowed [µm]", ">smaller guard [µm]", "executed by"],
        rows,
        account.legend("commissioning.differences"),
    )


def rehearsal_table(replay: Replay) -> account.Table:
    """One row per rehearsed fault and output."""
    first, rows = replay.rehearsal[0], []
    for one in replay.rehearsal:
        errors = (one.healthy_rmse_um, one.left.rmse_um, one.left.max_um)
        reacts = "never noticed" if one.reacts_after_s is None else f"{one.reacts_after_s:.0f}"
        rows.append((one.sensor or "control", one.fault, one.output, *errors, one.mode or None, reacts))
    return account.table(
        ["what fails", "how", "output", ">without the fault: rms [µm]", ">left: rms [µm]", ">left: largest [µm]",
         "it follows", ">reacts after [s]"],
        rows,
        f"Faults rehearsed on run {first.run}, each from {first.from_s:.0f} s to its end: dead, no reading; stuck, the "
        f"last reading; jumping, by {100 * JUMP_SHARE:.0f} % of the valid range; noisy, by {100 * NOISE_SHARE:.0f} % "
        f"of it; power cycle and stop of {OUTAGE_S:.0f} s; the clock put by {CLOCK_S:.0f} s.",
    )  # fmt: skip


def _courses(model: ModelFile, replay: Replay) -> Iterator[account.Drawing]:
    for run in replay.runs[:MOST_RUNS_DRAWN]:
        for k, output in enumerate(model.outputs):
            recorded = run.recorded_um[:, k]
            text = "" if np.isfinite(recorded).any() else "This run has no recorded displacement."
            # as seen at the tool, whatever way the control counts
            seen = -run.correction_um[:, k] if is_turned(output) else run.correction_um[:, k]
            yield account.Drawing(replayed_run(run.run, output.name, run.time_s, seen, recorded), text)
