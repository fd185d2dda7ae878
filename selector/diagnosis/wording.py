"""A diagnosis in sentences: what was left out, where, how sure that is, what it is worth, and what to do now."""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from selector.diagnosis.answer import Diagnosis, Fit, NamedEffect, Place, recalibration_of
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.finding_table import SLOW_REMAINDER, SMALL_MISFIT, UNRECORDED_SWITCH
from selector.diagnosis.shown_units import displayed
from selector.number_text import listed, number_text, span_text

_STEPS = {
    "miscalibrated": "Give the simulation the offset, gain and delay below; no new physics is needed.",
    "nothing-missing": "Use the simulation as it is. What this record would not have shown is listed under "
    "Detectability.",
    "unexplained": "Look at the windows below: what was switched on, opened or touched then? A channel that records it "
    "would let it be named.",
}
_LEAST_FALL = 0.02
_OFF_CLOCK = 2.0  #: Samples that a clock may be off by.
_NEAR = 0.5  #: Share of the mismatch from which what is not borne out is told with the verdict.
_SURE = 0.9  #: Confidence from which a fault of the data is no fault of the simulation.


def headline(found: Diagnosis) -> str:
    """The answer in one or two sentences: verdict, what, where, how sure, and what it is worth."""
    if found.verdict == "miscalibrated":
        return " ".join([_miscalibrated(found), *_turned(found), *_advanced(found), *_wandering(found)])
    if found.verdict == "nothing-missing":
        return " ".join([_nothing(found), *_wandering(found)])
    if found.verdict == "unexplained" or not found.effects:
        return _unexplained(found)
    # the largest of physics, else the largest fault of the data
    first = next((effect for effect in found.effects if not is_data(effect.id)), found.effects[0])
    others = [effect for effect in found.effects if effect is not first]
    sentences = [_named(found, first)]
    physics = [effect for effect in others if not is_data(effect.id)]
    faults = [effect for effect in others if is_data(effect.id)]
    if physics:
        sentences.append(f"Also left out: {listed([_short(effect) for effect in physics])}.")
    if faults:
        also = "The recording is at fault too" if not is_data(first.id) else "Also at fault"
        sentences.append(f"{also}: {listed(list(dict.fromkeys(_short(effect) for effect in faults)))}.")
    return " ".join([*sentences, *_turned(found), *_advanced(found)])


def _wandering(found: Diagnosis) -> list[str]:
    """Responses in which noise may be a slow effect."""
    names = [one.where.channel or "" for one in found.findings if one.id == SLOW_REMAINDER]
    return [f"What wanders slowly in {listed(names)} may be more than noise: see the findings."] if names else []


def _small(found: Diagnosis) -> bool:
    """Whether more is left than noise, but too little to matter."""
    return any(one.id == SMALL_MISFIT for one in found.findings)


def _turned(found: Diagnosis) -> Iterator[str]:
    """Responses that were simulated with the other sign; beside parameters of a model a gain says nothing of that.

    Nor does one beside friction by speed, where the simulation goes as the recording does.
    """
    for response in () if "model" in found.recalibration else found.comparison.responses:
        gain = recalibration_of(found.recalibration.get(response, {})).get("gain")
        recorded, simulated = (
            pd.Series(of[response]) for of in (found.comparison.recorded, found.comparison.simulated)
        )
        goes_against = recorded.cov(simulated) < 0.0
        if goes_against and gain is not None and gain.high is not None and gain.value < 0.0 > gain.high:
            yield f"{response} is simulated with the opposite sign: its gain should be {number_text(gain.value)}."


def _advanced(found: Diagnosis) -> Iterator[str]:
    """Responses that the fit has to advance, by more than a clock is off: no effect comes before its cause."""
    for response in found.fit:
        delay = recalibration_of(found.recalibration.get(response, {})).get("delay")
        if delay is not None and delay.high is not None and delay.high < -_OFF_CLOCK * found.comparison.period_s:
            yield (
                f"{response} comes {delay.words(amount=True)} later in the simulation than in the recording: its clock "
                "or a time constant is off, or it lacks what the machine does at once, as growth with speed."
            )


