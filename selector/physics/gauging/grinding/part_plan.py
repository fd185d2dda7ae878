"""What does the compiled loop need to know of a gauged grinding, and in which steps does it go."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from selector.errors import InputError
from selector.physics.gauging.gauge.threshold import removal_rate_um_per_s, wear_share
from selector.physics.gauging.gauge.transducer import Relay
from selector.physics.gauging.grinding._part_kernel import Plan
from selector.physics.gauging.grinding.gauged_grinding import GaugedGrinding
from selector.physics.gauging.process import Grinding, Noise, Surface
from selector.types import Vector

STEPS_PER_CORRELATION, STEPS_PER_FILTER, STEPS_PER_LAG, STEPS_PER_TURN = 4.0, 8.0, 8.0, 64.0
"""Steps in 1/β, T_Φ, lag_s and a turn with run-out: more of them change sizes by less than 20 000 parts can tell."""

MOST_STEPS = 500_000_000
"""Of all parts together: about a minute."""

FEWEST_SIZES = 2000
"""Parts from which sizes are told, where a file has fewer."""

MOST_STEPS_OF_PART = 3_000_000
"""Half a second, in which nothing hears Ctrl-C."""


STEPS_ADVICE = {
    "stages": "give it, or the feeds and allowances, the right power of ten",
    "thresholds_v": "set the thresholds within what is ground, or leave them out: they follow from the sizes wanted",
    "parts": "grind fewer parts, or give slower noise (rate_per_s)",
}
"""What to do about what asks for too many steps."""


def longest_step_s(filter_s: float, grinding: Grinding, surface: Surface, noise: Noise) -> float:
    """The longest step that resolves filter, noise, lag and run-out [s]."""
    longest = filter_s / STEPS_PER_FILTER
    if noise.sd_um > 0:
        longest = min(longest, 1.0 / (STEPS_PER_CORRELATION * noise.rate_per_s))
    if grinding.lag_s > 0:
        longest = min(longest, max(grinding.lag_s, longest) / STEPS_PER_LAG)
    if surface.runout_um > 0:
        longest = min(longest, 60.0 / (STEPS_PER_TURN * surface.workpiece_rpm))
    return longest


def feeds_s(grinding: Grinding, relay: Relay, ends_um: Sequence[float]) -> float:
    """How long a part of mean allowance takes to these ends of its stages by the feeds alone, and the delays [s].

    A stage that ends above where it begins takes no time. The wheel is fresh.
    """
    wear, begin, total = wear_share(grinding), grinding.allowance_um, 0.0
    for stage, end in zip(grinding.stages, ends_um, strict=True):
        total += max(begin - end, 0.0) / removal_rate_um_per_s(stage.feed_um_per_s, wear) + relay.delay_s
        begin = min(begin, end)
    return total


def steps_in(duration_s: float, step_s: float, surface: Surface, relay: Relay) -> float:
    """Steps of so long a part, with those that edges of grooves and the relay's noise add."""
    per_s = 1.0 / step_s
    if surface.grooves > 0 and surface.groove_depth_um > 0:
        per_s += 2.0 * surface.grooves * surface.workpiece_rpm / 60.0
    if relay.noise_v > 0:
        per_s += 1.0 / relay.noise_hold_s
    return duration_s * per_s


def too_long(of_feeds: float, of_thresholds: float, parts: int) -> tuple[str, str, str] | None:
    """What asks for too many steps ("stages", "thresholds_v" or "parts"), how many, how many may be; None: nothing.

    `of_feeds` are the steps of one part that ends where it is wanted, `of_thresholds` where its thresholds are.
    """
    most = MOST_STEPS_OF_PART
    if of_feeds > most:
        return "stages", f"{of_feeds:.3g} steps of the calculation for one part", f"at most {most:.0e}"
    if of_thresholds > most:
        found = f"thresholds that one part reaches after {of_thresholds:.3g} steps of the calculation"
        return "thresholds_v", found, f"at most {most:.0e}"
    if of_thresholds * parts > MOST_STEPS:
        found = f"{parts} parts of {of_thresholds:.3g} steps of the calculation"
        return "parts", found, f"at most {MOST_STEPS:.0e} steps in all"
    return None


TABLE = 4096
"""Points of a characteristic, evenly spread, between which the loop goes straight."""

_NO_TABLE = np.empty(0), 0.0, 1.0
"""That of a line, and of a voltage without ripple."""


def steps_per_filter(setup: GaugedGrinding) -> int:
    """Into how many steps T_Φ is cut so that noise, filter, lag and run-out are resolved."""
    filter_s = setup.gauge.time_constant_s
    longest = longest_step_s(filter_s, setup.grinding, setup.surface, setup.noise)
    return max(1, math.ceil(filter_s / longest - 1e-9))


def steps_per_part(setup: GaugedGrinding, steps: int | None = None) -> float:
    """Steps of a part of mean allowance, `steps` in T_Φ; more where thresholds come later than the sizes wanted."""
    step_s = setup.gauge.time_constant_s / (steps_per_filter(setup) if steps is None else steps)
    return max(_steps_until(setup, step_s, ends) for ends in (_wanted_um(setup), _lowest_um(setup)))


