"""What is gauged and by what: grinding with its wear, surfaces, parts of a gauge, what voltage stops the feed (G)."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from selector.errors import InputError, Misfit
from selector.physics.checks import ABOVE_0, FROM_0, Above0, Checked, Finite, From0
from selector.physics.gauging import _swing as at
from selector.physics.model_fields import Fit, Limits, Unit, Usual
from selector.types import Vector

_SECONDS = {"ms": 1e-3, "µs": 1e-6}
_TURNING, _CHANGING = Usual(2.0, 5e3, {"1/s": 60.0}), Usual(0.05, 1e5, {"1/ms": 1e3})
_SIZE = {"mm": 1e3, "nm": 1e-3, "m": 1e6}
_FEED = {"mm/min": 1e3 / 60, "µm/min": 1 / 60, "mm/s": 1e3, "m/s": 1e6}


@dataclass(frozen=True)
class Stage(Checked):
    """A feed that holds until the gauge gives the next command."""

    #: Infeed of the wheel, on the same count as the allowance [µm/s]
    feed_um_per_s: Annotated[Above0, Unit("µm/s"), Limits(1e-6, 1e6), Fit(), Usual(0.3, 300.0, _FEED)]
    #: Allowance at which the next stage, or the end, is wanted [µm]
    until_um: Annotated[Finite, Unit("µm"), Limits(0.0, 1e6), Fit(either_sign=50.0), Usual(0.0, 1e3, _SIZE)]


@dataclass(frozen=True)
class Grinding(Checked):
    """How the allowance of a part falls."""

    #: allowance_um and allowance_sd_um: Mean and standard deviation over the parts at the start [µm]
    allowance_um: Annotated[Above0, Unit("µm"), Limits(0.0, 1e6), Fit(), Usual(3.0, 3e3, _SIZE)]
    stages: tuple[Stage, ...]  #: The last one's `until_um` is x_k, the size at which the feed is to stop
    allowance_sd_um: Annotated[From0, Unit("µm"), Limits(0.0, 1e6), Fit(up_to=50.0)] = 0.0
    #: Standard deviation of the feed from part to part, as a share; with more some parts would not be fed at all
    feed_sd: Annotated[From0, Limits(0.0, 0.25), Fit(up_to=0.2)] = 0.0
    #: Time constant with which removal follows infeed: springs of the machine over sharpness of the wheel [s]
    lag_s: Annotated[From0, Unit("s"), Limits(1e-9, 1e4), Fit(up_to=5.0), Usual(0.0, 20.0, _SECONDS)] = 0.0
    #: Radius that the wheel loses, as a share of what it removes, when freshly dressed: the allowance falls slower
    wheel_wear: Annotated[From0, Limits(0.0, 1e3), Fit(up_to=0.5), Usual(0.0, 0.95, {"%": 0.01})] = 0.0
    #: wear_growth_per_part and dress_every: The share grows by this with every part, as a share of itself, and is as at
    #: first again after so many parts; 0: never dressed
    wear_growth_per_part: Annotated[From0, Unit("1/part"), Limits(0.0, 10.0), Fit(up_to=0.1)] = 0.0
    dress_every: Annotated[int, FROM_0, Limits(0, 1000000000)] = 0
    #: Length that the tip loses: the gauge sees so much less allowance than there is, stops earlier, and leaves each
    #: part larger by it than the one before [µm]
    probe_wear_um_per_part: Annotated[Finite, Unit("µm/part"), Limits(0.0, 1e3), Fit(either_sign=0.1)] = 0.0

    def _misfits(self) -> Iterator[Misfit]:
        ends = [self.allowance_um, *(stage.until_um for stage in self.stages)]
        if not self.stages or any(b >= a for a, b in pairwise(ends)):
            until = ", ".join(f"{end:g}" for end in ends[1:]) or "nowhere"
            expected = "at least one stage, each ending at less allowance than the one before"
            advice = "sort the stages; the first begins at allowance_um"
            yield f"stages until {until} µm of {self.allowance_um:g} µm", expected, "stages", advice
        if self.wheel_wear >= 1.0:
            found = f"{self.wheel_wear:g}: the wheel loses more than it removes"
            yield found, "a share below 1", "wheel_wear", "give the loss of radius over the removed allowance"


@dataclass(frozen=True)
class Surface(Checked):
    """What the probe meets on a turn of the workpiece: grooves, keyways or holes, and run-out."""

    #: [r/min]
    workpiece_rpm: Annotated[From0, Unit("r/min"), Limits(0.0, 1e6), Fit(), _TURNING] = 0.0
    grooves: Annotated[int, FROM_0, Limits(0, 10000)] = 0  #: Interruptions on the circumference; 0: a whole surface
    #: Part of the circumference that they take
    groove_share: Annotated[From0, Limits(0.0, 1.0), Fit(low=0.0, high=0.95)] = 0.0
    #: How much deeper the probe reaches in them [µm]
    groove_depth_um: Annotated[From0, Unit("µm"), Limits(0.0, 1e6), Fit(up_to=1e3), Usual(0.0, 3e4, {"nm": 1e-3})] = 0.0
    #: Amplitude of the once-per-turn change of the allowance [µm]
    runout_um: Annotated[From0, Unit("µm"), Limits(0.0, 1e6), Fit(up_to=20.0), Usual(0.0, 200.0, {"nm": 1e-3})] = 0.0

    def _misfits(self) -> Iterator[Misfit]:
        expected = "a share between 0 and 1, and a speed, where the surface has grooves or run-out"
        advice = "correct it, or leave grooves and run-out at 0"
        if self.groove_share >= 1.0 or (self.grooves > 0 and self.groove_share == 0):
            yield f"grooves on {self.groove_share:g} of the circumference", expected, "groove_share", advice
        if (self.grooves > 0 or self.runout_um > 0) and self.workpiece_rpm == 0:
            yield "a workpiece that stands still", expected, "workpiece_rpm", advice


@dataclass(frozen=True)
class Noise(Checked):
    """What the gauge sees besides the allowance: centred, Gaussian, R(τ) = D·exp(−β|τ|) (G eq. 2)."""

    #: √D_x [µm]
    sd_um: Annotated[From0, Unit("µm"), Limits(0.0, 1e6), Fit(up_to=5.0), Usual(0.0, 20.0, {"nm": 1e-3})] = 0.0
    #: β [1/s]
    rate_per_s: Annotated[Above0, Unit("1/s"), Limits(1e-6, 1e7), Fit(), _CHANGING] = 100.0


@dataclass(frozen=True)
class Correction(Checked):
    """Finished parts are measured, and the zero of the gauge follows what they are off."""

    share: Annotated[Above0, Limits(1e-6, 1.0)]  #: Of what a part is off, by which the zero is then moved
    #: Standard deviation of the measurement of a finished part [µm]
    gauge_sd_um: Annotated[From0, Unit("µm"), Limits(0.0, 1e6), Usual(0.0, 20.0, {"nm": 1e-3})] = 0.0
    parts_late: Annotated[int, FROM_0, Limits(0, 1000)] = 0  #: Parts that are ground while one waits to be measured

    def _misfits(self) -> Iterator[Misfit]:
        # Levin and May (1976), J. Math. Biol. 3, 323–324
        most = 2.0 * math.sin(0.5 * math.pi / (2 * self.parts_late + 1))
        if self.share >= most:
            found = f"{self.share:g} of what a part is off, {self.parts_late} parts late"
            expected = f"less than {most:.3g}: from there on each correction overshoots the one before"
            yield found, expected, "share", "correct by a smaller share, or measure sooner"

    def followed_um(self, off_um: Vector) -> Vector:
        """What parts are off that would be off by `off_um`, shape (n_parts,), measured without noise [µm]."""
        steps = np.zeros(self.parts_late + 2)
        steps[:2] = 1.0, -1.0
        fed_back = steps.copy()
        fed_back[-1] += self.share
        return np.asarray(lfilter(steps, fed_back, off_um))


@dataclass(frozen=True)
class Tolerance(Checked):
    """Limits of the finished size, counted from the nominal size."""

    #: lower_um and upper_um: [µm]
    lower_um: Annotated[Finite, Unit("µm"), Limits(0.0, 1e6), Usual(0.05, 500.0, _SIZE)]
    upper_um: Annotated[Finite, Unit("µm"), Limits(0.0, 1e6), Usual(0.05, 500.0, _SIZE)]

    def _misfits(self) -> Iterator[Misfit]:
        if self.lower_um >= self.upper_um:
            found = f"[{self.lower_um:g}, {self.upper_um:g}] µm"
            yield found, "a lower and an upper limit", "lower_um", "exchange the two numbers"


def surface_um(surface: Surface, turn: ArrayLike) -> Vector:
    """What is seen besides the allowance after so many turns: −depth in grooves, and a sine of the run-out [µm]."""
    at = np.asarray(turn, dtype=np.float64)
    seen = surface.runout_um * np.sin(2 * math.pi * at)
    if surface.grooves:
        seen = seen - surface.groove_depth_um * (np.mod(surface.grooves * at, 1.0) < surface.groove_share)
    return np.asarray(seen)


def mean_surface_um(surface: Surface) -> float:
    """Mean of `surface_um` over a turn: a linear gauge sees so much less allowance than there is [µm]."""
    return -surface.groove_depth_um * surface.groove_share if surface.grooves else 0.0


def smoothed_surface(surface: Surface, time_constant_s: float, turn: ArrayLike) -> tuple[Vector, Vector]:
    """`surface_um` behind a filter of T_Φ when it has settled, and its rate; shapes of `turn` [µm], [µm/s].

    Sine by its amplitude and phase; grooves exactly, as pieces of exponentials that repeat.
    """
    at = np.asarray(turn, dtype=np.float64)
    value, rate = np.zeros_like(at), np.zeros_like(at)
    per_s = surface.workpiece_rpm / 60.0
    if surface.runout_um > 0:
        omega = 2 * math.pi * per_s
        size, behind = surface.runout_um / math.hypot(1.0, omega * time_constant_s), math.atan(omega * time_constant_s)
        value = value + size * np.sin(2 * math.pi * at - behind)
        rate = rate + size * omega * np.cos(2 * math.pi * at - behind)
    if surface.grooves and surface.groove_depth_um > 0:
        pitch = 1.0 / (surface.grooves * per_s) / time_constant_s
        share = surface.groove_share
        # from 0 towards 1 within a groove, and back to 0 until the next; in the unit −depth
        deepest = -math.expm1(-share * pitch) / -math.expm1(-pitch)
        least = deepest * math.exp(-(1.0 - share) * pitch)
        within = np.mod(surface.grooves * at, 1.0)
        inside = within < share
        filled = np.where(
            inside, 1.0 - (1.0 - least) * np.exp(-within * pitch), deepest * np.exp(-(within - share) * pitch)
        )
        value = value - surface.groove_depth_um * filled
        rate = rate - surface.groove_depth_um * (inside - filled) / time_constant_s
    return value, rate


_GAIN = {"mV/µm": 1e-3, "V/mm": 1e-3, "V/nm": 1e3, "V/m": 1e-6}
_GAP = Usual(2e-5, 0.01, {"mm": 1e-3, "µm": 1e-6})


@dataclass(frozen=True)
class Electromagnet(Checked):
    """Coil and core: (L·i)' + R·i = V0·sin(ω0·t), pull = force_n_per_a2·i² at rest, (gap/(gap − z))² of it at z."""

    #: voltage_v and frequency_hz: V0, ω0/2π of the supply [V], [Hz]
    voltage_v: Annotated[Above0, Unit("V"), Limits(0.0, 1e9), Fit(), Usual(0.5, 500.0, {"kV": 1e3, "mV": 1e-3})]
    frequency_hz: Annotated[
        Above0, Unit("Hz"), Limits(1e-3, 1e6), Fit(), Usual(5.0, 5e3, {"kHz": 1e3, "1/min": 1 / 60})
    ]
    #: resistance_ohm and inductance_h: R, L [Ω], [H]
    resistance_ohm: Annotated[Above0, Unit("Ω"), Limits(1e-6, 1e9), Fit(), Usual(0.5, 1e5, {"kΩ": 1e3, "mΩ": 1e-3})]
    inductance_h: Annotated[
        From0, Unit("H"), Limits(0.0, 1e6), Fit(up_to=1.0), Usual(1e-5, 50.0, {"mH": 1e-3, "µH": 1e-6})
    ]
    #: Pull at the rest position [N/A²]
    force_n_per_a2: Annotated[Above0, Unit("N/A²"), Limits(1e-9, 1e9), Fit()]
    #: Air gap at rest [m]; None: the pull does not depend on the position
    gap_m: Annotated[float | None, ABOVE_0, Unit("m"), Limits(1e-9, 1.0), Fit(), _GAP] = None
    #: Whether L rises with the motion, by dL/dz = 2·pull/i², so that the motion acts on the current; else it stays
    motion_in_coil: bool = False

    def _misfits(self) -> Iterator[Misfit]:
        of_gap_h = 2.0 * self.force_n_per_a2 * (self.gap_m or math.inf)
        if self.motion_in_coil and of_gap_h > self.inductance_h:
            expected = "gap_m, and at least 2·force_n_per_a2·gap_m: so much belongs to the gap, by energy"
            where = "inductance_h" if self.gap_m is not None else "gap_m"
            advice = "correct inductance, force and gap, or leave motion_in_coil out"
            yield f"{self.inductance_h:g} H of a coil on which the motion acts", expected, where, advice


