"""A ball-bar test of two axes with known errors, simulated otherwise than by the program, and written as a table.

Nothing of it is the fit's own basis or the simulation of `selector.physics.drive`: the loops are linear filters of
order three (`scipy.signal`), friction a step of force that changes over with the commanded speed, backlash the play
operator stepped through the samples, geometry exact, the reading rounded to 0.1 µm after noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import signal

RADIUS_M, FEEDS, TURN, LEAD_M = 0.1, (1000.0, 3000.0), 1800, 0.01


@dataclass(frozen=True)
class PlantedCircles:
    """Errors that are drawn at random from what machines have."""

    seed: int

    def drawn(self) -> dict[str, float]:
        """Squareness and scales [µm/m], gains [1/s], backlash, spikes and pitch [µm]."""
        rng = np.random.default_rng(self.seed)
        sign = rng.choice([-1.0, 1.0], 3)
        gain = rng.uniform(25.0, 60.0)
        return {
            "squareness": sign[0] * rng.uniform(15.0, 80.0),
            "scale": sign[1] * rng.uniform(15.0, 80.0),
            "gain X": gain,
            "gain Y": gain * (1.0 + sign[2] * rng.uniform(0.02, 0.1)),
            "backlash X": rng.uniform(3.0, 15.0),
            "backlash Y": rng.uniform(3.0, 15.0),
            "spike X": rng.uniform(2.0, 10.0),
            "spike Y": rng.uniform(2.0, 10.0),
            "pitch X": rng.uniform(1.0, 4.0),
        }

    def expected(self) -> dict[str, float]:
        """What must be found through all feeds, by the names of the result."""
        has = self.drawn()
        return {
            "squareness": has["squareness"],
            "scale mismatch": has["scale"],
            "difference of the lag times": 1e3 / has["gain X"] - 1e3 / has["gain Y"],
            **{
                f"backlash {axis}, {end} end": has[f"backlash {axis}"]
                for axis in "XY"
                for end in ("positive", "negative")
            },
        }

    def write(self, path: Path) -> Path:
        """A table of angle [°], direction, feed and length of the bar [mm], below three lines of words."""
        has, rng = self.drawn(), np.random.default_rng(1000 + self.seed)
        lines = ["Ball-bar test", f"Radius: {1e3 * RADIUS_M:.1f} mm", "Plane: XY", "angle;direction;feed;length [mm]"]
        for feed in FEEDS:
            omega = feed / 60e3 / RADIUS_M
            for way, word in ((1, "ccw"), (-1, "cw")):
                step_s = 2.0 * math.pi / omega / TURN
                time_s = np.arange(int(1.6 * TURN)) * step_s
                turned = way * (omega * time_s - 0.3 * 2.0 * math.pi)
                x = _table(time_s, np.cos(turned), has["gain X"], has["spike X"], has["backlash X"])
                y = _table(time_s, np.sin(turned), has["gain Y"], has["spike Y"], has["backlash Y"])
                x = x + 1e-6 * has["pitch X"] * np.sin(2.0 * np.pi * x / LEAD_M + 0.7)
                across = x * (1.0 + 0.5e-6 * has["scale"]) + y * 1e-6 * has["squareness"] - 12e-6
                along = y * (1.0 - 0.5e-6 * has["scale"]) + 7e-6
                length_mm = 1e3 * np.hypot(across, along) + rng.normal(0.0, 0.2e-3, len(x))
                angle = np.degrees(np.unwrap(np.arctan2(along, across)))
                kept = slice(int(0.25 * TURN), int(1.5 * TURN))
                rows = zip(angle[kept], length_mm[kept], strict=True)
                lines += [f"{one:.3f};{word};{feed:g};{length:.4f}".replace(".", ",") for one, length in rows]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path


def _table(time_s, unit_command, gain_per_s, spike_um, gap_um):
    """Where a table is [m] whose motor follows through P-PI, pushed by friction, behind a gap."""
    command = RADIUS_M * unit_command
    # m·s³ + c·s² + (i + gain·c)·s + gain·i with a stiff velocity loop, in units of the mass
    c, i = 60.0 * gain_per_s, 60.0 * gain_per_s * 8.0
    denominator = [1.0, c, i + gain_per_s * c, gain_per_s * i]
    _, follows, _ = signal.lsim(([gain_per_s * c, gain_per_s * i], denominator), command - command[0], time_s)
    speed = np.gradient(command, time_s)
    force = -np.sign(speed)
    force[0] = force[1]
    _, pushed, _ = signal.lsim(([1.0, 0.0], denominator), force, time_s)
    long_s = np.linspace(0.0, 1.0, 4001)
    _, alone = signal.step(([1.0, 0.0], denominator), T=long_s)
    motor = command[0] + follows + pushed * spike_um * 1e-6 / (2.0 * alone.max())
    half = gap_um * 0.5e-6
    table = np.empty_like(motor)
    at = motor[0]
    for k, place in enumerate(motor):
        at = min(max(at, place - half), place + half)
        table[k] = at
    return table
