"""What is told of a prediction: which corrections to make when, then why, then everything."""

import math
from collections.abc import Mapping
from itertools import dropwhile, groupby
from typing import Any

import numpy as np

from selector.number_text import listed, number_text, span_text
from selector.physics.thermal.prediction import correction_program
from selector.physics.thermal.prediction.observer import Observed
from selector.physics.thermal.prediction.prediction import Prediction
from selector.telling import account, origin
from selector.telling.numbers import given_text
from selector.telling.origin import label_text

MOST_TOLD = 8  #: Corrections that a sentence can hold; more are in the table.
MOST_ROWS = 400
MOST_TESTS = 12
MOMENTS, MOST_CHANGES = 9, 12  #: Moments at which the displacement is told, and changes of speed at which it is too.


def prediction_account(
    prediction: Prediction, description: Mapping[str, Any] | None = None,
    provenance: Mapping[str, Any] | None = None, *, drawn: bool = False,
) -> account.Account:  # fmt: skip
    """All that is told of a prediction.

    A prediction that was read from its JSON has no duty cycle; what it lacks is left out, and told. `description` says
    how the tests were read, as `selector describe` does; `provenance` has ``machine``: its name, ``runs``: file and
    SHA-256 of every run, and further facts, which are shown as they are. A page is `drawn`, with its drawings.
    """
    described, provenance, cyclogram = description or {}, provenance or {}, prediction.cyclogram
    drawings = _drawings(prediction) if drawn else {}
    verdict, sentences = prediction_advice(prediction)
    if prediction.warm_up is not None:
        sentences = (*sentences, warm_up_sentence(prediction.warm_up))
    if prediction.order is not None:
        sentences = (*sentences, order_sentence(prediction.order))
    if prediction.observed is not None:
        sentences = (day_sentence(prediction, prediction.observed), *sentences)
    if cyclogram is None and prediction.heldout_um is None:
        verdict = "plain"
    course, seen = account.Captioned("Predicted displacement", _course_table(prediction)), prediction.observed
    day = None if seen is None else account.Captioned("By the readings of the day", _day_table(prediction, seen))
    lacks = (
        None if prediction.repeats or not cyclogram else account.Paragraph("No test can be repeated by this method.")
    )
    errors = account.Captioned("Errors", _accuracy_table(prediction), on_screen=False)
    drift = account.captioned("", origin.drift_table(described), on_screen=False)
    return account.Account(
        title=": ".join(filter(None, ["Duty cycle", str(provenance.get("machine") or "")])),
        about=f"{prediction.method} method" + ("" if cyclogram else " · made from the result alone"),
        label=label_text("the tests", "", provenance, described),
        verdict=verdict,
        sentences=sentences,
        sections=account.sections(
            None
            if cyclogram
            else account.section(
                "left-out",
                "What this page leaves out",
                account.Paragraph(account.legend("predicted.left-out")),
                link="Left out",
            ),
            account.warnings_section(prediction.findings),
            account.section("cycle", "The duty cycle", *drawings.get("cycle", ()), course, day, link="Duty cycle"),
            account.section("program", "The correction program", *_program(prediction), link="Program"),
            account.section(
                "tests", "Why: what the tests say", *drawings.get("tests", ()), lacks, errors, link="Tests"
            ),
            account.section(
                "modes", "The thermal modes", account.captioned("", _modes_table(prediction)), link="Modes"
            ),
            account.section("drift", "Drift of the tests after ISO 230-3", drift, link="Drift"),
            account.findings_section(prediction.findings),
            account.section("origin", "Origin", *origin.origin_parts(described, provenance)),
        ),
        data=prediction.as_dict(),
        brief=("program",) if prediction.programs else None,
        footer="The same tests and options give the same bytes.",
    )


def prediction_advice(prediction: Prediction) -> tuple[account.Verdict, tuple[str, ...]]:
    """What to correct when."""
    if not prediction.programs:
        moves = [_moves(prediction, prediction.responses.index(name)) for name in _told(prediction)]
        return "good", (f"Expect {listed(moves)}.", _trust(prediction), account.legend("predicted.ask"))
    doubtful = prediction.doubtful
    useful = [name for name in prediction.programs if name not in doubtful]
    allowed = [listed([f"{one:g}" for one in program.tolerances_um]) for program in prediction.programs.values()]
    told = listed(list(dict.fromkeys(allowed)))
    if not useful:
        first = f"Do not use this program: the prediction of {listed(doubtful)} is not good enough for {told} µm."
        return "bad", (first, _trust(prediction), account.legend("predicted.sign"))
    corrected = any(len(one.times_s) > 1 for name in useful for one in prediction.programs[name].operations)
    ends = f"; the drift then stays within {told} µm" if corrected else ""
    first = "; ".join(_instruction(prediction, name) for name in useful) + ends + "."
    first = first[0].upper() + first[1:] if first.startswith("correct ") else first
    if doubtful:
        warning = f"Do not correct {listed(doubtful)}: the prediction is not good enough for {told} µm. "
        return "bad", (warning + first, _trust(prediction), account.legend("predicted.sign"))
    return "good", (first, _trust(prediction), account.legend("predicted.sign"))


