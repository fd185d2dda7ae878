"""What is gauged: grinding with its feed and wear, the surface under the probe, what size is wanted.

The *allowance* is what is still to be ground off, counted from the nominal size [µm]; a finished part's size is the
allowance that is left. It falls at a rate a (G eq. 1).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from selector.errors import InputError
from selector.physics.checks import require_finite, require_not_negative, require_positive


@dataclass(frozen=True)
class Stage:
    """A feed that holds until the gauge gives the next command.

    Attributes
    ----------
    feed_um_per_s : float
        Infeed of the wheel, on the same count as the allowance [µm/s].
    until_um : float
        Allowance at which the next stage, or the end, is wanted [µm].
    """

    feed_um_per_s: float
    until_um: float

    def __post_init__(self) -> None:
        require_positive(self, "feed_um_per_s")
        require_finite(self, "until_um")


@dataclass(frozen=True)
class Grinding:
    """How the allowance of a part falls.

    Attributes
    ----------
    allowance_um, allowance_sd_um : float
        Mean and standard deviation over the parts at the start [µm].
    stages : tuple of Stage
        The last one's `until_um` is x_k, the size at which the feed is to stop.
    feed_sd : float
        Standard deviation of the feed from part to part, as a share.
    lag_s : float
        Time constant with which removal follows infeed: springs of the machine over sharpness of the wheel [s].
    wheel_wear : float
        Radius that the wheel loses, as a share of what it removes, when freshly dressed: the allowance falls slower.
    wear_growth_per_part, dress_every : float, int
        The share grows by this with every part, as a share of itself, and is as at first again after so many parts;
        0: never dressed.
    probe_wear_um_per_part : float
        Length that the tip loses: the gauge sees so much less allowance than there is, stops earlier, and leaves each
        part larger by it than the one before [µm].
    """

    allowance_um: float
    stages: tuple[Stage, ...]
    allowance_sd_um: float = 0.0
    feed_sd: float = 0.0
    lag_s: float = 0.0
    wheel_wear: float = 0.0
    wear_growth_per_part: float = 0.0
    dress_every: int = 0
    probe_wear_um_per_part: float = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "allowance_um")
        require_not_negative(
            self, "allowance_sd_um", "feed_sd", "lag_s", "wheel_wear", "wear_growth_per_part", "dress_every"
        )
        require_finite(self, "probe_wear_um_per_part")
        ends = [self.allowance_um, *(stage.until_um for stage in self.stages)]
        if not self.stages or any(b >= a for a, b in pairwise(ends)):
            raise InputError(
                f"stages until {', '.join(f'{end:g}' for end in ends[1:]) or 'nowhere'} µm of {self.allowance_um:g} µm",
                expected="at least one stage, each ending at less allowance than the one before",
                where="stages",
                advice="sort the stages; the first begins at allowance_um",
            )
        if self.wheel_wear >= 1.0:
            raise InputError(
                f"{self.wheel_wear:g}: the wheel loses more than it removes",
                expected="a share below 1",
                where="wheel_wear",
                advice="give the loss of radius over the removed allowance",
            )


@dataclass(frozen=True)
class Surface:
    """What the probe meets on a turn of the workpiece: grooves, keyways or holes, and run-out.

    Attributes
    ----------
    workpiece_rpm : float
        [r/min].
    grooves : int
        Interruptions on the circumference; 0: a whole surface.
    groove_share : float
        Part of the circumference that they take.
    groove_depth_um : float
        How much deeper the probe reaches in them [µm].
    runout_um : float
        Amplitude of the once-per-turn change of the allowance [µm].
    """

    workpiece_rpm: float = 0.0
    grooves: int = 0
    groove_share: float = 0.0
    groove_depth_um: float = 0.0
    runout_um: float = 0.0

    def __post_init__(self) -> None:
        require_not_negative(self, "workpiece_rpm", "grooves", "groove_share", "groove_depth_um", "runout_um")
        turning = self.grooves > 0 or self.runout_um > 0
        wrong = (
            ("groove_share", f"grooves on {self.groove_share:g} of the circumference")
            if self.groove_share >= 1.0 or (self.grooves > 0 and self.groove_share == 0)
            else ("workpiece_rpm", "a workpiece that stands still")
            if turning and self.workpiece_rpm == 0
            else None
        )
        if wrong is not None:
            raise InputError(
                wrong[1],
                expected="a share between 0 and 1, and a speed, where the surface has grooves or run-out",
                where=wrong[0],
                advice="correct it, or leave grooves and run-out at 0",
            )


@dataclass(frozen=True)
class Noise:
    """What the gauge sees besides the allowance: centred, Gaussian, R(τ) = D·exp(−β|τ|) (G eq. 2).

    Attributes
    ----------
    sd_um : float
        √D_x [µm].
    rate_per_s : float
        β [1/s].
    """

    sd_um: float = 0.0
    rate_per_s: float = 100.0

    def __post_init__(self) -> None:
        require_not_negative(self, "sd_um")
        require_positive(self, "rate_per_s")


@dataclass(frozen=True)
class Tolerance:
    """Limits of the finished size, counted from the nominal size.

    Attributes
    ----------
    lower_um, upper_um : float
        [µm].
    """

    lower_um: float
    upper_um: float

    def __post_init__(self) -> None:
        require_finite(self, "lower_um", "upper_um")
        if self.lower_um >= self.upper_um:
            raise InputError(
                f"[{self.lower_um:g}, {self.upper_um:g}] µm",
                expected="a lower and an upper limit",
                where="lower_um",
                advice="exchange the two numbers",
            )
