"""What is told of a fleet: every machine in a row, the worst first, and which sensors are chosen how often."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from selector.fleet import FleetAnswer, FleetWatch, Overview, SistersAnswer, WatchedMachine
from selector.number_text import listed, number_text
from selector.telling.account import Account, Captioned, Items, Table, captioned, legend, section, sections, table
from selector.telling.numbers import NONE


def fleet_account(
    answer: FleetAnswer, missing: Sequence[str] = (), *, title: str = "Fleet", beside: Overview | None = None
) -> Account:
    """All that is told of a fleet; `missing` are machines without an answer yet, `beside` what lies in its results."""
    failed = [name for name, one in answer.machines.items() if one.status == "failed"]
    n, right = len(answer.machines) + len(missing), answer.done + answer.reused
    earlier = answer.reused - len(answer.copies)
    again = f", {earlier} of them from an earlier run" if earlier else ""
    sentences = [f"{right} of {_machines(n)} {'has' if right == 1 else 'have'} a model{again}."]
    absent = [name for name, one in answer.machines.items() if one.status == "missing"]
    tried = [one.refit.promoted for one in answer.machines.values() if one.refit is not None]
    if tried:
        sentences.append(f"{sum(tried)} of {len(tried)} models in use gave way to a better one.")
    sentences += _shared(answer)
    if failed:
        sentences.append(f"{_machines(len(failed))} failed; the reason stands beside each.")
    if absent:
        sentences.append(f"{_machines(len(absent))} not found: {', '.join(absent)}. The model of each stays in use.")
    if missing:
        sentences.append(f"{_machines(len(missing))} had no turn yet: `selector fleet run` goes on from here.")
    machines = Captioned("", _table(answer, missing, beside or Overview()))
    to_do = None if beside is None else Items(tuple(_to_do(answer, missing, beside)))
    return Account(
        title=title,
        verdict="bad" if failed or absent else "good" if not missing else "plain",
        sentences=tuple(sentences),
        sections=sections(
            section("next", "What to do this week", to_do, link="This week"),
            section("machines", "Machines, the worst first", machines, link="Machines"),
            section("sensors", "Sensors over the fleet", _serving(beside), _sensors(answer), link="Sensors"),
        ),
        data=answer.model_dump(by_alias=True),
    )


def watch_account(watch: FleetWatch, *, title: str = "Fleet") -> Account:
    """All that is told of the watch over a fleet, alarms first."""
    counts = Counter(one.status for one in watch.machines.values())
    states = ", ".join(f"{n} {_STATES[status]}" for status, n in counts.items())
    sentences = [f"{_machines(len(watch.machines))}: {states}."]
    suspect = [name for name, one in watch.machines.items() if one.status in ("alarm", "suspect")]
    if suspect:
        sentences.append(f"Look at {', '.join(suspect)}.")
    alike = [name for name, one in watch.machines.items() if any(of.alike > _ALIKE for of in one.responses.values())]
    if alike:
        of = f"Runs of {', '.join(alike)} resemble the one before by more than {_ALIKE:g}"
        sentences.append(f"{of}: one false alarm a year at most cannot be promised there.")
    is_bad = bool(suspect or counts["failed"])
    return Account(
        title=f"{title}: are the models still true?",
        verdict="bad" if is_bad else "good" if counts["quiet"] else "plain",
        sentences=tuple(sentences),
        sections=sections(
            section("machines", "Errors in recordings that came later", Captioned("", _watched(watch)), link="Errors"),
            section("readings", "What else was found in them", _readings(watch), link="Readings"),
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
            um = (number_text(one.errors[f"{way}_um"]) for way in ("none", "own", "pooled", "sisters"))
            rows.append((name, f"{one.errors['machines']:.0f}", *um))
    head = (">machines", ">no correction [µm]", ">these runs alone [µm]", ">all as one [µm]", ">sisters [µm]")
    errors = table(("response", *head), rows, legend("fleet.sisters"))
    others = table(("machine", "reason"), list(answer.left_out.items()))
    return Account(
        title=f"{title}: what its sisters tell of {answer.machine}",
        verdict="plain" if answer.verdict == "none" else "good",
        sentences=tuple(sentences),
        sections=sections(
            section("errors", "Errors", Captioned("", errors), link="Errors"),
            section("left-out", "Machines that are no sisters", Captioned("", others), link="Left out"),
        ),
        data=answer.model_dump(by_alias=True),
    )


_STATES = {
    "alarm": "no longer as it was",
    "suspect": "to be looked at",
    "quiet": "as before",
    "nothing-new": "without a new recording",
    "not-judged": "not judged",
    "no-model": "without a model",
    "failed": "failed",
}
_UNWELL = ("failed", "missing")
_ALIKE = 0.9  #: Likeness of neighbouring runs beyond which false alarms are more than one a year.
_CHANGED = {"mean": "the error has shifted", "spread": "the errors have grown"}


def _suspicion(one: WatchedMachine) -> str:
    """Why a machine is to be looked at: an error of a clock, or that of its readings."""
    errors = (finding["statement"] for finding in one.findings if finding["level"] == "error")
    return one.error or next(errors, "")


def _watched(watch: FleetWatch) -> Table:
    ordered = sorted(watch.machines.items(), key=lambda item: list(_STATES).index(item[1].status))
    rows: list[tuple[str, ...]] = []
    for name, one in ordered:
        state, told = _STATES[one.status], one.responses.items() if one.status in ("alarm", "suspect", "quiet") else ()
        if not told:
            rows.append((name, state, *(NONE,) * 6, one.error or ""))
        for response, of in told:
            sums = (number_text(value or 0.0, 2) for value in (of.highest, of.limit))
            judged = NONE if of.highest is None else " of ".join(sums)
            said = _suspicion(one) if one.status == "suspect" else ""
            what = said if of.alarm is None else f"{_CHANGED[of.alarm]} since {of.since}"
            errors = (number_text(value) for value in (of.rmse_um, of.expected_um, of.mean_um))
            rows.append((name, state, response, str(of.runs), *errors, judged, what))
    head = (">runs", ">RMS error [µm]", ">when it was made [µm]", ">mean error [µm]", ">sum")
    return table(("machine", "status", "response", *head, "what has changed"), rows, legend("fleet.watched"))


def _readings(watch: FleetWatch) -> Captioned | None:
    told = {name: one.findings for name, one in watch.machines.items() if one.findings}
    rows = [(name, _gravest(of)["statement"], str(len(of))) for name, of in told.items()]
    note = "The gravest finding of each machine; --json has all."
    return captioned("", table(("machine", "what", ">findings"), rows, note))


def _machines(n: int) -> str:
    return f"{n} machine{'s' * (n != 1)}"


def _shared(answer: FleetAnswer) -> Iterator[str]:
    """Recordings that several machines have."""
    for one in answer.shared[:_MOST_LOOKED_AT]:
        runs = ", ".join(one.runs[:3]) + (f" and {len(one.runs) - 3} more" if len(one.runs) > 3 else "")
        same = f"{listed(one.machines)} have the same recording{'s' * (len(one.runs) > 1)}, byte for byte: {runs}"
        yield f"{same}. Look for the machine that recorded them."
    if len(answer.shared) > _MOST_LOOKED_AT:
        yield f"Other machines that share recordings: {len(answer.shared) - _MOST_LOOKED_AT} groups more (in the JSON)."


_UNLIKE = 2.0  #: Times the median error of the fleet from which a machine is worth a look.
_MOST_LOOKED_AT = 5
_BARS = "▁▂▃▄▅▆▇█"


def _to_do(answer: FleetAnswer, missing: Sequence[str], beside: Overview) -> Iterator[str]:
    """What somebody can do, the most urgent first."""
    watched = {} if beside.watch is None else beside.watch.machines
    for name, one in watched.items():
        for response, of in one.responses.items():
            if of.alarm is not None:
                look = _suspicion(one) or "Look at gauge, sensors and setup."
                yield f"{name}: {_CHANGED[of.alarm]} in {response} since {of.since}. {look}"
    suspect = {name: _suspicion(one) for name, one in watched.items() if one.status == "suspect"}
    yield from (f"{name}: {what}" for name, what in suspect.items())
    unwell = {name: told for name in watched if (told := _not_watched(watched, name))}
    unwell |= {name: str(one.error) for name, one in answer.machines.items() if one.status in _UNWELL}
    most = len(unwell) if len(unwell) <= 2 * _MOST_LOOKED_AT else _MOST_LOOKED_AT
    yield from (f"{name}: {error}" for name, error in list(unwell.items())[:most])
    if len(unwell) > most:
        yield f"{len(unwell) - most} more machines without an answer, or not watched, stand in the table."
    yield from (f"{name}, when its model was made: {statement}" for name, statement in beside.found.items())
    if missing:
        yield f"Go on with `selector fleet run`: {_machines(len(missing))} had no turn yet."
    relative = _relative(answer)
    worst = [name for name in _by_error(answer) if relative.get(name, 0.0) > _UNLIKE][:_MOST_LOOKED_AT]
    if worst:
        times = f"{_UNLIKE:g} times that of most machines"
        yield f"Record more runs, and other ones, on {', '.join(worst)}: the error on unseen runs is more than {times}."
    if beside.single:
        told = f"{', '.join(beside.single[:_MOST_LOOKED_AT])}{' …' * (len(beside.single) > _MOST_LOOKED_AT)}"
        yield f"Record a second and a third run on {told}: there is one, which says nothing of another day."
    if quiet := [name for name, one in watched.items() if one.status == "nothing-new"]:
        told = f"{', '.join(quiet[:_MOST_LOOKED_AT])}{' …' * (len(quiet) > _MOST_LOOKED_AT)}"
        yield f"Record the displacement now and then: nothing new of {told} since the model was made."
    if beside.watch is None:
        yield "`selector fleet watch` says which models are no longer true; nobody has asked it yet."


def _relative(answer: FleetAnswer) -> dict[str, float]:
    """Machine → its largest error on unseen runs, each response in parts of the fleet's median."""
    found: dict[str, float] = {}
    for response in {response for one in answer.machines.values() for response in one.heldout_rmse_um}:
        of = {name: error for name, one in answer.machines.items() if (error := one.heldout_rmse_um.get(response))}
        usual = median(of.values() or [1.0])
        found |= {name: max(found.get(name, 0.0), error / usual) for name, error in of.items()}
    return found