def warm_up_sentence(found: correction_program.BestWarmUp) -> str:
    """Whether a warm-up leaves fewer corrections."""
    if found.corrections == found.without:
        return f"No warm-up of {found.tried} that were tried saves a correction."
    would = "no correction is" if found.corrections == 0 else f"{found.corrections} corrections are"
    return f"After {found.minutes:g} min at {found.speed_rpm:g} r/min {would} left of {found.without}."


def order_sentence(found: correction_program.BestOrder) -> str:
    """Whether another order of the operations needs fewer corrections."""
    tried = f"of {'all ' if found.is_exact else ''}{found.tried} orders that were tried"
    if found.corrections == found.as_given:
        return f"No other order of the operations needs fewer corrections, {tried}."
    order = ", ".join(map(str, found.operations))
    would = "none would" if found.corrections == 0 else f"{found.corrections} corrections would"
    return f"In the order {order} {would} do instead of {found.as_given}, {tried}."


def day_sentence(prediction: Prediction, seen: Observed) -> str:
    """What the readings of the day say of the spindle, and where the displacements are now."""
    stood = [
        f"from {one.from_s / 60:.0f} min on" if one.to_s is None
        else f"from {one.from_s / 60:.0f} to {one.to_s / 60:.0f} min" + ", then the plan went on later" * one.delays
        for one in seen.stops
    ]  # fmt: skip
    who = f"By the readings of {listed(list(seen.thermometers))}"
    if seen.explains_nothing:
        return f"{who}, the day was neither as planned nor the plan with stops: do not correct by them."
    said = f"the spindle stood {listed(stood)}" if stood else "no unplanned stop is seen"
    now = []
    for name in _told(prediction):
        r = prediction.responses.index(name)
        at = float(np.interp(seen.read_until_s, seen.time_s, seen.displacement_um[:, r]))
        plan = float(np.interp(seen.read_until_s, prediction.time_s, prediction.displacement_um[:, r]))
        planned = f", not at {number_text(plan)}" if stood else ""
        now.append(f"{name} is at {number_text(at)} {prediction.unit(name)}{planned}")
    moment = span_text(seen.read_until_s)
    return f"{who}, {said}: after {moment}, {listed(now)}."


def _day_table(prediction: Prediction, seen: Observed) -> account.Table:
    """Displacements by the plan alone and by the readings, at some moments, to the last reading and beyond."""
    times_s = np.unique(np.r_[np.linspace(0.0, float(seen.time_s[-1]), MOMENTS), seen.read_until_s])
    headings, columns = [], []
    for r, name in enumerate(prediction.responses):
        if name not in seen.thermometers:
            unit = prediction.unit(name)
            headings += [f">{name} by the plan [{unit}]", f">by the readings [{unit}]"]
            columns.append(np.interp(times_s, prediction.time_s, prediction.displacement_um[:, r]))
            columns.append(np.interp(times_s, seen.time_s, seen.displacement_um[:, r]))
    rows = [
        (given_text(time_s / 60), *(f"{um:.1f}".replace("-", "−") for um in at))
        for time_s, *at in zip(times_s.tolist(), *columns, strict=True)
    ]
    note = f"The last reading is at {seen.read_until_s / 60:.3g} min; what follows is foreseen."
    for name, (plan, observed) in seen.errors_um.items():
        note += f" {name} was measured on that day: the plan was off by {number_text(plan, 2)}, this by "
        note += f"{number_text(observed, 2)} {prediction.unit(name)} (root mean square)."
    return account.table([">at [min]", *headings], rows, note)


def _instruction(prediction: Prediction, name: str) -> str:
    program = prediction.programs[name]
    counts = [len(operation.times_s) - 1 for operation in program.operations]
    total = sum(counts)
    if total == 0:
        _, left = program.drift_left_um(
            prediction.time_s, prediction.displacement_um[:, prediction.responses.index(name)]
        )
        largest = number_text(float(np.abs(left).max()), 2)
        within = " within an operation" if len(program.operations) > 1 else ""
        return f"{name} needs no correction, it drifts by at most {largest} µm{within}"
    if total > MOST_TOLD:
        return f"correct {name} {total} times as the program says, {_beginning(program)}"
    parts = [
        f"{_times(count)} in operation {number} ({_amounts(operation)})"
        if len(counts) > 1
        else f"{_times(count)}: {_amounts(operation)}"
        for number, (count, operation) in enumerate(zip(counts, program.operations, strict=True), start=1)
        if count
    ]
    return f"correct {name} {listed(parts)}"