@dataclass(frozen=True)
class Probe(Checked):
    """The swinging part: m·z'' + d·z' + c·z = pull − contact force."""

    #: mass_kg, stiffness_n_per_m and damping_ns_per_m: m, c, d [kg], [N/m], [N·s/m]
    mass_kg: Annotated[Above0, Unit("kg"), Limits(1e-9, 1e3), Fit(), Usual(1e-4, 1.0, {"g": 1e-3})]
    stiffness_n_per_m: Annotated[
        Above0, Unit("N/m"), Limits(1e-3, 1e13), Fit(), Usual(20.0, 1e7, {"N/mm": 1e3, "N/µm": 1e6})
    ]
    damping_ns_per_m: Annotated[Above0, Unit("N·s/m"), Limits(1e-9, 1e9), Fit()]


@dataclass(frozen=True)
class Contact(Checked):
    """Tip against workpiece where they overlap by δ > 0: k·δ^p·(1 + λ·δ'), never pulling.

    Hunt and Crossley (1975), J. Appl. Mech. 42(2), 440–445: the damping vanishes with the overlap.
    """

    stiffness: Annotated[Above0, Unit("N/m^p"), Limits(1e-3, 1e15), Fit()]  #: k [N/m^p]
    exponent: Annotated[Above0, Limits(0.5, 3.0)] = 1.5  #: p: 1.5 for a ball on a flat (Hertz), 1 for a spring
    damping_s_per_m: Annotated[From0, Unit("s/m"), Limits(0.0, 1e6), Fit(up_to=2.0)] = 0.0  #: λ [s/m]

    def _misfits(self) -> Iterator[Misfit]:
        if self.exponent < 1.0:
            expected = "1 or more: 1 for a spring, 1.5 for a ball on a flat"
            yield f"{self.exponent:g}: infinitely stiff where it begins", expected, "exponent", "correct this parameter"


