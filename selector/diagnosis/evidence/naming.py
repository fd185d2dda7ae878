"""How a supported effect is named: course, share, parameters with intervals, confidence; whether it is large enough."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter

import numpy as np

from selector.diagnosis.answer import Evidence, NamedEffect
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.effect import Fitted, Quantity, Variant
from selector.diagnosis.evidence.moments import solved
from selector.diagnosis.evidence.recalibration import Recalibrated
from selector.diagnosis.evidence.response import Bench
from selector.diagnosis.evidence.search import MOST_OF_IT, TENTH, Search, numbers, without
from selector.diagnosis.matching.usable import pure_error, rms
from selector.diagnosis.shapes.axis import motion
from selector.diagnosis.shapes.force_response import PLACE_ROLES
from selector.diagnosis.shapes.heating import sources
from selector.diagnosis.shapes.input_faults import InputFault
from selector.diagnosis.shapes.residual import read_by
from selector.diagnosis.shapes.signals import rise
from selector.types import Vector

_FALL = 3.84  #: Of the gain, at the ends of a 95 % interval: χ² of one parameter.
_OF_A_STEP = 0.25  #: Of the grid: how far off the top of a parabola through three of its points may be, in logarithms.
_LAG = "tau_s"  #: Ends the names of parameters that stand on a grid of time constants, even in its logarithm.


def shape_intervals(
    bench: Bench, named: Sequence[int], v: int
) -> tuple[Mapping[str, Quantity], dict[str, tuple[float, float]]]:
    """Shape parameters of the named candidate `v`, and the 95 % interval of each where it is known.

    Between grid points of a time constant the gain is a parabola in its logarithm; its top is the value. Where the best
    shape stands at the end of the grid, or has no neighbours to be weighed by, the interval reaches to the next point
    of the grid, and beyond the last one it is open: 0 or infinity.
    """
    others = [other for other in named if other != v]
    gains = solved(bench.moments(bench.base(others))).gain
    own = bench.candidates[v]
    alike = [(k, one.variant) for k, one in enumerate(bench.candidates) if one.effect.id == own.effect.id]
    tried = [variant.shape for _, variant in alike if variant.sources == own.variant.sources]
    key_of = attrgetter("sources", "regime", "run")
    family = [
        (variant.shape, float(gains[k]))
        for k, variant in alike
        if key_of(variant) == key_of(own.variant) and variant.shape.keys() == own.variant.shape.keys()
    ]
    shape, intervals = dict(own.variant.shape), {}
    for key, quantity in own.variant.shape.items():
        near = sorted((one[key].value, gain) for one, gain in family)
        inside = [value for value, gain in near if gain >= gains[v] - _FALL]
        intervals[key] = (min(inside), max(inside))
        if not key.endswith(_LAG) or quantity.value <= 0.0:
            continue
        grid = sorted({one.value for of in tried for name, one in of.items() if name.endswith(_LAG)})
        # the best gain at every value is the last of it
        top = _top(dict(near), quantity.value, grid) if len(own.variant.shape) == 1 else None
        if top is None:
            intervals[key] = (_next(grid, intervals[key][0], -1), _next(grid, intervals[key][1], 1))
            continue
        shape[key] = Quantity(top[0], quantity.unit)
        intervals[key] = (min(intervals[key][0], top[1]), max(intervals[key][1], top[2]))
    return shape, intervals


def _top(gains: Mapping[float, float], value: float, grid: Sequence[float]) -> tuple[float, float, float] | None:
    """Top of the parabola through a value and its neighbours, and where the gain has fallen; None without a top."""
    values = sorted(gains)
    number = values.index(value)
    if not 0 < number < len(values) - 1 or values[number - 1] <= 0.0:
        return None
    three = values[number - 1 : number + 2]
    x, y = np.log(three), np.array([gains[one] for one in three])
    curve, slope, _ = np.polyfit(x - x[1], y - y[1], 2)
    if curve >= 0.0 or y[1] < max(y[0], y[2]):
        return None
    top = float(np.clip(-0.5 * slope / curve, x[0] - x[1], x[2] - x[1]))
    step = 0.5 * float(x[2] - x[0])
    half = float(np.hypot(np.sqrt(_FALL / -curve), _OF_A_STEP * step))
    low, high = (float(value * np.exp(top + side * half)) for side in (-1.0, 1.0))
    low, high = low if low >= grid[0] else 0.0, high if high <= grid[-1] else float("inf")
    return float(f"{value * np.exp(top):.6g}"), low, high


def _next(grid: Sequence[float], value: float, step: int) -> float:
    """The neighbour of a value on the grid; beyond its ends 0 or infinity."""
    number = int(np.argmin(np.abs(np.array(grid) - value))) + step
    if number < 0:
        return 0.0
    return float(grid[number]) if number < len(grid) else float("inf")


_UNCHECKED = 0.9  #: What is left of a confidence that nothing held out could bear out.
#: How sure what is only seen, too, is at most; and, where structure is left, or the name is doubted, one that carries
#: nothing to unseen rows: surer the more it surely carries.
_HALF = 0.5
_GUESS = 0.1  #: Confidence below which a name says next to nothing.
#: Weights, and how often names of such a weight are right: 102 names of real recordings, 203 of development seeds, and
#: 451 of an exam that was over.
_RIGHT = (0.0, 0.5, 0.7, 0.85, 1.0), (0.0, 0.5, 0.75, 0.9, 0.96)
#: How sure what explains little is at most, unless unseen rows bear it out, or it surely closes so much of their gap.
_OFTEN, _SURELY_CLOSED = 0.75, 0.25
_FAR_ABOVE = 4.0
_ONE_SPEED = 0.1  #: Of the usual speed, by which it differs at most.
_OF_A_SWITCH = {"thermal.coolant": "thermal.second_source", "thermal.second_source": "thermal.coolant"}
_SHOWN = 9.0  #: Gain from which an effect shows in a response by itself: three standard errors.
_WHOLE = 0.7  #: Confidence of what recalibration shows in one response, and most of its mismatch.
_INPUT_FAULT = 0.9  #: Confidence of a fault that a channel's own course shows and nothing else explains.


def named_effect(comparison: Comparison, found: Search, id_: str, *, is_borne_out: bool = False) -> NamedEffect:
    """The effect as the answer has it; what is little is surer where unseen rows have it as it ought to be there."""
    standing, by_response = found.standing[id_], found.named[id_]
    gains = {name: found.standing[id_].tested[name].gain for name in by_response}
    main = max(gains, key=lambda name: gains[name])
    courses = {name: found.benches[name].course(numbers(found.named, name), v) for name, v in by_response.items()}
    others = without(found.named, id_)
    shares = (found.benches[name].share(numbers(others, name), v) for name, v in by_response.items())
    fitted = _fitted(comparison, found, id_, main, courses[main])
    effect = found.benches[main].candidates[by_response[main]].effect
    reading = effect.reading(fitted, comparison)
    # beyond all that shapes at a wrong time explain is beyond one in so many
    p_value = 1.0 / (1 + len(found.carried[id_][1])) if id_ in found.carried else standing.p_value
    confidence = sum(found.weights[id_].values()) * (1.0 - p_value)
    share = float(np.clip(max(shares), 0.0, 1.0))
    # a frozen reading is proved by its equal readings
    gap = found.closed.get(id_) if id_ != "data.stuck" else None
    if is_structured(found, main):
        carried = 0.0 if gap is None or gap.low is None else float(np.clip(gap.low, 0.0, 1.0))
        confidence = min(confidence, _HALF + _HALF * carried, found.ahead.get(id_, 1.0))
    confidence = float(np.interp(confidence, *_RIGHT))
    if id_ in found.doubted:
        # what surely closes more than half of the gap on unseen rows is right more often than that
        surely = 0.0 if gap is None or gap.low is None else min(gap.low, share)
        confidence = min(confidence, float(np.clip(surely, _HALF, _OFTEN)))
    if gap is not None and gap.high is not None and (share < MOST_OF_IT or id_.startswith("data.")):
        # no surer than the names are shown to carry on unseen rows
        confidence = min(confidence, gap.high)
    is_borne_out |= gap is not None and gap.low is not None and gap.low >= _SURELY_CLOSED
    if share < TENTH and id_ != "data.stuck" and not is_borne_out:
        confidence = min(confidence, _OFTEN)
    # with nothing meant to be kept nothing is lacking
    held = comparison.held_out
    # a fault may be of one run; physics that only one has is borne out by none
    is_of_one_run, is_fault = fitted.variant.run is not None, id_.startswith("data.")
    if is_of_one_run and not is_fault:
        confidence = min(confidence, _HALF)
    is_checked = (is_of_one_run and is_fault) or not held.any()
    is_checked = is_checked or any(np.isfinite(comparison.difference(name)[held]).any() for name in by_response)
    return NamedEffect(
        id=id_,
        channel=main,
        place=fitted.variant.place,
        statement=reading.statement + _or_what_it_reads(comparison, id_, main, fitted.variant.sources),
        parameters=reading.parameters,
        confidence=float(np.clip(confidence, 0.01, 0.99)) * (1.0 if is_checked else _UNCHECKED),
        p_value=float(min(1.0, p_value)),
        share=share,
        cannot_be_told_from=tuple(dict.fromkeys((*found.rivals[id_], *_twins(comparison, found, main, id_, fitted)))),
        experiment=effect.experiment,
        channels=tuple(
            name for name in sorted(gains, key=lambda one: -gains[one]) if name == main or gains[name] > _SHOWN
        ),
        suspected=not is_checked,
        courses=courses,
        acts=_acts(fitted.variant),
        is_fitted=True,
        sources=fitted.variant.sources,
    )


def _twins(comparison: Comparison, found: Search, response: str, id_: str, fitted: Fitted) -> tuple[str, ...]:
    """A line in time for what repeats along the way of an axis at one speed, and back; heat for a switch of coolant.

    The last, and coolant for heat, where nobody says what the switch is of.
    """
    if id_ in _OF_A_SWITCH:
        known = sources(comparison, response)
        is_said = known.is_coolant_said or set(fitted.variant.sources).isdisjoint(known.coolant_switches)
        return () if is_said else (_OF_A_SWITCH[id_],)
    channel = comparison.channel(response)
    along = "drive.pitch_error" if channel.role in PLACE_ROLES else "drive.ripple"
    twin = {"vibration.line": along, along: "vibration.line" if "vibration.line" in found.standing else None}.get(id_)
    moving = motion(comparison, channel.axis) if twin is not None else None
    if twin is None or moving is None:
        return ()
    slow, usual, fast = np.percentile(np.abs(moving.velocity_m_per_s[~comparison.held_out]), (5.0, 50.0, 95.0))
    return () if fast - slow > _ONE_SPEED * usual else (twin,)


def as_carried(effect: NamedEffect, found: Search) -> NamedEffect:
    """The effect no less sure than the part of the gap that it surely closes on unseen rows, up to a half.

    Of what these rows have chosen: of laws that are all somewhat wrong the likeliest of fitted rows is not the best.
    """
    gap = found.closed.get(effect.id)
    is_chosen = effect.id in found.ahead or effect.confidence < _GUESS
    if not is_chosen or gap is None or gap.low is None:
        return effect
    least = min(_HALF, gap.low) * (_HALF if effect.suspected else 1.0)
    return replace(effect, confidence=max(effect.confidence, least))


def is_structured(found: Search, response: str) -> bool:
    """Whether more is left of a response than noise."""
    return found.misfit.get(response, 1.0) > 1.0 or is_far_above_noise(found, response)


def is_far_above_noise(found: Search, response: str) -> bool:
    """Whether what is left is many times its changes from sample to sample: noise that wanders, or nobody's misfit."""
    bench = found.benches[response]
    left = bench.residual(numbers(found.named, response))
    return rms(left[bench.fitted]) > _FAR_ABOVE * bench.quick(left)


