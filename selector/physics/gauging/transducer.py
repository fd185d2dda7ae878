"""The parts of a vibrating-contact gauge: electromagnet, probe, contact, generator, rectifier with filter, relay (G).

The magnet's coil hangs on an alternating voltage at ω0; it pulls with the square of its current, so the probe swings at
2ω0. Where it reaches the workpiece the contact takes away stroke. The generator turns what stroke is left into a
voltage, which is rectified, smoothed and compared with a threshold.
"""

from __future__ import annotations

from dataclasses import dataclass

from selector.errors import InputError
from selector.physics.checks import require_finite, require_not_negative, require_positive


@dataclass(frozen=True)
class Electromagnet:
    """Coil and core: L·i' + R·i = V0·sin(ω0·t), pull = force_n_per_a2·i² at rest, (gap/(gap − z))² of it at z.

    Attributes
    ----------
    voltage_v, frequency_hz : float
        V0, ω0/2π of the supply [V], [Hz].
    resistance_ohm, inductance_h : float
        R, L [Ω], [H].
    force_n_per_a2 : float
        Pull at the rest position [N/A²].
    gap_m : float or None
        Air gap at rest [m]; None: the pull does not depend on the position.
    """

    voltage_v: float
    frequency_hz: float
    resistance_ohm: float
    inductance_h: float
    force_n_per_a2: float
    gap_m: float | None = None

    def __post_init__(self) -> None:
        require_positive(self, "voltage_v", "frequency_hz", "resistance_ohm", "force_n_per_a2", "gap_m")
        require_not_negative(self, "inductance_h")


@dataclass(frozen=True)
class Probe:
    """The swinging part: m·z'' + d·z' + c·z = pull − contact force.

    Attributes
    ----------
    mass_kg, stiffness_n_per_m, damping_ns_per_m : float
        m, c, d [kg], [N/m], [N·s/m].
    """

    mass_kg: float
    stiffness_n_per_m: float
    damping_ns_per_m: float

    def __post_init__(self) -> None:
        require_positive(self, "mass_kg", "stiffness_n_per_m", "damping_ns_per_m")


@dataclass(frozen=True)
class Contact:
    """Tip against workpiece where they overlap by δ > 0: k·δ^p·(1 + λ·δ'), never pulling.

    Hunt and Crossley (1975), J. Appl. Mech. 42(2), 440–445: the damping vanishes with the overlap.

    Attributes
    ----------
    stiffness : float
        k [N/m^p].
    exponent : float
        p: 1.5 for a ball on a flat (Hertz), 1 for a spring.
    damping_s_per_m : float
        λ [s/m].
    """

    stiffness: float
    exponent: float = 1.5
    damping_s_per_m: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "stiffness", "exponent")
        require_not_negative(self, "damping_s_per_m")
        if self.exponent < 1.0:
            raise InputError(
                f"{self.exponent:g}: infinitely stiff where it begins",
                expected="1 or more: 1 for a spring, 1.5 for a ball on a flat",
                where="exponent",
                advice="correct this parameter",
            )


@dataclass(frozen=True)
class Generator:
    """Coil on a permanent magnet: T_Γ·u' + u = −W·dΦ/dt, Φ = flux_wb·gap/(gap − z).

    Attributes
    ----------
    turns : float
        W.
    flux_wb, gap_m : float
        Flux at rest [Wb]; air gap at rest [m].
    time_constant_s : float
        T_Γ, of the coil with its load [s]; 0: none.
    """

    turns: float
    flux_wb: float
    gap_m: float
    time_constant_s: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "turns", "flux_wb", "gap_m")
        require_not_negative(self, "time_constant_s")


@dataclass(frozen=True)
class Smoothing:
    """Full-wave rectifier and first-order filter: T_Φ·S' + S = |u|.

    Attributes
    ----------
    time_constant_s : float
        T_Φ [s].
    """

    time_constant_s: float

    def __post_init__(self) -> None:
        require_positive(self, "time_constant_s")


@dataclass(frozen=True)
class Relay:
    """Comparison with a threshold, and what follows it: the command stands `delay_s` after the voltage reached it.

    Attributes
    ----------
    delay_s : float
        From the comparison to the feed standing still [s].
    noise_v : float
        Standard deviation of noise on the compared voltage, without memory from one value to the next [V].
    noise_hold_s : float
        How long a value of this noise lasts, until the next is drawn: of a relay that samples, its period [s].
    """

    delay_s: float = 0.0
    noise_v: float = 0.0
    noise_hold_s: float = 0.01

    def __post_init__(self) -> None:
        require_not_negative(self, "delay_s", "noise_v")
        require_positive(self, "noise_hold_s")


@dataclass(frozen=True)
class Transducer:
    """A whole gauge.

    Attributes
    ----------
    electromagnet : Electromagnet
    probe : Probe
    contact : Contact
    generator : Generator
    smoothing : Smoothing
    relay : Relay
    rest_gap_m : float
        From the tip at rest to a workpiece that is just to size, allowance 0 [m]; an allowance stands nearer by itself.
    """

    electromagnet: Electromagnet
    probe: Probe
    contact: Contact
    generator: Generator
    smoothing: Smoothing
    relay: Relay = Relay()
    rest_gap_m: float = 0.0

    def __post_init__(self) -> None:
        require_finite(self, "rest_gap_m")


@dataclass(frozen=True)
class LinearGauge:
    """The gauge as G eq. 20 has it: T_Φ·S' + S = gain·x + bias, for allowances x around `allowance_um`.

    Attributes
    ----------
    gain_v_per_um : float
        K [V/µm]; negative: less allowance, more stroke.
    bias_v : float
        Voltage that belongs to allowance 0 on this line [V].
    time_constant_s : float
        T_Φ [s].
    allowance_um : float
        Where the line touches the true characteristic [µm].
    """

    gain_v_per_um: float
    bias_v: float
    time_constant_s: float
    allowance_um: float = 0.0

    def __post_init__(self) -> None:
        require_finite(self, "gain_v_per_um", "bias_v", "allowance_um")
        require_positive(self, "time_constant_s")