@dataclass(frozen=True)
class Generator(Checked):
    """Coil on a permanent magnet: T_Γ·u' + u = −W·dΦ/dt, Φ = flux_wb·gap/(gap − z)."""

    turns: Annotated[Above0, Limits(1e-3, 1e7), Fit(), Usual(5.0, 1e5)]  #: W
    #: flux_wb and gap_m: Flux at rest [Wb]; air gap at rest [m]
    flux_wb: Annotated[Above0, Unit("Wb"), Limits(1e-15, 1e3), Fit(), Usual(1e-8, 0.01, {"mWb": 1e-3, "µWb": 1e-6})]
    gap_m: Annotated[Above0, Unit("m"), Limits(1e-9, 1.0), Fit(), _GAP]
    #: T_Γ, of the coil with its load [s]; 0: none
    time_constant_s: Annotated[From0, Unit("s"), Limits(1e-9, 1e4), Fit(), Usual(0.0, 1.0, _SECONDS)] = 0.0
    #: Pull of the permanent magnet on the probe at rest, where the spring holds it [N]; (gap/(gap − z))² of it at z
    pull_n: Annotated[From0, Unit("N"), Limits(1e-9, 1e6), Usual(0.0, 100.0, {"mN": 1e-3})] = 0.0


@dataclass(frozen=True)
class Smoothing(Checked):
    """Full-wave rectifier and first-order filter: T_Φ·S' + S = |u|."""

    #: T_Φ [s]
    time_constant_s: Annotated[Above0, Unit("s"), Limits(1e-9, 1e4), Fit(), Usual(1e-3, 5.0, _SECONDS)]


