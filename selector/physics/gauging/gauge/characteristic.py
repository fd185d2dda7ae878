"""What voltage belongs to which allowance in the long run, and the line that stands for it (G eq. 15–20)."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from selector.errors import InputError
from selector.findings import Finding
from selector.physics.gauging.finding_table import FINDINGS
from selector.physics.gauging.gauge.transducer import LinearGauge, Transducer
from selector.physics.gauging.gauge.vibrating_contact import IRREGULAR_ROUNDS, SteadySwing, steady_swing
from selector.physics.ranges import true_stretches
from selector.types import Mask, Vector

POINTS = 60
_FALLS = 1e-6  #: A voltage that falls by less than this share of the largest one stands still.
#: Two swings at one allowance are the same if their voltages differ by less than this share of the largest one.
_SAME = 1e-3


@dataclass(frozen=True, eq=False)
class Characteristic:
    """Mean smoothed voltage over allowances that stay, monotone cubics (PCHIP) between the points."""

    #: allowance_um and voltage_v: (n_points,): Increasing [µm]; [V]
    allowance_um: Vector
    voltage_v: Vector
    crest_v: Vector | None = None  #: (n_points,): Highest smoothed voltage above its mean [V]
    #: A0, half the stroke without workpiece: how far the range of the gauge reaches beyond `touch_um`, at most [µm]
    free_amplitude_um: float | None = None
    #: Allowance at which the free swing just touches: below it the gauge shows nothing [µm]
    touch_um: float | None = None
    findings: tuple[Finding, ...] = ()  #: Swings that never repeat or are not the only one

    def __post_init__(self) -> None:
        for values in (self.allowance_um, self.voltage_v):
            values.flags.writeable = False

    @cached_property
    def _curve(self) -> PchipInterpolator:
        return PchipInterpolator(self.allowance_um, self.voltage_v)

    def voltage_at(self, allowance_um: ArrayLike) -> Vector:
        """Voltages at allowances of any shape [V]; beyond the points that of the nearest one."""
        within = np.clip(np.asarray(allowance_um, dtype=np.float64), self.allowance_um[0], self.allowance_um[-1])
        return np.asarray(self._curve(within), dtype=np.float64)

    def slope_at(self, allowance_um: ArrayLike) -> Vector:
        """Slopes at allowances of any shape [V/µm]; beyond the points 0."""
        at = np.asarray(allowance_um, dtype=np.float64)
        inside = (at >= self.allowance_um[0]) & (at <= self.allowance_um[-1])
        return np.where(inside, self._curve.derivative()(np.where(inside, at, self.allowance_um[0])), 0.0)

    @cached_property
    def monotone_um(self) -> tuple[float, float]:
        """The longest range of allowances over which the voltage falls all the way [µm].

        Raises InputError if it falls nowhere.
        """
        first, last = self._monotone
        return float(self.allowance_um[first]), float(self.allowance_um[last])

    @cached_property
    def _monotone(self) -> tuple[int, int]:
        falls = np.diff(self.voltage_v) < -_FALLS * np.abs(self.voltage_v).max()
        if not falls.any():
            raise InputError(
                f"a voltage that falls nowhere from {self.allowance_um[0]:g} to {self.allowance_um[-1]:g} µm",
                expected="a voltage that falls with the allowance",
                where="characteristic",
                advice="let the swing reach the workpiece: rest_gap_m, voltage_v of the magnet",
            )
        starts, stops = true_stretches(falls).T
        longest = int(np.argmax(self.allowance_um[stops] - self.allowance_um[starts]))
        return int(starts[longest]), int(stops[longest])

    def allowance_at(self, voltage_v: ArrayLike) -> Vector:
        """Allowances that belong to voltages, in the monotone range [µm].

        Raises InputError if a voltage belongs to none.
        """
        first, last = self._monotone
        high, low = self.voltage_v[first], self.voltage_v[last]
        wanted = np.asarray(voltage_v, dtype=np.float64)
        if not ((wanted >= low) & (wanted <= high)).all():
            outside = wanted[~((wanted >= low) & (wanted <= high))].flat[0]
            raise InputError(
                f"{outside:.6g} V",
                expected=f"a voltage from {low:.6g} V to {high:.6g} V, which is from {self.allowance_um[last]:.5g} µm "
                f"down to {self.allowance_um[first]:.5g} µm of allowance",
                where="characteristic",
                advice="stay within this range, or set the gauge nearer or farther (rest_gap_m)",
            )
        above_it = last - np.searchsorted(self.voltage_v[first : last + 1][::-1], wanted, side="right")
        piece = np.clip(above_it, first, last - 1)
        c3, c2, c1, c0 = (self._curve.c[n][piece] for n in range(4))
        below, above = np.zeros(wanted.shape), np.diff(self.allowance_um)[piece]
        for _ in range(52):
            middle = 0.5 * (below + above)
            over = ((c3 * middle + c2) * middle + c1) * middle + c0 > wanted
            below, above = np.where(over, middle, below), np.where(over, above, middle)
        return np.asarray(self.allowance_um[piece] + 0.5 * (below + above), dtype=np.float64)


def characteristic(transducer: Transducer) -> Characteristic:
    """Steady swings at allowances, come to from larger ones as in grinding; once more upwards, to find other swings.

    They are `POINTS`, from a little below the first touch to where the probe's rest position or the end of A = A0 − x
    is, closer where the swing begins to touch.

    Raises InputError if the free swing reaches a core.
    """
    free = steady_swing(transducer, None)
    rest_um, amplitude_um = 1e6 * transducer.rest_gap_m, 0.5 * free.stroke_um
    touch_um = rest_um - free.highest_um
    end = max(rest_um, touch_um + amplitude_um) + 0.01 * amplitude_um
    before = [touch_um - 0.05 * amplitude_um, touch_um]
    allowance = np.r_[before, touch_um + (end - touch_um) * np.linspace(0.0, 1.0, POINTS - 1)[1:] ** 1.5]
    fallen: list[SteadySwing] = []
    risen: list[SteadySwing] = []
    for swings, order in ((fallen, allowance[::-1]), (risen, allowance)):
        start = free.state
        for at_um in order:
            swing = steady_swing(transducer, float(at_um), start=start)
            start = swing.state
            swings.append(swing)
    fallen.reverse()
    return Characteristic(
        allowance_um=allowance,
        voltage_v=np.array([swing.voltage_v for swing in fallen]),
        crest_v=np.array([swing.crest_v for swing in fallen]),
        free_amplitude_um=amplitude_um,
        touch_um=touch_um,
        findings=tuple(_findings(fallen, risen, free.voltage_v)),
    )


def linear_gauge(characteristic: Characteristic, at_um: float, time_constant_s: float) -> LinearGauge:
    """The line that touches the characteristic at an allowance (G eq. 20).

    Raises InputError if the voltage does not fall there.
    """
    low, high = characteristic.monotone_um
    gain = float(characteristic.slope_at(at_um))
    if not low <= at_um <= high or gain >= 0.0:
        raise InputError(
            f"{at_um:g} µm, where the voltage does not fall with the allowance",
            expected=f"an allowance between {low:.5g} and {high:.5g} µm",
            where="at_um",
            advice="set the gauge nearer or farther (rest_gap_m), or choose another size",
        )
    return LinearGauge(gain, float(characteristic.voltage_at(at_um)) - gain * at_um, time_constant_s, at_um)


def linear_range_um(characteristic: Characteristic, gauge: LinearGauge, tolerance_um: float) -> tuple[float, float]:
    """Allowances around that of the line between which it is wrong by at most a tolerance of size [µm]."""

    def wrong(at_um: Vector) -> Mask:
        line = gauge.bias_v + gauge.gain_v_per_um * at_um
        return np.abs(characteristic.voltage_at(at_um) - line) > tolerance_um * abs(gauge.gain_v_per_um)

    middle = gauge.allowance_um
    low, high = (_edge(wrong, middle, float(end)) for end in characteristic.allowance_um[[0, -1]])
    return low, high


def _edge(wrong: Callable[[Vector], Mask], right_um: float, end_um: float) -> float:
    """The allowance nearest to a right one, on the way to the end of the points, behind which something is wrong."""
    way = np.linspace(right_um, end_um, 2001)
    first = int(np.argmax(np.concatenate([wrong(way), [True]])))
    if first == len(way):
        return end_um
    right, off = way[first - 1], way[first]
    for _ in range(50):
        middle = 0.5 * (right + off)
        right, off = (right, middle) if wrong(np.array([middle]))[0] else (middle, off)
    return float(right)


def _findings(fallen: Sequence[SteadySwing], risen: Sequence[SteadySwing], most_v: float) -> Iterator[Finding]:
    irregular = [swing for swing in fallen if swing.rounds == 0]
    if irregular:
        worst = max(swing.voltage_sd_v for swing in irregular)
        yield FINDINGS.finding(
            "irregular-swing",
            f"{_at(irregular)} the impacts never repeat: mean voltages over {IRREGULAR_ROUNDS} periods of the "
            f"pull, or fewer, are known to {1e3 * worst:.2g} mV only, and the smoothed voltage wanders.",
            evidence={"allowance_um": [swing.allowance_um for swing in irregular], "voltage_sd_v": worst},
        )
    several = [swing for swing in fallen if swing.rounds > 1]
    if several:
        most = max(swing.rounds for swing in several)
        yield FINDINGS.finding(
            "swing-of-several-rounds",
            f"{_at(several)} the swing repeats only after {'2' if most == 2 else f'2 to {most}'} periods of the "
            "pull: the probe does not touch in every one alike.",
            evidence={"allowance_um": [swing.allowance_um for swing in several], "rounds": most},
        )
    other = [
        (down, up)
        for down, up in zip(fallen, risen, strict=True)
        if abs(down.voltage_v - up.voltage_v) > _SAME * most_v + 4.0 * (down.voltage_sd_v + up.voltage_sd_v)
    ]
    if other:
        apart = max(abs(down.voltage_v - up.voltage_v) for down, up in other)
        yield FINDINGS.finding(
            "two-swings",
            f"{_at([down for down, _ in other])} two swings can last, up to {apart:.3g} V apart: the voltage "
            "depends on where the allowance came from. Shown is what comes of a larger one.",
            evidence={"allowance_um": [down.allowance_um for down, _ in other], "apart_v": apart},
        )


def _at(swings: Sequence[SteadySwing]) -> str:
    allowances = [swing.allowance_um for swing in swings]
    low, high = min(allowances), max(allowances)
    if len(allowances) == 1:
        return f"At {low:.4g} µm"
    return f"At {len(allowances)} allowances from {low:.4g} to {high:.4g} µm"
