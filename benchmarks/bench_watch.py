"""Simulated years of machines whose models are watched: false alarms, and how soon a change is found.

    python benchmarks/bench_watch.py [--machines 60]

A machine has two thermometers and a displacement that they explain but for what no thermometer sees, which differs from
day to day. Its model is fitted to the first eight days; what it leaves of each of these, fitted to the other seven, is
what is known of its errors. Then a year of days, one recording each. From a day in the first half of the year on
something changes, by several sizes:

- gauge: the displacement shifts within the day, as a gauge that gives way while the machine warms up;
- wear: the heat of the bearing grows by so much over the rest of the year and is not seen by its thermometer;
- sensor: a thermometer loses contact, its rise shrinks;
- season: what no thermometer sees follows the year.

Where days are like the one before, by several correlations, the gauge only.

Threshold is the plain rule beside it: a day with more than three times the expected error.

The second table has machines on which nothing changes, by what differs from day to day and by the days that the model
was made of: false alarms per year of a machine, −ln(1 − share of the years with an alarm).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

sys.path.insert(0, str(Path(__file__).parents[1]))

from selector.fleet.watching import RUNS_BETWEEN_ALARMS, charted

KNOWN, YEAR, SAMPLES, STEP_S = 8, 365, 60, 600.0
NOISE_UM, UNSEEN_UM = 0.4, 0.5
SIZES = {"gauge": (0.5, 1.0, 2.0, 5.0), "wear": (0.05, 0.1, 0.3), "sensor": (0.02, 0.05, 0.2), "season": (1.0, 3.0)}
#: What no thermometer sees, from day to day; of a correlated one, how much a day is like the one before it.
DAYS = ("normal", "heavy tails", "skewed", "idle and hard days", "a chip in fifty days")
CORRELATED = (0.3, 0.6, 0.8, 0.9)


def unseen(rng: np.random.Generator, days: str | float, n: int) -> np.ndarray:
    """What no thermometer sees in n days, in units of UNSEEN_UM; `days` of DAYS, or a correlation."""
    z = rng.normal(size=n)
    if days == "heavy tails":
        return np.asarray(rng.standard_t(3.0, n))
    if days == "skewed":
        return rng.exponential(size=n) - 1.0
    if days == "idle and hard days":
        return np.asarray(z * np.where(rng.random(n) < 0.3, 3.0, 0.5))
    if days == "a chip in fifty days":
        return np.asarray(z + np.where(rng.random(n) < 0.02, rng.choice([-20.0, 20.0], n), 0.0))
    if isinstance(days, float):
        for i in range(1, n):
            z[i] = days * z[i - 1] + np.sqrt(1.0 - days**2) * z[i]
    return z


def day(
    rng: np.random.Generator, kind: str, size: float, into: float, year: float, z: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rises of the thermometers [K] and the displacement [µm]; `into` is the share of the change that has come."""
    speed = np.repeat(rng.uniform(0.0, 1.0, SAMPLES // 6), 6)

    def lagged(tau_s: float, drive: np.ndarray) -> np.ndarray:
        share = -np.expm1(-STEP_S / tau_s)
        return np.asarray(lfilter([share], [1.0, share - 1.0], drive))

    bearing, column = lagged(1200.0, 12.0 * speed), lagged(9000.0, 8.0 * speed + rng.normal(0.0, 1.0))
    bearing, column = bearing - bearing[0], column - column[0]
    course = lagged(5000.0, np.full(SAMPLES, 1.0))
    true = 1.6 * bearing - 0.9 * column + UNSEEN_UM * z * course
    if kind == "gauge":
        true = true + size * into * course
    elif kind == "wear":
        true = true + 1.6 * size * into * bearing
    elif kind == "season":
        true = true + size * np.sin(2.0 * np.pi * year) * course
    readings = np.column_stack([bearing * (1.0 - size * into if kind == "sensor" else 1.0), column])
    return readings + rng.normal(0.0, 0.05, readings.shape), true + rng.normal(0.0, NOISE_UM, SAMPLES)


def errors(
    kind: str, size: float, seed: int, of: str | float = DAYS[0], n_known: int = KNOWN
) -> tuple[np.ndarray, np.ndarray, int]:
    """Mean and root mean square error of the known and the later days, shape (2, n) each, and the day of the change."""
    rng = np.random.default_rng(seed)
    begins, z = int(rng.integers(30, YEAR // 2)), unseen(rng, of, n_known + YEAR)
    days = [day(rng, "none", 0.0, 0.0, 0.0, z[i]) for i in range(n_known)]
    x, y = (np.stack(part) for part in zip(*days, strict=True))

    def fitted(of: list[int]) -> np.ndarray:
        return np.linalg.lstsq(np.concatenate(x[of]), np.concatenate(y[of]), rcond=None)[0]

    known = [y[i] - x[i] @ fitted([j for j in range(n_known) if j != i]) for i in range(n_known)]
    model, later = fitted(list(range(n_known))), []
    for number in range(YEAR):
        grown = (number - begins) / (YEAR - begins) if kind == "wear" else 1.0
        into = grown if number >= begins and kind != "none" else 0.0
        readings, true = day(rng, kind, size, into, number / YEAR, z[n_known + number])
        later.append(true - readings @ model)
    table = [np.array([[e.mean(), np.sqrt(np.mean(e**2))] for e in of]).T for of in (known, later)]
    return table[0], table[1], begins


def alarms(known: np.ndarray, later: np.ndarray) -> tuple[int | None, int | None]:
    """First day of an alarm of the charts, and of the plain threshold."""
    apart = 3.0 * RUNS_BETWEEN_ALARMS
    mean = charted(known[0], later[0], apart, is_two_sided=True).alarm_at
    size = charted(np.log(known[1]), np.log(later[1]), apart, is_two_sided=False).alarm_at
    days = [one for one in (mean, size) if one is not None]
    beyond = np.flatnonzero(later[1] > 3.0 * np.sqrt(np.mean(known[1] ** 2)))
    return min(days, default=None), int(beyond[0]) if len(beyond) else None


def false_alarms(machines: int) -> None:
    """The table of machines on which nothing changes."""
    print(f"\nDesign: {YEAR / RUNS_BETWEEN_ALARMS:.2f} a year\n")
    known = (3, 8, 12)
    print(f"| days | {' | '.join(f'{n} known' for n in known)} | threshold, {known[1]} known |")
    print(f"|---|{'---:|' * (len(known) + 1)}")
    for days in (*DAYS, *CORRELATED):
        rates = []
        for n_known in known:
            years = [errors("none", 0.0, 1000 * seed + 11, days, n_known) for seed in range(machines)]
            found = [alarms(*year[:2]) for year in years]
            shares = [sum(one[rule] is not None for one in found) / machines for rule in (0, 1)]
            rates.append([-np.log(1.0 - min(share, 1.0 - 0.5 / machines)) for share in shares])
        cells = [str(days), *(f"{of[0]:.2f}" for of in rates), f"{rates[1][1]:.2f}"]
        print(f"| {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Prints two Markdown tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=60)
    parser.add_argument("--unchanged", type=int, default=400, help="machines of each kind in the second table")
    asked = parser.parse_args()
    machines = asked.machines
    print("| change | charts: false | found | days, median (largest) | threshold: false | found | days, median |")
    print("|---|---:|---:|---:|---:|---:|---:|")
    changes = [("none", 0.0, DAYS[0]), *((kind, size, DAYS[0]) for kind, sizes in SIZES.items() for size in sizes)]
    for kind, size, of in [*changes, *(("gauge", size, of) for size in (0.5, 1.0, 2.0) for of in CORRELATED)]:
        cells = [f"{kind} {size:g}, days {of}"]
        years = [errors(kind, size, 1000 * seed + 7, of) for seed in range(machines)]
        found = [alarms(known, later) for known, later, _ in years]
        for rule in (0, 1):
            days = [one[rule] for one in found]
            begun = [0 if kind == "season" else begins for *_, begins in years]
            if kind == "none":
                begun = [YEAR] * machines
            early = sum(day is not None and day < begins for day, begins in zip(days, begun, strict=True))
            delays = [
                day - begins + 1 for day, begins in zip(days, begun, strict=True) if day is not None and day >= begins
            ]
            middle = f"{np.median(delays):.0f}" + (f" ({max(delays)})" if rule == 0 else "") if delays else "–"
            cells += [str(early), f"{len(delays)} of {machines - early}", middle]
        print(f"| {' | '.join(cells)} |")
    false_alarms(asked.unchanged)


if __name__ == "__main__":
    main()