@dataclass(frozen=True)
class Relay(Checked):
    """Comparison with a threshold, and what follows it: the command stands `delay_s` after the voltage reached it."""

    #: From the comparison to the feed standing still [s]
    delay_s: Annotated[From0, Unit("s"), Limits(1e-9, 1e4), Fit(up_to=0.2), Usual(0.0, 0.5, _SECONDS)] = 0.0
    #: Standard deviation of noise on the compared voltage, without memory from one value to the next [V]
    noise_v: Annotated[From0, Unit("V"), Limits(0.0, 1e9), Fit(up_to=0.1), Usual(0.0, 1.0, {"mV": 1e-3})] = 0.0
    #: How long a value of this noise lasts, until the next is drawn: of a relay that samples, its period [s]
    noise_hold_s: Annotated[Above0, Unit("s"), Limits(1e-9, 1e4), Fit(), Usual(1e-5, 1.0, _SECONDS)] = 0.01


@dataclass(frozen=True)
class Transducer(Checked):
    """A whole gauge."""

    electromagnet: Electromagnet
    probe: Probe
    contact: Contact
    generator: Generator
    smoothing: Smoothing
    relay: Relay = Relay()
    #: From the tip at rest to a workpiece that is just to size, allowance 0 [m]; an allowance stands nearer by itself
    rest_gap_m: Annotated[
        Finite, Unit("m"), Limits(1e-9, 1.0), Fit(either_sign=1e-3), Usual(0.0, 3e-3, {"µm": 1e-6, "mm": 1e-3})
    ] = 0.0

    def _misfits(self) -> Iterator[Misfit]:
        most_n = 0.5 * self.probe.stiffness_n_per_m * self.generator.gap_m
        if self.generator.pull_n >= most_n:
            found = f"a permanent magnet that pulls with {self.generator.pull_n:g} N"
            expected = f"less than {most_n:.4g} N, half of stiffness · gap: from there on no spring holds the probe"
            advice = "stiffen the probe, widen the gap of the generator, or lower the pull"
            yield found, expected, "generator.pull_n", advice


