"""How long does a part take, how often is it looked at, and is that too much to be calculated or held."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

from selector.physics.gauging.model_parts import FileParts, file_parts
from selector.physics.gauging.model_schema import MOST_SAMPLES, MOST_STEPS, GaugingFile
from selector.physics.gauging.part_steps import (
    FEWEST_SIZES,
    STEPS_ADVICE,
    STEPS_PER_CORRELATION,
    STEPS_PER_FILTER,
    STEPS_PER_LAG,
    STEPS_PER_TURN,
    feeds_s,
    longest_step_s,
    steps_in,
    too_long,
)
from selector.physics.gauging.threshold import removal_rate_um_per_s, wear_share
from selector.physics.model_text import Contradiction, Key

MOST_RECORDED = 50
"""Parts that are recorded in full; of more only the sizes are kept."""

_PER_FILTER = 5
_PER_TURN = 20
_PER_GROOVE = 8
_SHORT_FILTER_S = 1e-3
_FEWEST, _MOST = 500, 20_000
"""Samples of a part, where the file does not say how often it is looked at."""


def planned_s(parts: FileParts) -> float:
    """How long a freshly dressed wheel needs for a part of mean allowance, with the lags of removal and filter [s]."""
    grinding = parts.grinding
    return grinding_s(parts, grinding.allowance_um) + 5.0 * grinding.lag_s + parts.filter_s + parts.relay.delay_s


def grinding_s(parts: FileParts, allowance_um: float) -> float:
    """The time that feed alone needs from this allowance to the end of the last stage [s]."""
    stages, wear = parts.grinding.stages, wear_share(parts.grinding)
    ends = (allowance_um, *(stage.until_um for stage in stages))
    return sum(
        (before - after) / removal_rate_um_per_s(stage.feed_um_per_s, wear)
        for (before, after), stage in zip(pairwise(ends), stages, strict=True)
    )


def sampling_s(file: GaugingFile, parts: FileParts) -> float:
    """Time between the samples: what the file says, or what shows filter, turns and grooves [s]."""
    if file.run.period_s is not None:
        return file.run.period_s
    duration_s = planned_s(parts)
    wanted = min(finest_s(parts), duration_s / _FEWEST)
    return _rounded(max(wanted, duration_s / _MOST))


def finest_s(parts: FileParts) -> float:
    """The longest time between samples that still shows filter, turns and grooves [s]."""
    surface = parts.surface
    wanted = [parts.filter_s / _PER_FILTER]
    if surface.runout_um > 0:
        wanted.append(60.0 / surface.workpiece_rpm / _PER_TURN)
    if surface.grooves > 0 and surface.groove_depth_um > 0:
        wanted.append(60.0 / surface.workpiece_rpm / surface.grooves / _PER_GROOVE)
    return min(wanted)


def length_contradictions(file: GaugingFile) -> Iterator[Contradiction]:
    """Parts that take too many samples to be held, or all of them too many to be waited for."""
    parts = file_parts(file)
    duration_s, period_s = planned_s(parts), sampling_s(file, parts)
    key = ("run", "period_s") if file.run.period_s is not None else ("grinding", "stages")
    samples = duration_s / period_s
    if samples < 2:
        found = f"a period of {period_s:g} s, and a part takes {duration_s:.3g} s"
        yield key, found, "a period that is shorter than a part", "shorten run.period_s, or leave it out"
    elif samples > MOST_SAMPLES:
        found = f"{samples:.3g} samples of a part that takes {duration_s:.3g} s"
        yield key, found, f"at most {MOST_SAMPLES}", "lengthen run.period_s, or give the feeds the right power of ten"
    elif samples * file.run.parts > MOST_STEPS:
        found = f"{file.run.parts} parts of {samples:.3g} samples"
        expected = f"at most {MOST_STEPS} samples of all parts"
        yield ("run", "parts"), found, expected, "take fewer parts, or lengthen run.period_s"
    else:
        yield from _fine_steps(file, parts)


def _fine_steps(file: GaugingFile, parts: FileParts) -> Iterator[Contradiction]:
    """Sizes that would take too many steps of the calculation, however seldom a part is looked at."""
    grinding, surface, relay = parts.grinding, parts.surface, parts.relay
    step_s = longest_step_s(parts.filter_s, grinding, surface, parts.noise)
    wanted = [stage.until_um for stage in grinding.stages]
    ends = wanted
    if file.thresholds is not None and parts.linear is not None:
        line = parts.linear
        reached = [(volts - line.bias_v) / line.gain_v_per_um for volts in file.thresholds.volts]
        ends = [min(pair) for pair in zip(wanted, reached, strict=True)]
    of_feeds, of_thresholds = (
        steps_in(feeds_s(grinding, relay, until), step_s, surface, relay) for until in (wanted, ends)
    )
    wrong = too_long(of_feeds, of_thresholds, max(file.run.parts, FEWEST_SIZES))
    if wrong is None:
        return
    where, found, expected = wrong
    key: Key = ("thresholds", "volts") if where == "thresholds_v" else ("run", "parts")
    if where == "stages" or (where == "parts" and file.run.parts <= FEWEST_SIZES):
        where, key = "stages", _asks_for_steps(file, parts)
    yield key, found, expected, STEPS_ADVICE[where]


def _asks_for_steps(file: GaugingFile, parts: FileParts) -> Key:
    """The key that makes steps so many: whatever asks for many more than a usual filter, else the feeds."""
    surface, noise, relay, grinding = parts.surface, parts.noise, parts.relay, parts.grinding
    line = file.transducer is None
    turns_per_s = surface.workpiece_rpm / 60.0
    per_s: dict[Key, float] = {
        ("grinding", "stages"): STEPS_PER_FILTER / _SHORT_FILTER_S,
        ("linear" if line else "transducer", *(() if line else ("smoothing",)), "time_constant_s"): (
            STEPS_PER_FILTER / parts.filter_s
        ),
        ("noise", "rate_per_s"): STEPS_PER_CORRELATION * noise.rate_per_s if noise.sd_um > 0 else 0.0,
        ("grinding", "lag_s"): STEPS_PER_LAG / grinding.lag_s if 0 < grinding.lag_s < parts.filter_s else 0.0,
        ("surface", "workpiece_rpm"): STEPS_PER_TURN * turns_per_s if surface.runout_um > 0 else 0.0,
        ("surface", "grooves"): 2.0 * surface.grooves * turns_per_s if surface.groove_depth_um > 0 else 0.0,
        (*(() if line else ("transducer",)), "relay", "noise_hold_s"): (
            1.0 / relay.noise_hold_s if relay.noise_v > 0 else 0.0
        ),
    }
    return max(per_s, key=lambda key: per_s[key])


def _rounded(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above a value."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(times * power for times in (5.0, 2.0, 1.0) if times * power <= value * (1.0 + 1e-9))
