"""What is told of a diagnosis: first the answer and what to do, then where, how much better, why, what it misses."""

import re
from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from typing import Any

from selector.diagnosis.answer import Diagnosis, Errors, Fit, NamedEffect, recalibration_of
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.shown_units import displayed, p_words, unit_words
from selector.diagnosis.wording import amount, headline, name_of, sure_words, suspicion_words, what_to_do
from selector.number_text import listed, number_text, span_text
from selector.telling import account, origin
from selector.telling.numbers import NONE, share_text
from selector.telling.origin import label_text

MOST_PLACES = 60
UNTESTED = "not testable here"
_STATE_WITHOUT_UNIT = re.compile(r"(?<=\d) 1$")
Drawings = Mapping[str, Sequence[account.Block]]  #: Section of an account → its drawings; empty unless a page is made.


def diagnosis_account(
    found: Diagnosis,
    *,
    description: Mapping[str, Any] | None = None,
    provenance: Mapping[str, Any] | None = None,
    drawn: bool = False,
    is_alone: bool = False,
) -> account.Account:
    """What is told of a diagnosis: the answer and what to do, where, how much better, why, and what it misses.

    `description`: how the recordings were read, as `selector describe` says it; `provenance`: the ``machine``, file and
    SHA-256 of the ``runs``, further facts as they are. `drawn`: for a page; `is_alone`: read from its JSON, without its
    recordings, which a page has to say.
    """
    told, described = provenance or {}, description or {}
    drawings = _drawings(found) if drawn and not is_alone else {}
    machine = told.get("machine")
    answer, steps = found.headline or headline(found), what_to_do(found)
    for step in steps:
        # the run that would tell is told once, as something to do
        answer = answer.replace(f" To tell them apart: {step.partition(': ')[2]}", "")
    fault = "What is at fault" if found.verdict == "data-fault" else "What was left out"
    return account.Account(
        ": ".join(["What the simulation left out", *([str(machine)] if machine else [])]),
        (answer, *steps),
        account.sections(
            account.section(
                "left-out",
                "What this page leaves out",
                account.Paragraph(account.legend("diagnosed.left-out")) if is_alone else None,
                link="Left out",
            ),
            account.warnings_section(found.findings),
            account.section("where", "Where", *drawings.get("where", ()), account.captioned("Windows", _places(found))),
            account.section("effects", fault, *(block for effect in found.effects for block in _effect(found, effect))),
            _also_seen(found),
            account.section(
                "better",
                "How much better it gets" if found.effects else "Recorded and simulated",
                *drawings.get("better", ()),
                account.captioned("Root mean square errors", _errors(found)),
                link="How much better" if found.effects else "",
            ),
            account.section(
                "changes",
                "What the simulation itself would have to change",
                account.captioned("", _recalibration(found)),
                link="Changes",
            ),
            account.section(
                "evidence",
                "Why: the evidence",
                account.captioned("Effects that were tested", _tested(found), on_screen=False),
                account.captioned("Not testable with this record", _untested(found), on_screen=False),
                link="Evidence",
            ),
            account.section(
                "apart",
                "What this record cannot tell apart",
                account.captioned("Runs that would tell", _next(found)),
                link="What cannot be told apart",
            ),
            account.section(
                "detectability",
                "What this record would have missed",
                account.captioned("", _detectable(found), on_screen=False),
                link="Detectability",
            ),
            account.findings_section(found.findings),
            account.section("origin", "Origin", *origin.origin_parts(described, {**told, "seed": found.seed})),
        ),
        label=label_text("the recordings", "", told, described),
        verdict="good" if found.verdict == "nothing-missing" else "bad",
        data=found.as_dict(),
        brief=("effects", "better"),
        footer=f"The same {'result gives' if is_alone else 'files and options give'} the same bytes.",
        about="made from the result alone" if is_alone else f"verdict: {found.verdict}",
    )


def _drawings(found: Diagnosis) -> Drawings:
    from selector.figures.diagnosis import before_after, mismatch_map

    courses = [before_after(found, name) for name in found.fit]
    return {
        "where": [account.Drawing(mismatch_map(found), account.legend("diagnosed.map"))] if found.fit else [],
        "better": [
            account.Drawing(one, "" if k else account.legend("diagnosed.before-after")) for k, one in enumerate(courses)
        ],
    }


def _also_seen(found: Diagnosis) -> account.Section | None:
    rows = [
        [name_of(one.id), one.channel, share_text(one.share), sure_words(one.confidence), unit_words(one.statement)]
        for one in found.also_seen
    ]
    told = account.table(
        ["effect", "response", ">share of the mismatch", "how sure", "what it would be"],
        rows,
        account.legend("diagnosed.also"),
    )
    return account.section("also-seen", "Also seen", account.captioned("", told))


def _places(found: Diagnosis) -> account.Table:
    places = sorted(found.where, key=lambda place: -place.share)
    left = len(places) - MOST_PLACES
    note = f"{left} smaller windows are in diagnosis.json." if left > 0 else ""
    rows = []
    for place in places[:MOST_PLACES]:
        times = [NONE if time is None else span_text(time) for time in (place.from_s, place.to_s)]
        state = _STATE_WITHOUT_UNIT.sub("", unit_words(place.regime or NONE))
        cells = [place.channel, place.place or NONE, place.run or "all", *times, state]
        rows.append([*cells, share_text(place.share)])
    return account.table(["channel", "place", "run", ">from", ">to", "state of the machine", ">share"], rows, note)


