"""What the compensations of a control need to take the causes of a circular test away: backlash, delay, pulses."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from scipy import optimize

from selector.physics.drive.ball_bar.causes import RADIUS_GAIN, Amount, CircleCauses, FeedCauses, SharedAmount


@dataclass(frozen=True)
class ReversalPulse:
    """What the control has to add to the set speed of an axis when it turns, amplitude·exp(−t/reset time)."""

    axis: str
    feed_mm_per_min: float
    acceleration_m_per_s2: float  #: Of the axis where it turns, v²/R: the scale of an adaptation characteristic
    height_um: Amount  #: Of the spikes that it is to take away, mean of both ends
    amplitude: Amount | None  #: In the new direction [mm/min]; None where gain or reset time is not known


@dataclass(frozen=True)
class Compensations:
    """Values for a control; what was not found is not there."""

    backlash: Mapping[str, Amount]  #: Axis → lost motion, mean of both ends [µm]
    delay: tuple[str, Amount] | None  #: The axis that is ahead, and by how long [ms]
    pulses: tuple[ReversalPulse, ...]

    @property
    def any(self) -> bool:
        """Whether there is anything to compensate."""
        return bool(self.backlash or self.delay or self.pulses)


def compensations(
    causes: CircleCauses, axes: tuple[str, ...], radius_m: float, reset_s: Mapping[str, float]
) -> Compensations:
    """What would take the causes away; `reset_s` is axis → reset time Tn of its velocity controller [s]."""
    through, backlash, delay = causes.through_feeds, dict[str, Amount](), None
    for axis in axes[:2]:
        ends = [through[f"backlash {axis}, {end} end"] for end in ("positive", "negative")]
        if all(end.found for end in ends):
            error = math.hypot(*(end.standard_error for end in ends)) / 2.0
            backlash[axis] = Amount(sum(end.value for end in ends) / 2.0, error, "µm")
    late = through.get("difference of the lag times")
    if late is not None and late.found:
        delay = (axes[1] if late.value > 0 else axes[0], Amount(abs(late.value), late.standard_error, "ms"))
    gain = through.get(RADIUS_GAIN)
    pulses = [
        _pulse(axis, feed, cause.amounts["mean"], radius_m, gain, reset_s.get(axis))
        for axis in axes[:2]
        for feed in causes.feeds
        for cause in [feed.cause("reversal-spike", axis)]
        if cause.found and cause.amounts["mean"].value > 0
    ]
    return Compensations(backlash, delay, tuple(pulses))


def _pulse(
    axis: str, feed: FeedCauses, height: Amount, radius_m: float, gain: SharedAmount | None, reset_s: float | None
) -> ReversalPulse:
    acceleration = (feed.feed_mm_per_min / 60e3) ** 2 / radius_m
    amplitude = None
    if gain is not None and reset_s is not None:

        def pulse(height_um: float, gain_per_s: float) -> float:
            return 60e3 * pulse_m_per_s(height_um * 1e-6, acceleration, gain_per_s, reset_s)

        value, by = pulse(height.value, gain.value), 1e-3
        of_height = (pulse(height.value * (1.0 + by), gain.value) - value) / by * height.standard_error / height.value
        of_gain = (pulse(height.value, gain.value * (1.0 + by)) - value) / by * gain.standard_error / gain.value
        amplitude = Amount(value, math.hypot(of_height, of_gain), "mm/min")
    return ReversalPulse(axis, feed.feed_mm_per_min, acceleration, height, amplitude)


def pulse_m_per_s(height_m: float, acceleration_m_per_s2: float, gain_per_s: float, reset_s: float) -> float:
    """Pulse that takes a spike of this height away [m/s]: dry friction 2F over the gain of the velocity controller.

    P position loop (gain Kv) around a PI velocity loop (reset time Tn) that is fast beside both. The axis sticks where
    it turned until the controller has made up for the friction that turned over, A = 2F/Kvp; meanwhile it falls behind
    by a·t²/2. What it needs at once is a step of force, which A·exp(−t/Tn) at the input of a PI controller is.
    """
    about = math.log(gain_per_s * height_m)

    def too_high(log_pulse: float) -> float:
        return spike_height_m(math.exp(log_pulse), acceleration_m_per_s2, gain_per_s, reset_s) - height_m

    return math.exp(optimize.brentq(too_high, about - 7.0, about + 25.0, maxiter=1000))


def spike_height_m(pulse_m_per_s: float, acceleration_m_per_s2: float, gain_per_s: float, reset_s: float) -> float:
    """How far a table falls behind after a reversal [m] without the pulse that it needs, see `pulse_m_per_s`.

    While it sticks, δ = a·t²/2 and δ' + Kv·δ + ∫(δ' + Kv·δ)dt/Tn rises to the pulse; then δ' + Kv·δ falls as
    exp(−t/Tn).
    """
    a, kv, rate = acceleration_m_per_s2, gain_per_s, 1.0 / reset_s

    def lacking(t: float) -> float:
        return a * t * (1.0 + (kv + rate) * t / 2.0 + rate * kv * t * t / 6.0) - pulse_m_per_s

    breaks_s = optimize.brentq(lacking, 0.0, pulse_m_per_s / a, xtol=1e-12, maxiter=1000)
    behind = a * breaks_s**2 / 2.0
    pushed = a * breaks_s + kv * behind
    if math.isclose(kv, rate, rel_tol=1e-6):
        kv *= 1.0 + 1e-5
    # δ = behind·exp(−kv·s) + pushed·(exp(−rate·s) − exp(−kv·s))/(kv − rate), and where its slope is 0
    top_s = math.log(kv * (pushed - behind * (kv - rate)) / (pushed * rate)) / (kv - rate)
    slow, fast = math.exp(-rate * top_s), math.exp(-kv * top_s)
    return behind * fast + pushed * (slow - fast) / (kv - rate)