def part_plan(setup: GaugedGrinding, parts: int, steps: int | None = None) -> Plan:
    """The numbers for the loop; `steps` in T_Φ, None: as many as resolve what happens in it.

    Raises InputError for a wheel that wears too much before it is dressed, or more steps than can be waited for.
    """
    grinding, gauge, surface = setup.grinding, setup.gauge, setup.surface
    most_worn = min(parts, grinding.dress_every) if grinding.dress_every > 0 else parts
    slower = 1.0 + wear_share(grinding, most_worn - 1)
    step_s = gauge.time_constant_s / (steps_per_filter(setup) if steps is None else steps)
    lowest = _lowest_um(setup)
    of_feeds, of_thresholds = (slower * _steps_until(setup, step_s, ends) for ends in (_wanted_um(setup), lowest))
    wrong = too_long(of_feeds, max(of_feeds, of_thresholds), parts)
    if wrong is not None:
        where, found, expected = wrong
        raise InputError(found, expected=expected, where=where, advice=STEPS_ADVICE[where])
    curve, ripple = setup.characteristic, setup.crest
    table, start, step = _NO_TABLE if curve is None else _tabulated(curve.allowance_um, curve.voltage_at)
    crest, crest_from, crest_step = (
        _NO_TABLE
        if ripple is None
        else _tabulated(ripple.allowance_um, partial(ripple.crest_at, time_constant_s=gauge.time_constant_s))
    )
    turn_s = 60.0 / surface.workpiece_rpm if surface.workpiece_rpm > 0 else 0.0
    numbers: dict[str, float] = {
        "table_from": start,
        "table_step": step,
        "gain": gauge.gain_v_per_um,
        "bias": gauge.bias_v,
        "sign": -math.copysign(1.0, gauge.gain_v_per_um),
        "filter_s": gauge.time_constant_s,
        "allowance": grinding.allowance_um,
        "allowance_sd": grinding.allowance_sd_um,
        "feed_sd": grinding.feed_sd,
        "lag_s": grinding.lag_s,
        "wheel_wear": grinding.wheel_wear,
        "wear_growth": grinding.wear_growth_per_part,
        "probe_wear": grinding.probe_wear_um_per_part,
        "per_s": surface.workpiece_rpm / 60.0,
        "share": surface.groove_share,
        "depth": surface.groove_depth_um,
        "runout": surface.runout_um,
        "noise_sd": setup.noise.sd_um,
        "noise_rate": setup.noise.rate_per_s,
        "delay_s": setup.relay.delay_s,
        "relay_noise": setup.relay.noise_v,
        "hold_s": setup.relay.noise_hold_s,
        "crest_from": crest_from,
        "crest_step": crest_step,
        "step_s": step_s,
        "patience_s": 20.0 * (gauge.time_constant_s + grinding.lag_s) + 5.0 * turn_s,
    }
    # a whole number as an int would be another type, and another compilation
    return Plan(
        feed=np.array([stage.feed_um_per_s for stage in grinding.stages], dtype=np.float64),
        threshold=np.array(setup.thresholds_v, dtype=np.float64),
        limit_um=np.array(lowest, dtype=np.float64),
        table_v=table,
        crest_v=crest,
        dress_every=int(grinding.dress_every),
        grooves=int(surface.grooves) if surface.groove_depth_um > 0 else 0,
        **{name: float(value) for name, value in numbers.items()},
    )


def _tabulated(allowance_um: Vector, values_at: Callable[[Vector], Vector]) -> tuple[Vector, float, float]:
    """Values at even allowances of this range, where they begin, and how far apart they are."""
    at = np.linspace(allowance_um[0], allowance_um[-1], TABLE)
    return np.ascontiguousarray(values_at(at)), float(at[0]), float(at[1] - at[0])


def _steps_until(setup: GaugedGrinding, step_s: float, ends_um: list[float]) -> float:
    return steps_in(feeds_s(setup.grinding, setup.relay, ends_um), step_s, setup.surface, setup.relay)


def _wanted_um(setup: GaugedGrinding) -> list[float]:
    return [stage.until_um for stage in setup.grinding.stages]


def _lowest_um(setup: GaugedGrinding) -> list[float]:
    """Allowance by which each stage should have ended: the wanted one, or where its threshold is surely met [µm].

    Of a threshold that the characteristic never shows, where that ends.
    """
    gauge, surface, curve = setup.gauge, setup.surface, setup.characteristic
    margin = surface.groove_depth_um + surface.runout_um + 6.0 * setup.noise.sd_um
    if curve is None:
        reached = [(volts - gauge.bias_v) / gauge.gain_v_per_um - margin for volts in setup.thresholds_v]
    else:
        sign, reached = -math.copysign(1.0, gauge.gain_v_per_um), []
        for volts in setup.thresholds_v:
            beyond = np.flatnonzero(sign * (np.asarray(curve.voltage_v) - volts) >= 0)
            reached.append(float(curve.allowance_um[beyond[-1] if len(beyond) else 0]) - margin)
    return [min(wanted, fit) for wanted, fit in zip(_wanted_um(setup), reached, strict=True)]