def _or_what_it_reads(comparison: Comparison, id_: str, response: str, sources: Sequence[str]) -> str:
    """A fault in a reading that drives the simulation looks like one of the response."""
    if not id_.startswith("data.") or any(name != response for name in sources):
        return ""
    names = ", ".join(read_by(comparison, response))
    text = f" The simulation of {response} follows {names}: the fault may be in one of these readings instead."
    return text if names else ""


def _acts(variant: Variant) -> tuple[str, float | None, float | None] | None:
    if variant.run is None:
        return None
    first, last = variant.shape.get("from_s"), variant.shape.get("to_s")
    return variant.run, None if first is None else first.value, None if last is None else last.value


def _fitted(comparison: Comparison, found: Search, id_: str, response: str, course: Vector) -> Fitted:
    bench, v = found.benches[response], found.named[id_][response]
    named = numbers(found.named, response)
    beta, covariance = bench.coefficients(named)
    here = bench.place(named, v)
    candidate = bench.candidates[v]
    scale = bench.scales[candidate.columns]
    shape, intervals = shape_intervals(bench, named, v)
    risen = rise(comparison, course, over_samples=1)[bench.fitted]
    return Fitted(
        response=response,
        unit=comparison.channel(response).unit,
        variant=replace(candidate.variant, shape=shape),
        coefficients=beta[here] / scale,
        standard_errors=np.sqrt(np.diag(covariance)[here]) / scale,
        shape_intervals=intervals,
        rms=float(np.sqrt(np.mean(course[bench.fitted] ** 2))),
        largest=float(np.abs(course[bench.fitted] - np.median(course[bench.fitted])).max()),
        extremes=(float(risen.min()), float(risen.max())),
    )


