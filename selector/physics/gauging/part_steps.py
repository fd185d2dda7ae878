"""How fine are the steps in which a part is ground, how many are they, and what asks for too many."""

from __future__ import annotations

from collections.abc import Sequence

from selector.physics.gauging.process import Grinding, Noise, Surface
from selector.physics.gauging.threshold import removal_rate_um_per_s, wear_share
from selector.physics.gauging.transducer import Relay

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