def what_to_do(found: Diagnosis) -> tuple[str, ...]:
    """What the user should do now, the most urgent first; a sentence each."""
    steps = [f"Turn the sign of the simulation before anything else: {said}" for said in _turned(found)]
    for effect in (one for one in found.effects if is_data(one.id)):
        first = "Correct the recording before anything else"
        if effect.confidence < _SURE:
            first = "Look at the recording first, and at what happened to the machine there"
        steps.append(f"{first}: {_sentence(effect.statement)}")
    for effect in found.effects:
        if effect.cannot_be_told_from:
            names = _or_rivals(effect)
            steps.append(f"To tell whether it is {names}: {_sentence(effect.experiment)}")
        elif effect.suspected:
            steps.append(f"To confirm {name_of(effect.id)}: {_sentence(effect.experiment)}")
    put = [effect for effect in found.effects if not is_data(effect.id) and not effect.cannot_be_told_from]
    if put:
        names = listed([name_of(effect.id) for effect in put])
        steps.append(f"Put {names} into the simulation, with the numbers below.")
    steps += [_STEPS[found.verdict]] if found.verdict in _STEPS else []
    fitted = [run for run, rows in found.comparison.rows_of_runs() if not found.comparison.held_out[rows].all()]
    if found.verdict == "unexplained" and len(fitted) == 1 < len(found.comparison.runs):
        steps.append(
            f"Only {fitted[0]} was fitted, which may be too little to name anything: ask again with --holdout 0.3, "
            "which fits the first 70 % of every run and keeps the ends for the proof."
        )
    for run in [run for run in found.next_runs if run.power is not None][:1]:
        pair, chance = listed([name_of(id_) for id_ in run.separates], "from"), 100.0 * (run.power or 0.0)
        steps.append(f"Next run, {chance:.0f} % likely to tell {pair}: {_sentence(run.description)}")
    return tuple(steps)


def suspicion_words(found: Diagnosis, effect: NamedEffect) -> str:
    """Why an effect is only suspected."""
    fits = [found.fit[name] for name in effect.channels if name in found.fit]
    if fits and not any(np.isfinite(fit.heldout.rmse_after) for fit in fits):
        return f"nothing of {listed(list(effect.channels), 'or')} was held out to check it on"
    return "not confirmed on another programme"


def is_data(id: str) -> bool:  # noqa: A002 - the word of the contract
    """Whether an effect is a fault of the recording."""
    return id.startswith("data.")


def name_of(id: str) -> str:  # noqa: A002 - the word of the contract
    """An effect as it stands inside of a sentence."""
    return _inside(next((effect.title for effect in catalogue() if effect.id == id), id))


def held_out_words(comparison: Comparison) -> str:
    """What was held out, in words."""
    held = comparison.held_out
    whole = [run for run, rows in comparison.rows_of_runs() if held[rows].all()]
    if whole and sum(held[rows].sum() for run, rows in comparison.rows_of_runs() if run in whole) == held.sum():
        return f"the unseen run{'s' if len(whole) > 1 else ''} {listed(whole)}"
    parts = [run for run, rows in comparison.rows_of_runs() if held[rows].any()]
    return f"the unseen end of {listed(parts)}" if len(parts) <= 3 else "the unseen end of every run"


def sure_words(confidence: float) -> str:
    """A probability of being right."""
    if confidence < 0.05:
        return "hardly more than a guess"
    return "more than 99 % sure" if confidence >= 0.995 else f"{100 * confidence:.0f} % sure"


def amount(value: float, unit: str) -> str:
    """A number of three digits with its unit as people write it."""
    factor, shown = displayed(unit, value)
    return f"{number_text(factor * value)} {shown}".strip()


def place_words(place: Place) -> str:
    """A box of the mismatch in words."""
    parts = [place.channel]
    if place.run is not None:
        window = place.run
        if place.from_s is not None and place.to_s is not None:
            window += f" from {span_text(place.from_s)} to {span_text(place.to_s)}"
        parts.append(window)
    if place.regime:
        parts.append(f"at {place.regime}" if place.regime.endswith(" Hz") else f"while {place.regime}")
    return ", ".join(parts)


def _named(found: Diagnosis, effect: NamedEffect) -> str:
    statement = _inside(effect.statement.rstrip(" ."), found.comparison)
    sure = sure_words(effect.confidence)
    if is_data(effect.id):
        is_sure = effect.confidence >= _SURE
        fault = "The recording is at fault, not the simulation" if is_sure else "The recording may be at fault"
        text = f"{fault}: {statement} ({sure})"
        if not (effect.is_fitted or _is_left_out(effect)):
            # the errors of the answer are those without it
            return f"{text}."
        return f"{text}; {'' if _is_left_out(effect) else 'corrected, '}{_gain(found, effect)}."
    verb = "may leave out" if effect.suspected else "leaves out"
    names = _or_rivals(effect)
    where = f" ({effect.place})" if effect.place else ""
    what = f"The simulation {verb} {names}{where}: {statement} ({sure}"
    if effect.cannot_be_told_from:
        what += " that it is one of them; this record cannot tell them apart"
    elif effect.suspected:
        what += f", {suspicion_words(found, effect)}"
    text = f"{what}); with it {_gain(found, effect)}.{_elsewhere(found, effect)}"
    if effect.cannot_be_told_from:
        text += f" To tell them apart: {_sentence(effect.experiment)}"
    return text


