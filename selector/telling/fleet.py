"""What is told of a fleet: every machine in a row, the worst first, and which sensors are chosen how often."""

import math
from collections import Counter
from collections.abc import Sequence

from selector.fleet import Answer, FleetAnswer, FleetWatch, SistersAnswer
from selector.number_text import number_text
from selector.telling.account import Account, Captioned, Table, section, sections, table
from selector.telling.numbers import NONE


def fleet_account(answer: FleetAnswer, missing: Sequence[str] = (), *, title: str = "Fleet") -> Account:
    """All that is told of a fleet; `missing` are machines that have no answer yet."""
    failed = [name for name, one in answer.machines.items() if one.status == "failed"]
    n, right = len(answer.machines) + len(missing), answer.done + answer.reused
    again = f", {answer.reused} of them from an earlier run" if answer.reused else ""
    sentences = [f"{right} of {_machines(n)} {'has' if right == 1 else 'have'} a model{again}."]
    absent = [name for name, one in answer.machines.items() if one.status == "missing"]
    tried = [one.refit.promoted for one in answer.machines.values() if one.refit is not None]
    if tried:
        sentences.append(f"{sum(tried)} of {len(tried)} models in use gave way to a better one.")
    if failed:
        sentences.append(f"{_machines(len(failed))} failed; the reason stands beside each.")
    if absent:
        sentences.append(f"{_machines(len(absent))} not found: {', '.join(absent)}. The model of each stays in use.")
    if missing:
        sentences.append(f"{_machines(len(missing))} had no turn yet: `selector fleet run` goes on from here.")
    return Account(
        title=title,
        verdict="bad" if failed or absent else "good" if not missing else "plain",
        sentences=tuple(sentences),
        sections=sections(
            section("machines", "Machines, the worst first", Captioned("", _table(answer, missing)), link="Machines"),
            section("sensors", "Sensors over the fleet", *_sensors(answer), link="Sensors"),
        ),
        data=answer.model_dump(by_alias=True),
    )


def watch_account(watch: FleetWatch, *, title: str = "Fleet") -> Account:
    """All that is told of the watch over a fleet, alarms first."""
    counts = Counter(one.status for one in watch.machines.values())
    sentences = [
        f"{_machines(len(watch.machines))}: " + ", ".join(f"{n} {_STATES[s]}" for s, n in counts.items()) + "."
    ]
    if watch.alarms:
        sentences.append(f"Look at {', '.join(name for name, one in watch.machines.items() if one.status == 'alarm')}.")
    return Account(
        title=f"{title}: are the models still true?",
        verdict="bad" if watch.alarms or counts["failed"] else "good" if counts["quiet"] else "plain",
        sentences=tuple(sentences),
        sections=sections(
            section("machines", "Errors in recordings that came later", Captioned("", _watched(watch)), link="Errors"),
            section("readings", "What else was found in them", *_readings(watch), link="Readings"),
        ),
        data=watch.model_dump(by_alias=True),
    )


def sisters_account(answer: SistersAnswer, *, title: str = "Fleet") -> Account:
    """All that is told of the sisters of a machine: whether they are any, and how far each way is off."""
    sentences = [f"{'Sisters are none' if answer.verdict == 'none' else 'Its sisters help'}: {answer.because}."]
    if answer.shape is not None:
        sentences.append(f"All machines on {', '.join(answer.sensors)}, {answer.shape}.")
    rows: list[tuple[str, ...]] = []
    for name, one in answer.responses.items():
        if len(one.types) > 1:
            groups = " and ".join(f"[{', '.join(of)}]" for of in one.types)
            sentences.append(f"{name}: the others fall into two groups, {groups}: try a fleet file for each.")
        if one.alone:
            sentences.append(f"{name}: unlike all others, and not learnt from: {', '.join(one.alone)}.")
        if one.errors:
            errors = (_error(one.errors[f"{way}_um"]) for way in ("none", "own", "pooled", "sisters"))
            rows.append((name, f"{one.errors['machines']:.0f}", *errors))
    head = (">machines", ">no correction [µm]", ">these runs alone [µm]", ">all as one [µm]", ">sisters [µm]")
    note = (
        "Root mean square error in the later runs of machines that were left out in turn, with as many known runs. "
        "Alone: what `select` makes of these. All as one: one regression on the runs of all machines."
    )
    others = table(("machine", "reason"), list(answer.left_out.items()))
    return Account(
        title=f"{title}: what its sisters tell of {answer.machine}",
        verdict="plain" if answer.verdict == "none" else "good",
        sentences=tuple(sentences),
        sections=sections(
            section("errors", "Errors", Captioned("", table(("response", *head), rows, note)), link="Errors"),
            section("left-out", "Machines that are no sisters", Captioned("", others), link="Left out"),
        ),
        data=answer.model_dump(by_alias=True),
    )