def _beginning(program: correction_program.CorrectionProgram) -> str:
    number, operation = next((k, one) for k, one in enumerate(program.operations, start=1) if len(one.times_s) > 1)
    after_s = float(operation.times_s[1]) - operation.start_s
    where = f" of operation {number}" if len(program.operations) > 1 else ""
    return f"first by {number_text(float(operation.corrections_um[1]))} µm after {_down(after_s):g} min{where}"


def _amounts(operation: correction_program.Operation) -> str:
    """By 10 µm after 18 and 45 min; amounts that are the same once."""
    steps = zip(
        operation.corrections_um[1:].tolist(), (operation.times_s[1:] - operation.start_s).tolist(), strict=True
    )
    told = [
        f"{amount} µm after {listed([f'{_down(time_s):g}' for _, time_s in group])} min"
        for amount, group in groupby(steps, key=lambda step: f"{step[0]:.3g}".replace("-", "−"))
    ]
    return "by " + ", ".join(told)


def _told(prediction: Prediction) -> list[str]:
    """The responses but the thermometers that the day is observed by."""
    beside = () if prediction.observed is None else prediction.observed.thermometers
    return [name for name in prediction.responses if name not in beside]


def _moves(prediction: Prediction, r: int) -> str:
    name, course = prediction.responses[r], prediction.displacement_um[:, r]
    k = int(np.argmax(np.abs(course)))
    moved = f"{number_text(float(course[k]))} {prediction.unit(name)}"
    return f"{name} to move by up to {moved}, after {span_text(float(prediction.time_s[k]))}"


def _trust(prediction: Prediction) -> str:
    """How good the prediction was where that could be seen."""
    names = _told(prediction)
    errors = [f"{number_text(prediction.error_um(name), 2)} {prediction.unit(name)} in {name}" for name in names]
    if prediction.left_out_um:
        seen = (
            f"Expect the prediction to be off by {listed(errors)} (root mean square): what the tests leave open, times "
            f"how much more those that were left out were off{_known(prediction)}"
        )
    elif prediction.claim_factor is not None:
        seen = (
            f"Expect the prediction to be off by {listed(errors)} (root mean square), as tests from cold were that "
            f"were left out and predicted by the others{_known(prediction)}"
        )
    elif prediction.heldout_um is not None:
        seen = f"On tests that were left out, the modes were off by {listed(errors)} (root mean square)"
    elif prediction.repeats:
        seen = f"The pieces of the measured characteristics repeat the tests to {listed(errors)} (root mean square)"
    elif prediction.cyclogram is None:
        return "How far off this method is on tests is not in the JSON of a prediction."
    else:
        return "There is no test on which the error of this prediction could be seen."
    return seen + (
        "; the true drift exceeds the tolerance by the error of the prediction." if prediction.programs else "."
    )


def _times(count: int) -> str:
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def _program(prediction: Prediction) -> list[account.Block]:
    if not prediction.programs:
        return []
    blocks = account.Listing(_blocks(prediction))
    return [
        account.Captioned("", _program_table(prediction)),
        account.Heading("Timed offset blocks", 3),
        account.Paragraph(account.legend("predicted.no-control")),
        blocks,
    ]


def _program_table(prediction: Prediction) -> account.Table:
    rows = [
        (name, str(number), f"{_down(time_s):.1f}", f"{_down(time_s - operation.start_s):.1f}",
         f"{_down(time_s + held_s) - _down(time_s):.1f}", "new zero" if k == 0 else float(step_um),
         float(offset_um), f"{offset_um / 1000:.4f}".replace("-", "−"))
        for name, program in prediction.programs.items()
        for number, operation in enumerate(program.operations, start=1)
        for k, (time_s, held_s, step_um, offset_um) in enumerate(
            zip(operation.times_s, operation.durations_s, operation.corrections_um, operation.offsets_um, strict=True)
        )
    ]  # fmt: skip
    headings = [
        "response", ">operation", ">at [min]", ">after the zero [min]", ">holds for [min]", ">step [µm]",
        ">offset [µm]", ">offset [mm]",
    ]  # fmt: skip
    more = f" {len(rows) - MOST_ROWS} more rows are in program.csv." if len(rows) > MOST_ROWS else ""
    note = "Step and offset are the displacement to be subtracted, counted as the gauge counted in the tests. "
    note += "Times are rounded down to 0.1 min, so corrections act up to 6 s early; the JSON form is exact." + more
    return account.table(headings, rows[:MOST_ROWS], note)