def _by_error(answer: FleetAnswer) -> list[str]:
    """Machines, failed ones first, then by their largest error on unseen runs."""
    errors = {name: list(filter(None, one.heldout_rmse_um.values())) for name, one in answer.machines.items()}
    is_well = {name: one.status not in _UNWELL for name, one in answer.machines.items()}
    return sorted(errors, key=lambda name: (is_well[name], -max(errors[name], default=math.inf)))


def _table(answer: FleetAnswer, missing: Sequence[str], beside: Overview) -> Table:
    responses = list(dict.fromkeys(name for one in answer.machines.values() for name in one.heldout_rmse_um))
    watched = {} if beside.watch is None else beside.watch.machines
    bars = "Bars: this error run by run, the highest of a machine is full. " if beside.by_run_um else ""
    rows = [
        (
            name,
            one.status,
            *(f"{number_text(one.heldout_rmse_um.get(of))} {_bars(beside, name, of)}" for of in responses),
            ", ".join(one.sensors) or NONE,
            _STATES[watched[name].status] if name in watched else NONE,
            one.error or _not_watched(watched, name) or (f"{one.outcome}: {one.refit.because}" if one.refit else ""),
        )
        for name, one in ((name, answer.machines[name]) for name in _by_error(answer))
    ]
    rows += [(name, "no turn yet", *(NONE for _ in responses), NONE, NONE, "") for name in missing]
    head = ("machine", "status", *(f"{name}, unseen [µm]" for name in responses), "sensors", "last watch", "reason")
    order = "Failed ones first, then by the largest root mean square error on unseen runs."
    return table(head, rows, f"{order} {bars}An answer lies in the folder that is called by its key.")