def _effect(found: Diagnosis, effect: NamedEffect) -> Iterator[account.Block]:
    name, known = name_of(effect.id), next((one for one in catalogue() if one.id == effect.id), None)
    sure = f"{sure_words(effect.confidence)}, {p_words(effect.p_value, 'p = ')}"
    told = [sure, f"{share_text(effect.share)} of the mismatch"]
    if effect.suspected:
        told.append(f"suspected: {suspicion_words(found, effect)}")
    seen = listed(list(effect.channels or (effect.channel,))) + (f", at {effect.place}" if effect.place else "")
    yield account.Heading(f"{name[:1].upper()}{name[1:]}", 3, on_screen=True)
    yield account.Paragraph(effect.statement, on_screen=True)
    yield account.Note(f"{'; '.join(told)}. Seen in {seen}.", on_screen=True)
    if effect.parameters:
        meanings = {one.name: one.meaning for one in known.parameters} if known else {}
        # what was put into a model file has the names of its keys
        shown = [name for name in effect.parameters if name in meanings] or effect.parameters
        rows = [[meanings.get(name, name), _quantity_text(effect.parameters[name])] for name in shown]
        yield account.Captioned("", account.table(["parameter", ">value (95 % interval)"], rows))
    alike = listed([name_of(id_) for id_ in effect.cannot_be_told_from], "or")
    if alike:
        yield account.Paragraph("The run that would tell stands above.", f"This record cannot tell it from {alike}.")
    if known is not None and known.physics:
        refuted = known.refuted_by.rstrip(".")
        yield account.Note(f"{known.physics} What would refute it: {refuted}. Source: {known.reference}")


def _quantity_text(of: Quantity) -> str:
    """A quantity with its interval; times as people say them."""
    if of.unit != "s" or of.low is None or of.high is None:
        return span_text(of.value) if of.unit == "s" else of.words()
    ends = f"at least {span_text(of.low)}" if not isfinite(of.high) else f"{span_text(of.low)} to {span_text(of.high)}"
    return f"{span_text(of.value)} ({ends})"


def _errors(found: Diagnosis) -> account.Table:
    rows = [row for name, fit in found.fit.items() for row in _error_rows(name, fit)]
    headings = ["response", "rows", ">as simulated", ">recalibrated", ">with what was found", ">noise"]
    note = "Placebos are wrong effects of the same size: what they close is what chance closes."
    closed = [">share of the gap closed", ">closed by placebos"]
    return account.table([*headings, *closed], rows, note)


def _error_rows(name: str, fit: Fit) -> list[list[str]]:
    def cells(errors: Errors, recalibrated: float | None) -> list[str]:
        shown = (errors.rmse_before, recalibrated, errors.rmse_after, errors.noise_floor)
        return [NONE if value is None or not isfinite(value) else amount(value, fit.unit) for value in shown]

    shares = [NONE if one is None else _share(one) for one in (fit.gap_closed, fit.placebo_gain)]
    return [
        [name, "held out", *cells(fit.heldout, fit.recalibrated_heldout), *shares],
        [name, "fitted", *cells(fit.train, None), NONE, NONE],
    ]


def _share(of: Quantity) -> str:
    if of.low is None or of.high is None:
        return share_text(of.value)
    return f"{share_text(of.value)} ({100 * of.low:.0f} to {100 * of.high:.0f})".replace("-", "−")


def _recalibration(found: Diagnosis) -> account.Table:
    rows = [
        [response, name, quantity.words()]
        for response, quantities in found.recalibration.items()
        for name, quantity in recalibration_of(quantities).items()
    ]
    return account.table(["response", "of the simulation", ">should be (95 % interval)"], rows)


def _tested(found: Diagnosis) -> account.Table:
    tested = [one for one in found.evidence if not one.note.startswith(UNTESTED)]
    tested.sort(key=lambda one: (not one.named, -one.gain))
    rows = []
    for one in tested:
        cells = [number_text(one.gain), p_words(one.p_value)]
        rows.append([name_of(one.id), one.channel, *cells, "named" if one.named else one.note or "not named"])
    marked = [k for k, one in enumerate(tested) if one.named]
    headings = ["effect", "response", ">gain", ">p", "what came of it"]
    return account.table(headings, rows, marked=marked)


def _untested(found: Diagnosis) -> account.Table:
    by_reason: dict[tuple[str, str], list[str]] = {}
    for one in found.evidence:
        if one.note.startswith(UNTESTED):
            by_reason.setdefault((one.note.removeprefix(UNTESTED).lstrip(" :"), one.id), []).append(one.channel)
    effects: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for (reason, id_), channels in by_reason.items():
        effects.setdefault((reason, tuple(channels)), []).append(name_of(id_))
    rows = [[reason, ", ".join(ids), listed(channels)] for (reason, channels), ids in effects.items()]
    return account.table(["why not", "effects", "response"], rows)


def _next(found: Diagnosis) -> account.Table:
    rows = []
    for run in found.next_runs:
        chance = NONE if run.power is None else share_text(run.power)
        pair = listed([name_of(id_) for id_ in run.separates])
        rows.append([run.description, pair, chance, span_text(run.duration_s)])
    return account.table(["run", "tells apart", ">chance", ">takes"], rows)


def _detectable(found: Diagnosis) -> account.Table:
    rows = [
        [name_of(one.id), one.channel, amount(one.size, one.unit), share_text(one.chance), one.note]
        for one in found.detectable
    ]
    units = listed(sorted({displayed(one.unit, one.size)[1] for one in found.detectable}))
    headings = ["effect", "response", ">smallest size", ">found in", "remark"]
    return account.table(
        headings,
        rows,
        f"Sizes are rms of the course [{units}]. What is smaller may be there without being seen in this record.",
    )