def _down(time_s: float) -> float:
    """Minutes, rounded down: a correction that is read from here is never late."""
    return math.floor(time_s / 6.0 + 1e-6) / 10.0


def _blocks(prediction: Prediction) -> str:
    """Timed offset blocks, the first of very many, without the rules, which the page says itself."""
    text = correction_program.program_blocks(prediction.programs, prediction.doubtful)
    lines = [*dropwhile(lambda line: not line.startswith("["), text.splitlines())]
    more = [f"; {len(lines) - MOST_ROWS} more lines are in program.txt"] if len(lines) > MOST_ROWS else []
    return "\n".join([*lines[:MOST_ROWS], *more]).strip()


def _course_table(prediction: Prediction) -> account.Table:
    """The displacement at some moments, also where the speed changes first."""
    end_s, cyclogram = float(prediction.time_s[-1]), prediction.cyclogram
    times_s = np.linspace(0.0, end_s, MOMENTS)
    speeds: list[tuple[str, ...]] = [() for _ in times_s]
    if cyclogram is not None:
        times_s = np.unique(np.r_[times_s, cyclogram.start_s[:MOST_CHANGES]])
        speeds = [(given_text(speed),) for speed in cyclogram.speed_at(times_s).tolist()]
    courses = [np.interp(times_s, prediction.time_s, course) for course in prediction.displacement_um.T]
    rows = [
        (given_text(time_s / 60), *speed, *(f"{um:.1f}".replace("-", "−") for um in at))
        for time_s, speed, *at in zip(times_s.tolist(), speeds, *courses, strict=True)
    ]
    return account.table([">at [min]", *([">speed [r/min]"] if cyclogram else []), *_headings(prediction)], rows)


def _headings(prediction: Prediction) -> list[str]:
    return [f">{name} [{prediction.unit(name)}]" for name in prediction.responses]


def _accuracy_table(prediction: Prediction) -> account.Table:
    columns = _headings(prediction)
    rows = [
        (label, *(number_text(float(value), 2) for value in values))
        for label, values in (
            ("tests that were fitted, means over some samples", prediction.residual_um),
            ("tests, or stretches of them, that were left out", prediction.heldout_um),
            *((f"{test}, left out", errors) for test, errors in prediction.left_out_um.items()),
            (f"claimed for this duty cycle{_known(prediction)}", prediction.claimed_um),
        )
        if values is not None
    ]
    rows += [
        (f"{one.run}, single samples", *(number_text(float(value), 2) for value in one.rmse_um))
        for one in prediction.repeats
    ]
    note = "Root mean squares of measured minus predicted. Single samples include the noise of the gauge."
    return account.table(["", *columns], rows, note)


def _known(prediction: Prediction) -> str:
    """How large an error may be beside its claim."""
    factor = prediction.claim_factor
    return "" if factor is None else f", and at most {factor:.2g} times that in 19 cases of 20"


def _modes_table(prediction: Prediction) -> account.Table:
    rows = [
        (str(number), *(None if end is None else end / 60 for end in (mode.tau_s, mode.low, mode.high)))
        for number, mode in enumerate(prediction.modes, start=1)
    ]
    return account.table(
        [">mode", ">time constant [min]", ">low, 95 % [min]", ">high, 95 % [min]"],
        rows,
        account.legend("predicted.modes"),
    )


def _drawings(prediction: Prediction) -> dict[str, list[account.Block]]:
    """Section of the account → its drawings."""
    from selector.figures.duty_cycle import duty_cycle

    names = prediction.responses
    return {
        "cycle": [
            account.Drawing(duty_cycle(prediction, name), "" if i else account.legend("predicted.course"))
            for i, name in enumerate(names)
        ],
        "tests": [_tests(prediction, name) for name in names] if prediction.repeats else [],
    }


def _tests(prediction: Prediction, response: str) -> account.Drawing:
    """All tests, or of many those that are repeated worst, in the order in which they were read."""
    from selector.figures.duty_cycle import prediction_of_tests

    r = prediction.responses.index(response)
    repeats = prediction.repeats
    ranked = sorted(range(len(repeats)), key=lambda k: -float(repeats[k].rmse_um[r]))[:MOST_TESTS]
    shown = tuple(repeats[k] for k in sorted(ranked))
    text = account.legend("predicted.tests")
    if len(shown) < len(repeats):
        text += f" Of {len(repeats)} tests, the {len(shown)} that are repeated worst are drawn."
    return account.Drawing(prediction_of_tests(prediction, response, shown), text)
