"""What a selection says one should do, in plain words."""

from selector.models.least_squares import FaultGain
from selector.number_text import listed, number_text
from selector.selection import Selection
from selector.selection.result import MOST_TOLD_FACTOR, PROCEDURE
from selector.telling.account import Verdict

_UNUSABLE = {"constant-sensor": "never changes", "sensor-missing": "values missing"}
USELESS, MISSED = "no-better-than-nothing", "target-missed"
_UNSEEN = {
    "run": "On runs that the model has not seen",
    "condition": "Under conditions that the model has not seen",
    "block": "On stretches of the only run that the model has not seen",
}
#: Displacements of which the first sentence says each; of more it says the span, and the table below has them all.
MOST_SAID = 3


def advice(selection: Selection) -> tuple[Verdict, tuple[str, ...]]:
    """What the proof says one should do, first of all; a model that is no better than nothing is not to be used."""
    useless = tuple(name for name in selection.models if name in useless_responses(selection))
    useful = tuple(name for name in selection.models if name not in useless)
    keep = f"Keep sensor{'s' * (len(selection.chosen) > 1)} {listed(selection.chosen)}"
    warnings = tuple(_uselessness(selection, name) for name in useless)
    if not useful:
        of = f" of {listed(useless)}" if len(selection.models) == 1 else ""
        return "bad", (f"Do not use this model{of}.", *warnings)
    gain = f"{_improvement(selection, useful)}{_worst_fault(selection, useful)}."
    more = (*_dropped(selection), *_worse(selection, useful), *_faults(selection, useful))
    if useless:
        first = f"Do not use the model of {listed(useless)}; for {listed(useful)}, {keep[0].lower()}{keep[1:]}. {gain}"
        return "bad", (first, *warnings, *more)
    first = f"{keep}. {gain}"
    for missed in (one.evidence for one in selection.findings if one.id == MISSED):
        beyond = listed(list(missed["heldout_rmse_um"]))
        return "plain", (f"{missed['target_um']:g} µm are not reached in {beyond}. {first}", *more)
    return "good", (first, *more)


def useless_responses(selection: Selection) -> frozenset[str]:
    """Responses whose model does not beat leaving the machine alone."""
    return frozenset(
        finding.where.channel or name
        for finding in selection.findings
        if finding.id == USELESS
        for name in ([finding.where.channel] if finding.where.channel else list(selection.models))
    )


def _dropped(selection: Selection) -> tuple[str, ...]:
    dropped, found = len(selection.sensors) - len(selection.chosen), []
    gone = {one.where.channel: _UNUSABLE[one.id] for one in selection.findings if one.id in _UNUSABLE}
    unusable = [f"{name} ({why})" for name, why in gone.items() if name and name not in selection.sensors]
    if dropped > 1:
        usable = " usable" if unusable else ""
        found.append(f"The other {dropped} of {len(selection.sensors)}{usable} sensors are not needed.")
    if unusable:
        found.append(f"Not usable and left out: {listed(unusable)}.")
    return tuple(found)


def _improvement(selection: Selection, names: tuple[str, ...]) -> str:
    """What the model gains, without a full stop; of many displacements the least and the most."""
    proof = selection.proof
    where = _UNSEEN[proof.left_out]
    if proof.not_covered:
        covered, lacking = len(next(iter(proof.per_response.values()))), len(proof.not_covered)
        where = f"On {covered} of {covered + lacking} runs, unseen by the model (the others lack a sensor),"
    how = f"rms, {PROCEDURE}{_how_known(selection, names)}"
    falls = {name: (proof.baselines_um[name]["none"], proof.rmse_um(name)) for name in names}
    if len(names) == 1:
        before, after = (number_text(error, 2) for error in falls[names[0]])
        moves = f"stays at {after}" if before == after else f"falls from {before} to {after}"
        return f"{where} the {names[0]} error {moves} µm ({how})"
    if len(names) <= MOST_SAID:
        said = (
            f"{name} from {number_text(before, 2)} to {number_text(after, 2)} µm"
            for name, (before, after) in falls.items()
        )
        return f"{where} the errors fall: {', '.join(said)} ({how})"
    spans = (f"{number_text(min(ends), 2)}–{number_text(max(ends), 2)}" for ends in zip(*falls.values(), strict=True))
    return f"{where} the errors of {len(names)} displacements fall from {' to '.join(spans)} µm ({how})"


def _how_known(selection: Selection, names: tuple[str, ...]) -> str:
    """How far the errors carry: a factor; of runs that are too few for a displacement that it cannot be told."""
    known = selection.known
    if known is None:
        return ", one run" if selection.proof.left_out == "block" else ""
    told = [factor for name in names if (factor := known.factor_of(name)) <= MOST_TOLD_FACTOR]
    said = f", known to a factor of {number_text(max(told), 2 if max(told) >= 1.1 else 3)}" if told else ""
    if len(told) == len(names):
        return said
    of = " and ".join(name for name in names if known.factor_of(name) > MOST_TOLD_FACTOR) + ": " if told else ""
    return f"{said}, {of}how far off on further ones cannot be told from {known.runs}"


def _worse(selection: Selection, names: tuple[str, ...]) -> tuple[str, ...]:
    worse = []
    for name in names:
        parts = selection.proof.per_response[name]
        larger = sum(part.rmse_um >= part.before_rmse_um for part in parts)
        if larger:
            worse.append(f"that of {name} on {larger} of {len(parts)}")
    return (f"The error is larger than without compensation: {listed(worse)}.",) if worse else ()


def _uselessness(selection: Selection, name: str) -> str:
    ways = selection.proof.baselines_um[name]
    return (
        f"{_UNSEEN[selection.proof.left_out]} the {name} error is "
        f"{number_text(selection.proof.rmse_um(name))} µm with the model, {number_text(ways['none'])} µm without any "
        f"compensation and {number_text(ways['mean'])} µm with a constant (root mean square)."
        + " The gain is no larger than its scatter from part to part."
        * (selection.proof.rmse_um(name) < min(ways["none"], ways["mean"]))
    )


def _worst(selection: Selection, names: tuple[str, ...]) -> dict[str, FaultGain]:
    worst = {}
    for name in names:
        gains = [gain for gain in selection.faults if gain.response == name]
        if gains:
            worst[name] = max(gains, key=lambda gain: gain.worst_um)
    return worst


def _worst_fault(selection: Selection, names: tuple[str, ...]) -> str:
    """The worst of all, to stand behind what the model gains."""
    worst = _worst(selection, names)
    if not worst:
        return ""
    gain = max(worst.values(), key=lambda gain: gain.worst_um)
    how = "broken (open)" if gain.open_um >= gain.stuck_um else "stuck"
    where = f" in {gain.response}" if len(selection.models) > 1 else ""
    return f"; worst single sensor fault {number_text(gain.worst_um, 2)} µm{where}, {gain.sensor} {how}"


def _faults(selection: Selection, names: tuple[str, ...]) -> tuple[str, ...]:
    worst = _worst(selection, names)
    without = {name: max(part.before_max_um for part in selection.proof.per_response[name]) for name in worst}
    beyond = [name for name, gain in worst.items() if gain.worst_um > without[name]]
    if not beyond:
        return ()
    limits = listed([number_text(without[name], 2) for name in beyond])
    return (
        f"In {listed(beyond)} the worst fault is larger than any error without compensation ({limits} µm): it must be "
        "noticed before its correction reaches the axis.",
    )