def _not_watched(watched: Mapping[str, WatchedMachine], name: str) -> str:
    return f"not watched: {watched[name].error}" if name in watched and watched[name].status == "failed" else ""


def _bars(beside: Overview, machine: str, response: str) -> str:
    """Errors run by run as a small row of bars; of many the last ones."""
    errors = beside.by_run_um.get(machine, {}).get(response, ())
    top = max(errors, default=0.0)
    return "".join(_BARS[min(int(len(_BARS) * error / top), len(_BARS) - 1)] for error in errors[-24:]) if top else ""


def _gravest(findings: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    return min(findings, key=lambda finding: finding["level"] != "error")


def _serving(beside: Overview | None) -> Captioned | None:
    """The places that serve all machines, as a list that may be cut anywhere."""
    serving = () if beside is None else beside.serving
    rows = [(str(k + 1), name, str(served)) for k, (name, served) in enumerate(serving)]
    head = (">places", "sensor to add", ">machines served")
    return captioned("Places for all", table(head, rows, legend("fleet.shared")))


def _sensors(answer: FleetAnswer) -> Captioned | None:
    models = [one for one in answer.machines.values() if one.sensors]
    counts = Counter(name for one in models for name in one.sensors)
    rows = [(name, str(n), f"{100 * n / len(models):.0f} %") for name, n in counts.most_common()]
    head = ("sensor", ">machines", ">share")
    return captioned("How often each sensor is chosen", table(head, rows, legend("fleet.chosen")))