def whole_record_effect(
    comparison: Comparison,
    benches: Mapping[str, Bench],
    again: Mapping[str, Recalibrated],
    id_: str,
    shown: Mapping[str, str],
) -> NamedEffect:
    """An effect that recalibration shows, the same in all runs; `shown` is response → offset, gain or delay."""
    effect = effect_of(id_)
    main = max(shown, key=lambda name: again[name].gain)
    word = shown[main]
    value, unit = again[main].quantities[word], comparison.channel(main).unit
    courses = {}
    for name in shown:
        bench = benches[name]
        column = bench.nuisance_names.index(shown[name])
        courses[name] = bench.nuisance[:, column] * bench.coefficients([])[0][column]
    interval = value.words()
    force = f"force_{unit.lower()}"
    off = f"{main} is recorded {interval} times too large"
    if value.value < 1.0 and value.low and value.high:
        small = Quantity(1.0 / value.value, "1", 1.0 / value.high, 1.0 / value.low)
        off = f"{main} is recorded {small.words()} times too small"
    statement, key = {
        "data.gain": (f"{off} in all runs, or simulated so, and no other response is.", "gain"),
        "data.zero": (
            f"{main} reads {interval} more than simulated, in all runs and whatever the machine does.",
            "zero",
        ),
        "data.clock": (f"{main} is recorded {interval} late, in all runs, and no other response is.", "shift_s"),
        "drive.offset_force": (f"A constant of {interval} acts in {main} whatever the motion, at rest too.", force),
    }[id_]
    return NamedEffect(
        id=id_,
        channel=main,
        place=comparison.channel(main).place,
        statement=statement,
        parameters={key: value},
        confidence=_WHOLE if again[main].share >= MOST_OF_IT else _HALF,
        p_value=again[main].p_value,
        share=float(np.clip(again[main].share, 0.0, 1.0)),
        cannot_be_told_from=("data.zero",) if id_ == "drive.offset_force" else (),
        experiment=effect.experiment,
        channels=tuple(sorted(shown, key=lambda name: -again[name].gain)),
        courses=courses,
        is_fitted=True,
    )