_STATES = {
    "alarm": "no longer as it was",
    "quiet": "as before",
    "nothing-new": "without a new recording",
    "not-judged": "not judged",
    "no-model": "without a model",
    "failed": "failed",
}
_UNWELL = ("failed", "missing")
_CHANGED = {"mean": "the error has shifted", "spread": "the errors have grown"}


def _watched(watch: FleetWatch) -> Table:
    ordered = sorted(watch.machines.items(), key=lambda item: list(_STATES).index(item[1].status))
    rows: list[tuple[str, ...]] = []
    marked = []
    for name, one in ordered:
        told = one.responses.items() if one.status in ("alarm", "quiet") else ()
        if not told:
            rows.append((name, _STATES[one.status], *(NONE,) * 6, one.error or ""))
        for response, of in told:
            marked += [len(rows)] if of.alarm else []
            judged = (
                NONE if of.highest is None else f"{number_text(of.highest, 2)} of {number_text(of.limit or 0.0, 2)}"
            )
            what = "" if of.alarm is None else f"{_CHANGED[of.alarm]} since {of.since}"
            errors = (_error(value) for value in (of.rmse_um, of.expected_um, of.mean_um))
            rows.append((name, _STATES[one.status], response, str(of.runs), *errors, judged, what))
    head = (">runs", ">RMS error [µm]", ">when it was made [µm]", ">mean error [µm]", ">sum")
    note = (
        "Root mean square error in the new runs beside that on unseen runs when the model was made; mean of recorded "
        "minus predicted, since the change where there is one. Sum: cumulative deviation of the runs, and its limit."
    )
    return table(("machine", "status", "response", *head, "what has changed"), rows, note, marked=marked)


def _readings(watch: FleetWatch) -> list[Captioned]:
    rows = []
    for name, one in watch.machines.items():
        gravest = sorted(one.findings, key=lambda finding: finding["level"] != "error")[:1]
        rows += [(name, finding["statement"], str(len(one.findings))) for finding in gravest]
    note = "The gravest finding of each machine; --json has all."
    return [Captioned("", table(("machine", "what", ">findings"), rows, note))] if rows else []


def _machines(n: int) -> str:
    return f"{n} machine{'s' * (n != 1)}"


def _table(answer: FleetAnswer, missing: Sequence[str]) -> Table:
    responses = list(dict.fromkeys(name for one in answer.machines.values() for name in one.heldout_rmse_um))

    def rank(item: tuple[str, Answer]) -> tuple[bool, float]:
        return item[1].status not in _UNWELL, -max((e for e in item[1].heldout_rmse_um.values() if e), default=math.inf)

    ordered = sorted(answer.machines.items(), key=rank)
    rows = [
        (
            name,
            one.status,
            *(_error(one.heldout_rmse_um.get(response)) for response in responses),
            ", ".join(one.sensors) or NONE,
            f"{one.seconds:.1f}",
            one.error or ("" if one.refit is None else f"{one.outcome}: {one.refit.because}"),
        )
        for name, one in ordered
    ]
    rows += [(name, "no turn yet", *(NONE for _ in responses), NONE, NONE, "") for name in missing]
    return table(
        ("machine", "status", *(f">{name}, unseen [µm]" for name in responses), "sensors", ">seconds", "reason"),
        rows,
        "Failed ones first, then by the largest root mean square error on unseen runs. An answer lies in the folder "
        "that is called by its key.",
        marked=[i for i, (_, one) in enumerate(ordered) if one.status in _UNWELL],
    )


def _sensors(answer: FleetAnswer) -> list[Captioned]:
    models = [one for one in answer.machines.values() if one.sensors]
    counts = Counter(name for one in models for name in one.sensors)
    if not counts:
        return []
    rows = [
        (name, str(count), f"{100 * count / len(models):.0f} %")
        for name, count in sorted(counts.items(), key=lambda item: -item[1])
    ]
    note = "Chosen on so many of the machines that have a model; sensors of one name are taken for the same place."
    return [Captioned("How often each sensor is chosen", table(("sensor", ">machines", ">share"), rows, note))]


def _error(error: float | None) -> str:
    return NONE if error is None else number_text(error, 3)
