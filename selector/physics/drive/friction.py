"""What resists or ripples along the way: dry friction of guide and screw, bristles, cogging of the motor."""

from __future__ import annotations

from dataclasses import dataclass

from selector.physics.checks import require_finite, require_not_negative, require_positive


@dataclass(frozen=True)
class LuGre:
    """Bristles of the guide before it slides: z' = v − σ0·|v|/g(v)·z, force σ0·z + σ1·z'.

    g(v) is the sliding friction of the same `Friction`. Canudas de Wit, Olsson, Åström, Lischinsky (1995), IEEE
    Trans. Autom. Control 40(3), 419–425.

    Attributes
    ----------
    stiffness_n_per_m : float
        σ0 [N/m].
    damping_ns_per_m : float
        σ1 [N·s/m].
    fading_speed_m_per_s : float
        σ1 falls as exp(−(v/v_d)²), so that sliding is not damped twice and friction stays passive; 0: it does not fall.
    """

    stiffness_n_per_m: float
    damping_ns_per_m: float = 0.0
    fading_speed_m_per_s: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "stiffness_n_per_m")
        require_not_negative(self, "damping_ns_per_m", "fading_speed_m_per_s")


@dataclass(frozen=True)
class Friction:
    """Dry friction of the guide on the table's speed, and of the screw on its own; viscous friction is damping.

    Sliding: ``sgn(v)·(C + (S − C)·exp(−(|v|/v_s)^δ))`` with C, S of the direction. At rest it holds whatever is less
    than S. All zero: no friction.

    Attributes
    ----------
    coulomb_n : float
        C for v > 0 [N].
    coulomb_negative_n : float or None
        C for v < 0 [N], as a positive number; None: as for v > 0.
    static_n, static_negative_n : float or None
        Breakaway S of the two directions [N]; None: equal to C, no Stribeck effect. If nothing is given for v < 0,
        both C and S are those of v > 0.
    stribeck_speed_m_per_s, stribeck_exponent : float
        v_s, δ; they matter only where S differs from C.
    offset_n : float
        Constant force against the positive direction: weight, cable [N].
    screw_coulomb_nm : float
        Dry friction of screw and bearings on the screw's speed [N·m]; three-mass axis only.
    lugre : LuGre or None
        Friction with memory instead of the jump at v = 0.
    """

    coulomb_n: float = 0.0
    coulomb_negative_n: float | None = None
    static_n: float | None = None
    static_negative_n: float | None = None
    stribeck_speed_m_per_s: float = 0.01
    stribeck_exponent: float = 2.0
    offset_n: float = 0.0
    screw_coulomb_nm: float = 0.0
    lugre: LuGre | None = None

    def __post_init__(self) -> None:
        require_not_negative(
            self, "coulomb_n", "coulomb_negative_n", "static_n", "static_negative_n", "screw_coulomb_nm"
        )
        require_positive(self, "stribeck_speed_m_per_s", "stribeck_exponent")
        require_finite(self, "offset_n")

    @property
    def directions(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(C, S) for v > 0, and for v < 0 [N]."""
        up = (self.coulomb_n, self.coulomb_n if self.static_n is None else self.static_n)
        if self.coulomb_negative_n is None and self.static_negative_n is None:
            return up, up
        coulomb = self.coulomb_n if self.coulomb_negative_n is None else self.coulomb_negative_n
        return up, (coulomb, coulomb if self.static_negative_n is None else self.static_negative_n)


@dataclass(frozen=True)
class Ripple:
    """One harmonic of the actuator: cogging, amplitude·sin(n·φ + phase), and ripple, a share of its own force.

    φ is 2π per `period` of motor position (2π rad for a motor that turns, the pole pitch in metres for a rigid axis).

    Attributes
    ----------
    harmonic : float
        n, periods per `period`.
    cogging : float
        Amplitude that does not depend on the current [N·m], or [N] for a rigid axis.
    share : float
        Amplitude as a share of the actuator's force.
    phase_rad : float
        Phase [rad].
    """

    harmonic: float
    cogging: float = 0.0
    share: float = 0.0
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "harmonic")
        require_finite(self, "cogging", "share", "phase_rad")