@dataclass(frozen=True)
class LinearGauge(Checked):
    """The gauge as G eq. 20 has it: T_Φ·S' + S = gain·x + bias, for allowances x around `allowance_um`."""

    #: K [V/µm]; negative: less allowance, more stroke
    gain_v_per_um: Annotated[Finite, Unit("V/µm"), Limits(1e-12, 1e6), Fit(), Usual(2e-4, 2.0, _GAIN)]
    #: Voltage that belongs to allowance 0 on this line [V]
    bias_v: Annotated[Finite, Unit("V"), Limits(0.0, 1e9), Fit(either_sign=1.0)]
    #: T_Φ [s]
    time_constant_s: Annotated[Above0, Unit("s"), Limits(1e-9, 1e4), Fit(), Usual(1e-3, 5.0, _SECONDS)]
    #: Where the line touches the true characteristic [µm]
    allowance_um: Annotated[Finite, Unit("µm"), Limits(0.0, 1e6)] = 0.0


FAR_M = 1.0  #: A workpiece at this distance is out of reach.
STEPS_PER_ROUND, STEPS_PER_KNOT = 50_000, 1000


def packed(transducer: Transducer, relative_tolerance: float) -> Vector:
    """Parameters of the compiled swing; the filter is the transducer's own, time 0 a zero crossing of the supply."""
    magnet, probe, generator = transducer.electromagnet, transducer.probe, transducer.generator
    p = np.zeros(at.PARAMETERS)
    mains = 2.0 * math.pi * magnet.frequency_hz
    reactance = mains * magnet.inductance_h
    p[at.MAINS], p[at.PHASE] = mains, math.atan2(reactance, magnet.resistance_ohm)
    p[at.CURRENT] = magnet.voltage_v / math.hypot(magnet.resistance_ohm, reactance)
    p[at.PULL], p[at.MAGNET] = magnet.force_n_per_a2, 1.0 / magnet.gap_m if magnet.gap_m is not None else 0.0
    p[at.MASS], p[at.DAMPING], p[at.STIFFNESS] = probe.mass_kg, probe.damping_ns_per_m, probe.stiffness_n_per_m
    p[at.CONTACT], p[at.EXPONENT] = transducer.contact.stiffness, transducer.contact.exponent
    p[at.CONTACT_DAMPING] = transducer.contact.damping_s_per_m
    p[at.INDUCED], p[at.CORE] = generator.turns * generator.flux_wb / generator.gap_m, 1.0 / generator.gap_m
    p[at.CORE_PULL], p[at.COIL_S] = generator.pull_n, generator.time_constant_s
    p[at.VOLTS], p[at.LEAD] = magnet.voltage_v if magnet.motion_in_coil else 0.0, p[at.PHASE]
    p[at.OHMS], p[at.HENRYS] = magnet.resistance_ohm, magnet.inductance_h
    p[at.RATE], p[at.LEAK] = 1.0 / transducer.smoothing.time_constant_s, 1.0
    p[at.LONGEST], p[at.ERROR] = round_s(transducer) / 12.0, relative_tolerance
    push = 0.5 * p[at.PULL] * p[at.CURRENT] ** 2
    dynamic = math.hypot(p[at.STIFFNESS] - p[at.MASS] * (2 * mains) ** 2, 2 * mains * p[at.DAMPING])
    swing = push / min(dynamic, p[at.STIFFNESS])
    volts = p[at.INDUCED] * 2 * mains * swing / math.hypot(1.0, 2 * mains * p[at.COIL_S])
    p[at.SCALES :] = swing, 2 * mains * swing, volts, volts, p[at.CURRENT]
    return p