def input_fault_effect(comparison: Comparison, fault: InputFault) -> NamedEffect:
    """A fault of a recorded channel that is no response, told by its own course and its siblings."""
    channel = fault.channel or comparison.responses[0]
    return NamedEffect(
        id=fault.id,
        channel=channel,
        place=comparison.channel(channel).place,
        statement=fault.statement,
        parameters={"from_s": Quantity(fault.from_s, "s"), "to_s": Quantity(fault.to_s, "s")},
        confidence=_INPUT_FAULT,
        p_value=1.0 - _INPUT_FAULT,
        share=0.0,
        cannot_be_told_from=(),
        experiment=effect_of(fault.id).experiment,
        channels=(channel,),
        courses={channel: fault.course},
        acts=(fault.run, fault.from_s, fault.to_s),
    )


_LISTED = 0.01


def seen_only(effects: Iterable[NamedEffect]) -> tuple[NamedEffect, ...]:
    """Effects that are seen, too, without being called missing; without those that are too little to be told of."""
    return tuple(
        replace(effect, suspected=True, confidence=min(_HALF, effect.confidence), is_fitted=False)
        for effect in effects
        if effect.share >= _LISTED
    )


def noise_floor(comparison: Comparison, bench: Bench, named: Sequence[int], *, is_noise: bool) -> float:
    """Standard deviation of the noise of a response [unit]: from repeats, else from what is left.

    What is left counts as noise only where it `is_noise`; otherwise its third differences from sample to sample do,
    which slow structure hardly has. It is never above what is left, and never below the rounding.
    """
    left = bench.residual(named)
    n, p = int(np.sum(bench.fitted)), bench.raw_base(named).shape[1]
    floor = rms(left[bench.fitted]) * float(np.sqrt(n / max(n - p, 1)))
    repeated = pure_error(comparison, bench.response)
    if repeated is not None:
        floor = min(floor, repeated)
    elif not is_noise:
        floor = float(np.nanmin([floor, bench.quick(left)]))
    return max(floor, bench.rounding)


def evidence_rows(found: Search, untested: Mapping[str, Mapping[str, str]]) -> tuple[Evidence, ...]:
    """How every effect stands, the clearest first, and those that could not be tested; `untested` is response → why."""
    rows = []
    for id_, one in sorted(found.standing.items(), key=lambda item: -item[1].score):
        note = "" if one.is_the_same_in_all_runs else "differs from run to run"
        note = "borne out by unseen rows" if id_ in found.carried else note
        rows.append(Evidence(id_, one.responses[0], one.score, one.p_value, id_ in found.named, note))
    for response, reasons in untested.items():
        rows += [
            Evidence(id_, response, 0.0, 1.0, False, f"not testable here: {why}")
            for id_, why in reasons.items()
            if id_ not in found.standing
        ]
    return tuple(rows)


def part_of(found: Search, effect: NamedEffect) -> float:
    """Mean square of an effect's course in parts of that of the mismatch beside recalibration, fitted rows."""
    parts = []
    for name, course in effect.courses.items():
        bench = found.benches[name]
        alone = bench.mean_square([])
        parts.append(float(np.var(course[bench.fitted])) / alone if alone > 0.0 else 0.0)
    return max(parts)