def _gain(found: Diagnosis, effect: NamedEffect) -> str:
    fit = found.fit.get(effect.channel)
    if fit is None:
        return "the rest is noise"
    error = f"the error of {effect.channel}"
    factor, unit = displayed(fit.unit, fit.train.rmse_before)
    if not np.isfinite(fit.heldout.rmse_after):
        before, after = (number_text(factor * one) for one in (fit.train.rmse_before, fit.train.rmse_after))
        check = "" if effect.suspected else "; nothing of it was held out to check that on"
        return f"{error} falls from {before} to {after} {unit} where it was fitted{check}"
    held = fit.heldout.rmse_before, fit.heldout.rmse_after, fit.recalibrated_heldout
    before, after, alone = (number_text(factor * one) for one in held)
    error += f" on {held_out_words(found.comparison)}"
    if _is_left_out(effect):
        return f"without that stretch {error} is {after} {unit}"
    if _falls_alone(fit) and fit.recalibrated_heldout <= fit.heldout.rmse_after:
        return f"{error} falls from {before} to {after} {unit}, as by recalibration alone"
    if _falls(fit):
        also = f"; recalibration alone gives {alone}" if _falls_alone(fit) else ""
        return f"{error} falls from {before} to {after} {unit}{also}"
    return f"{error} does not fall ({before} and {after} {unit})"


def _elsewhere(found: Diagnosis, effect: NamedEffect) -> str:
    """The other responses that show the same effect, and what it is worth there."""
    parts = []
    for name in effect.channels:
        fit = found.fit.get(name)
        if name == effect.channel or fit is None or not _falls(fit):
            continue
        factor, unit = displayed(fit.unit, fit.heldout.rmse_before)
        before, after = factor * fit.heldout.rmse_before, factor * fit.heldout.rmse_after
        parts.append((name, f"of {name} falls from {number_text(before)} to {number_text(after)} {unit}"))
    if not parts:
        return ""
    return f" It shows in {listed([name for name, _ in parts])} too: the error {listed([text for _, text in parts])}."


def _falls(fit: Fit) -> bool:
    return fit.heldout.rmse_after < (1.0 - _LEAST_FALL) * fit.heldout.rmse_before


def _falls_alone(fit: Fit) -> bool:
    """By recalibration."""
    return fit.recalibrated_heldout < (1.0 - _LEAST_FALL) * fit.heldout.rmse_before


def _is_left_out(effect: NamedEffect) -> bool:
    """Whether nothing was fitted to where it acts; a frozen reading that was fitted has its reading as a parameter."""
    return effect.id == "data.stuck" and effect.acts is not None and "reading" not in effect.parameters


def _short(effect: NamedEffect) -> str:
    where = f" ({effect.place})" if effect.place and not is_data(effect.id) else ""
    channel = f" in {effect.channel}" if is_data(effect.id) else ""
    if effect.cannot_be_told_from:
        names = _or_rivals(effect)
        return f"{names}{channel}{where}, which this record cannot tell apart ({sure_words(effect.confidence)})"
    return f"{name_of(effect.id)}{channel}{where} ({sure_words(effect.confidence)})"


_MOST_TOLD = 3


def _out_of_calibration(found: Diagnosis) -> list[str]:
    """What responses need whose error recalibration alone makes smaller: of offset, gain, delay what is surely off.

    By four standard errors; a model has its refitted parameters instead.
    """
    parts = []
    for response, fit in found.fit.items():
        said = [
            f"{name} {one.words()}"
            for name, one in recalibration_of(found.recalibration.get(response, {})).items()
            if one.low is None or one.high is None or abs(one.value - (name == "gain")) > one.high - one.low
        ]
        if (said or "model" in found.recalibration) and _falls_alone(fit):
            factor, unit = displayed(fit.unit, fit.heldout.rmse_before)
            before, after = factor * fit.heldout.rmse_before, factor * fit.recalibrated_heldout
            needs = f"{response} needs {listed(said)}, and its error" if said else f"the error of {response}"
            parts.append(f"{needs} falls from {number_text(before)} to {number_text(after)} {unit}")
    return parts