def widen_scales(p: Vector, probe_m: float, probe_m_per_s: float, plane_m: float) -> None:
    """Errors count against what a start or a workpiece makes of the swing, where that is more than the pull does."""
    frequency = max(math.sqrt(p[at.STIFFNESS] / p[at.MASS]), 2.0 * p[at.MAINS])
    swing = max(abs(probe_m), abs(probe_m_per_s) / frequency, -plane_m)
    p[at.SCALES :] *= max(1.0, swing / p[at.SCALES])


def round_s(transducer: Transducer) -> float:
    """Period of the pull, half of one of the supply [s]."""
    return 0.5 / transducer.electromagnet.frequency_hz


def refusal(ended: int, transducer: Transducer) -> InputError:
    """Why a swing could not go on."""
    gaps_m = {
        at.MAGNET_REACHED: ("electromagnet", transducer.electromagnet.gap_m or 0.0),
        at.CORE_REACHED: ("generator", transducer.generator.gap_m),
    }
    if ended in gaps_m:
        part, gap_m = gaps_m[ended]
        return InputError(
            f"the probe swings across the air gap of the {part} ({1e3 * gap_m:g} mm)",
            expected="a swing that stays off the core",
            where=f"{part}.gap_m",
            advice="widen the gap, stiffen the probe, or lower voltage_v or force_n_per_a2",
        )
    return InputError(
        f"more than {STEPS_PER_ROUND} steps in half a period of the supply",
        expected="a contact and a generator that a simulation can follow",
        where="transducer",
        advice="correct contact.stiffness; give generator.time_constant_s = 0 in place of less than a microsecond",
    )


def wear_share(grinding: Grinding, part: int = 0) -> float:
    """Radius that the wheel loses over what it removes, at this part of the batch, the first being 0.

    Raises InputError if it has grown to 1 or more: the wheel then loses more than it removes.
    """
    since = part % grinding.dress_every if grinding.dress_every > 0 else part
    exponent = since * math.log1p(grinding.wear_growth_per_part)
    share = grinding.wheel_wear * math.exp(min(exponent, 700.0)) if grinding.wheel_wear > 0 else 0.0
    if share >= 1.0:
        raise InputError(
            f"the wheel loses {share:.3g} of what it removes at part {part + 1}",
            expected="a share that stays below 1 until the wheel is dressed",
            where="wear_growth_per_part",
            advice="dress more often (dress_every), or lower wheel_wear or its growth",
        )
    return share


