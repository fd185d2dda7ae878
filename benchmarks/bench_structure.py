"""How often structure is found where there is none, and where there is; how well its windows are met.

`python benchmarks/bench_structure.py [cases]` prints two tables (about 0.3 s a case): false alarms at 1 % and power of
`unexplained` on noise of several colours, and the overlap of windows on the hidden effects of
the blind proof.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from proving_ground.scenarios import scenarios
from selector.diagnosis.matching.alignment import comparison_of
from selector.diagnosis.mismatch.location import active_windows
from selector.diagnosis.mismatch.omnibus import unexplained
from tests.diagnosis.made import coloured, comparison, door, residuals

Vector = NDArray[np.float64]
RUNS, N = 3, 600
NOISES = {"white": 0.0, "ar": 0.0, "t3": 0.0, "ar+white": 0.0, "rounded": 0.5, "coarse": 2.5}
STRUCTURES = ("door", "thermostat", "burst", "slips", "line")


def noise(kind: str, n: int, rng: np.random.Generator) -> Vector:
    """Noise of variance 1."""
    if kind == "ar+white":
        return (coloured("ar", n, rng) + coloured("white", n, rng)) / np.sqrt(2.0)
    return coloured(kind, n, rng)


def density(kind: str, frequency: Vector) -> Vector:
    """Its power at these frequencies [cycles per sample]."""
    red = (1 - 0.85**2) / np.abs(1 - 0.85 * np.exp(-2j * np.pi * frequency)) ** 2
    return np.asarray(red if kind == "ar" else np.ones(len(frequency)))


def structure(kind: str, rng: np.random.Generator) -> Vector:
    """What no channel of the record explains, of any size."""
    parts = []
    for run in range(RUNS):
        part, at = np.zeros(N), np.arange(N)
        if kind == "door":
            starts = [int(rng.integers(20, N - 60)) for _ in range(rng.integers(2, 5))]
            spans = [int(rng.integers(N // 60, N // 12)) for _ in starts]
            for a, d in zip(starts, spans, strict=True):
                part += door(N, ((a, a + d),), 0.96) - 0.7 * door(N, ((a + d, a + 2 * d),), 0.96)
        elif kind == "thermostat":
            wander = 1 + 0.25 * rng.standard_normal(N // 20 + 1).repeat(20)[:N]
            phase = np.cumsum(2 * np.pi / (N / rng.uniform(8, 16)) * wander)
            part = np.asarray(lfilter([0.1], [1, -0.9], np.sign(np.sin(phase + 6 * rng.random()))))
        elif kind == "burst" and run == 1:
            a = int(rng.integers(50, N - N // 8))
            part[a : a + N // 12] = np.sin(2 * np.pi * rng.uniform(0.1, 0.4) * at[: N // 12])
        elif kind == "slips":
            for _ in range(rng.integers(1, 4)):
                part[rng.integers(30, N - 30) :] += rng.choice([-1, 1]) * rng.uniform(0.5, 1)
        elif kind == "line":
            part = np.sin(2 * np.pi * 0.137 * at + run)
        parts.append(part)
    return np.concatenate(parts)


def strength(kind: str, course: Vector) -> float:
    """d′: the norm of the course behind the noise filter, its mean in each run taken off."""
    total = 0.0
    for part in course.reshape(RUNS, N):
        power = np.abs(np.fft.rfft(part - part.mean())) ** 2 / N
        total += 2.0 * float(np.sum(power[1:] / density(kind, np.fft.rfftfreq(N)[1:])))
    return float(np.sqrt(total))


def found(kind: str, what: str | None, d_prime: float, cases: int) -> tuple[float, Counter[str]]:
    """Share of cases in which structure is found, and of what kinds."""
    kinds: Counter[str] = Counter()
    for seed in range(cases):
        rng = np.random.default_rng(7000 + seed)
        colour = "white" if kind in ("rounded", "coarse") else kind
        made = {name: noise(colour, RUNS * N, rng) for name in ("Z", "Y")}
        if what is not None:
            course = structure(what, rng)
            course *= d_prime / np.hypot(strength(colour, course), strength(colour, 0.6 * course))
            made = {"Z": made["Z"] + course, "Y": made["Y"] - 0.6 * course}
        of = comparison(made, resolution=NOISES[kind])
        structures = unexplained(of, *residuals(of), seed=seed, false_alarm=0.01)
        kinds.update([structures[0].kind] if structures else [])
    return kinds.total() / cases, kinds


def overlaps(d_prime: float, cases: int) -> dict[str, list[float]]:
    """Scenario → intersection over union of the windows found in the residual and the true ones."""
    met: dict[str, list[float]] = defaultdict(list)
    for scenario in scenarios(names=["hidden*"]):
        for seed in range(cases):
            case = scenario.build(900 + seed, d_prime)
            truth = [window for effect in case.truth.effects for window in effect.windows]
            if not truth:
                break
            of = comparison_of(case.recording, case.simulation, responses=case.responses)
            left = residuals(of)[0]
            channel = max(case.truth.effects[0].channels, key=lambda name: _contrast(left[name]))
            masks = [np.zeros(len(of.time_s), dtype=bool) for _ in range(2)]
            for mask, windows in zip(masks, (truth, active_windows(of, channel, left[channel])), strict=True):
                for window in windows:
                    inside = (of.time_s >= window.from_s) & (of.time_s <= window.to_s)
                    mask |= inside & (of.run_index == of.runs.index(window.run))
            met[scenario.name].append(float((masks[0] & masks[1]).sum() / (masks[0] | masks[1]).sum()))
    return met


def _contrast(values: Vector) -> float:
    seen = values[np.isfinite(values)]
    return float(np.std(seen) / np.median(np.abs(np.diff(seen))))


def main() -> None:
    """Prints the tables."""
    cases = int(sys.argv[1]) if len(sys.argv) > 1 else 150
    for kind in NOISES:
        print(f"nothing in {kind:10s} {found(kind, None, 0.0, cases)}", flush=True)
    for kind in ("white", "ar"):
        for what in STRUCTURES:
            for d_prime in (6.0, 12.0):
                print(f"{what:10s} in {kind:6s} d'={d_prime:4g} {found(kind, what, d_prime, cases)}", flush=True)
    for d_prime in (6.0, 12.0, 25.0, 60.0):
        met = overlaps(d_prime, max(1, cases // 50))
        everything = [value for values in met.values() for value in values]
        print(
            f"windows d'={d_prime:4g} median {np.median(everything):.2f}", {k: np.round(v, 2) for k, v in met.items()}
        )


if __name__ == "__main__":
    main()