def _miscalibrated(found: Diagnosis) -> str:
    model, parts = list(found.recalibration.get("model", {}).items()), _out_of_calibration(found)
    verdict = "No missing physics shows" if _wandering(found) else "No physics is missing"
    if _small(found):
        verdict = "No physics of a size that matters is missing"
    if not parts:
        own = "parameters" if model else "offset, gain or delay"
        return f"{verdict}: the simulation's own {own} explain the difference."
    numbers = [f"{name} {one.words()}" for name, one in model[:_MOST_TOLD]]
    more = [f"{len(model) - _MOST_TOLD} more"] if len(model) > _MOST_TOLD else []
    of_model = f"with {listed([*numbers, *more])}, " if model else ""
    unseen = held_out_words(found.comparison)
    return f"{verdict}; the simulation is out of calibration: {of_model}{'; '.join(parts)} on {unseen}."


def _nothing(found: Diagnosis) -> str:
    parts = []
    for response, fit in ((name, found.fit[name]) for name in found.comparison.responses if name in found.fit):
        held = fit.heldout.rmse_after
        parts.append(f"{response} ({amount(held if np.isfinite(held) else fit.train.rmse_after, fit.unit)} rms)")
    left = f"what is left{f' in {listed(parts)}' if parts else ''}"
    if _small(found):
        return f"Nothing of a size that matters is missing: {left} is little, but not all noise."
    if _wandering(found):
        return f"Nothing shows to be missing: {left} is noise, for all that this record can tell."
    return f"Nothing is missing: {left} is noise."


def _unexplained(found: Diagnosis) -> str:
    text = "Something is missing that no effect of the catalogue explains"
    if not found.where:
        return f"{text}."
    first = max(found.where, key=lambda place: place.share)
    same = [place for place in found.where if place.channel == first.channel and place.run is not None]
    text += f": {place_words(first)}"
    if len(same) > 1:
        text += f" and {len(same) - 1} other window{'s' if len(same) > 2 else ''}"
    size = _structured_in(found, first.channel, same)
    if size > 0.0:
        unit = found.comparison.channel(first.channel).unit
        moved = float(np.nanstd(found.comparison.recorded[first.channel]))
        part = f", {number_text(100.0 * size / moved, 2)} % of how far {first.channel} moves" if moved > 0.0 else ""
        text += f", where {amount(size, unit)} rms beside noise is left{part}"
    sentences = [f"{text}."]
    if any(one.id == UNRECORDED_SWITCH for one in found.findings):
        sentences.append("It comes and goes as by a switch that nobody recorded: see the findings.")
    near = [one for one in found.also_seen if one.share >= _NEAR and not is_data(one.id)]
    for one in sorted(near, key=lambda one: -one.share)[:1]:
        fitted = f"{name_of(one.id)}, {100.0 * one.share:.0f} % of the fitted mismatch in {one.channel}"
        sentences.append(f"Nearest comes {fitted}, but it did not stand every test: see what was also seen.")
    if parts := _out_of_calibration(found):
        unseen = held_out_words(found.comparison)
        sentences.append(f"The simulation is also out of calibration: {'; '.join(parts)} on {unseen}.")
    return " ".join(sentences)


def _structured_in(found: Diagnosis, channel: str, places: Sequence[Place]) -> float:
    """Root mean square of what is left in these windows, its usual offset and the power of the noise taken off."""
    comparison, fit = found.comparison, found.fit.get(channel)
    difference = comparison.difference(channel) if fit is None else comparison.recorded[channel] - fit.after
    time = comparison.time_s
    inside = np.zeros(len(difference), dtype=np.bool_)
    for place in places:
        start, stop = (usual if s is None else s for s, usual in ((place.from_s, -np.inf), (place.to_s, np.inf)))
        rows = comparison.run_index == comparison.runs.index(place.run or "")
        inside |= rows & (time >= start) & (time <= stop)
    inside &= np.isfinite(difference)
    if not inside.any():
        return 0.0
    noise = None if fit is None else fit.heldout.noise_floor
    power = float(np.mean((difference[inside] - np.nanmedian(difference)) ** 2))
    return float(np.sqrt(max(power - (noise or 0.0) ** 2, 0.0)))


def _inside(text: str, comparison: Comparison | None = None) -> str:
    """A sentence or title as it stands behind a colon: its first letter small unless it begins a name."""
    word = text.split(" ")[0].rstrip(",:;'s")
    # a name may have blanks, and is no part of a longer word
    names = [channel.name for channel in comparison.channels] if comparison else []
    begun = [name for name in names if text.startswith(name) and not text[len(name) : len(name) + 1].isalnum()]
    is_name = bool(begun) or word in ("Coulomb", "Stribeck")
    return text if is_name or not word[1:].islower() else text[:1].lower() + text[1:]


def _sentence(text: str) -> str:
    text = text.strip()
    return text if text.endswith((".", "!", "?")) else text + "."


def _or_rivals(effect: NamedEffect) -> str:
    return listed([name_of(id_) for id_ in (effect.id, *effect.cannot_be_told_from)], "or")