def removal_rate_um_per_s(feed_um_per_s: float, wear: float) -> float:
    """How fast the allowance falls, a = feed/(1 + wear) (G eq. 1) [µm/s]; `wear`: loss of the wheel over removal."""
    return feed_um_per_s / (1.0 + wear)


def threshold_v(gauge: LinearGauge, until_um: float, rate_um_per_s: float, delay_s: float = 0.0) -> float:
    """Voltage at which the command must be given so that the mean allowance is `until_um` when it acts (G eq. 23) [V].

    S_n = K·(x_k + a·(T_Φ + delay_s)) + bias. `delay_s` is the relay's; for the last command add lag_s, because what
    the springs still hold is taken off after the feed stands.
    """
    ahead_s = gauge.time_constant_s + delay_s
    return gauge.bias_v + gauge.gain_v_per_um * (until_um + rate_um_per_s * ahead_s)


def stage_thresholds_v(gauges: Sequence[LinearGauge], grinding: Grinding, relay: Relay) -> tuple[float, ...]:
    """Thresholds by eq. 23 for a freshly dressed wheel, relay delay and run-on of the springs included.

    `gauges` has the line of each stage. A stage that is too short for the transient of the one before ends early or
    late.
    """
    wear = wear_share(grinding)
    last = len(grinding.stages) - 1
    return tuple(
        threshold_v(
            gauge,
            stage.until_um,
            removal_rate_um_per_s(stage.feed_um_per_s, wear),
            relay.delay_s + (grinding.lag_s if number == last else 0.0),
        )
        for number, (gauge, stage) in enumerate(zip(gauges, grinding.stages, strict=True))
    )


def voltage_variance_v2(gauge: LinearGauge, noise: Noise) -> float:
    """Variance of the smoothed voltage: D_x·K²/(1 + β·T_Φ) (G eq. 25) [V²].

    A lag of the removal does not change it: the noise is in what the gauge sees, not in what the wheel removes.
    """
    return (noise.sd_um * gauge.gain_v_per_um) ** 2 / (1.0 + noise.rate_per_s * gauge.time_constant_s)


def voltage_rate_sd_v_per_s(gauge: LinearGauge, noise: Noise) -> float:
    """Standard deviation of the rate of the smoothed noise, |K|·√(D_x·β/(T_Φ·(1 + β·T_Φ))) [V/s].

    From T_Φ·ε' = K·f − ε (G eq. 24) with cov(f, ε) = K·D_x/(1 + β·T_Φ). Without the filter noise of R = D·exp(−β|τ|)
    has no rate.
    """
    filter_s, beta = gauge.time_constant_s, noise.rate_per_s
    return abs(gauge.gain_v_per_um) * noise.sd_um * math.sqrt(beta / (filter_s * (1.0 + beta * filter_s)))


@dataclass(frozen=True, eq=False)
class RippleCrest:
    """Peaks of the ripple over allowances that stay."""

    #: allowance_um and crest_v: (n_points,): Increasing [µm]; highest smoothed voltage above its mean [V]
    allowance_um: Vector
    crest_v: Vector
    time_constant_s: float  #: T_Φ of the filter behind which that is [s]
    frequency_hz: float  #: Of the rectified swing, at which the ripple is [Hz]

    def crest_at(self, allowance_um: ArrayLike, time_constant_s: float) -> Vector:
        """Peaks behind a filter of this T_Φ, shape of `allowance_um` [V]; beyond the points that of the nearest one.

        A ripple at ω passes a filter by 1/√(1 + (ω·T_Φ)²).
        """
        omega = 2 * math.pi * self.frequency_hz
        less = math.hypot(1.0, omega * self.time_constant_s) / math.hypot(1.0, omega * time_constant_s)
        return np.asarray(less * np.interp(np.asarray(allowance_um, dtype=np.float64), self.allowance_um, self.crest_v))
