"""What touch-offs leave of the error of a model on days that it drifted to: measured and simulated.

    python benchmarks/bench_adaptation.py [--ace FOLDER] [--seeds 5] [--refit]

`FOLDER` has ACE_X.xlsx and ACE_Y.xlsx of srivathsan902/Thermal_Compensation_Webpage (commit 24ffb56, code/Datasets; no
licence: evaluation in place): a lathe, 18 days, 5 thermometers and the hall, the thermal error of a diameter. The file
has no times; a sample is taken to be two minutes here, as days of about seven hours. Every day is predicted by least
squares on the other days (rises of all thermometers).

The simulated machine has two thermometers, a model that was fitted to its first six days, and 18 later days, two weeks
apart: the hall follows the season and adds what no thermometer sees, the bearing wears, each day has an offset, and
where it is said the gauge is moved by 8 µm within three of the days. Ten hours a day, a sample a minute, 0.3 µm noise.

Every figure is over all samples of all judged days, each sample with what was known before it and each day with what
the other days taught. `reset`: the offset is the last reading. A touch-off that is not believed is repeated at the next
sample. False: 5 % of the touch-offs are off by ± 50 µm, and none is repeated. Taken out: the same touch-offs are not
there at all, as if somebody knew which are false; the rest of the cost is what believing and doubting does. A few draws
say little: which touch-off of which day is lost counts for more.

With --refit another table: the coefficients fitted anew at every touch-off, by least squares to the old recordings and
all touch-offs so far, of earlier days too; each touch-off counts as one sample, or as an hour of samples; or to the
touch-offs alone, once there are three a coefficient.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from selector.adaptation.drift import LAST_READING, Course, known_before
from selector.adaptation.judged import Judged, judged

HOURS = (1.0, 2.0, 4.0)
DRAWS = 40
"""Draws of what is false, all machines together: four of the lathe at two hours cost 12 %, forty 2.5 %."""
NOTHING = np.zeros(0, dtype=np.intp)


Days = list[tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Of each day: time [s], columns of the model, displacement [µm]."""


def simulated_days(seed: int, *, has_drift: bool = True, is_moved: bool = False) -> Days:
    """24 days of a machine; the first six make the model."""
    rng = np.random.default_rng(seed)
    return [_day(rng, day, has_drift=has_drift, is_moved=is_moved) for day in range(24)]


def simulated(seed: int, *, has_drift: bool = True, is_moved: bool = False) -> list[Course]:
    """The 18 later days of a machine, with the predictions of a model of its first six."""
    days = simulated_days(seed, has_drift=has_drift, is_moved=is_moved)
    x = np.concatenate([temperatures for _, temperatures, _ in days[:6]])
    y = np.concatenate([displacement for _, _, displacement in days[:6]])
    coefficients = np.linalg.lstsq(x, y, rcond=None)[0]
    return [
        Course(f"d{k}", time_s, temperatures @ coefficients, displacement, NOTHING, np.zeros(0))
        for k, (time_s, temperatures, displacement) in enumerate(days)
        if k >= 6
    ]


def _day(
    rng: np.random.Generator, day: int, *, has_drift: bool, is_moved: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    time_s = np.arange(0.0, 36_001.0, 60.0)
    n, year = len(time_s), 2.0 * np.pi * 14.0 * day / 365.0
    speed = np.repeat(rng.uniform(0.0, 1.0, 10), 61)[:n]
    fast, slow = np.zeros(n), np.zeros(n)
    for k in range(1, n):
        fast[k] = fast[k - 1] + 60.0 / 1800.0 * (9.0 * speed[k] - fast[k - 1])
        slow[k] = slow[k - 1] + 60.0 / 9000.0 * (14.0 * speed[k] - slow[k - 1])
    temperatures = np.column_stack([fast, slow]) + rng.normal(0.0, 0.05, (n, 2))
    displacement = 2.5 * fast + 1.5 * slow + rng.normal(0.0, 0.3, n)
    if has_drift:
        hall = (6.0 * np.sin(year) + rng.normal(0.0, 1.0)) * np.sin(np.pi * time_s / 36_000.0)
        wear = 1.0 + 0.006 * day
        walk = np.cumsum(rng.normal(0.0, 0.08, n))
        displacement = wear * displacement + 0.8 * hall + rng.normal(0.0, 2.0) + walk
        if is_moved and day in (9, 14, 20):
            displacement[rng.integers(n // 4, 3 * n // 4) :] += 8.0
    return time_s, temperatures, displacement


def ace_days(folder: Path) -> Days:
    """The 18 days of the lathe."""
    import pandas as pd

    tables = [pd.read_excel(folder / name, sheet_name=None, engine="calamine") for name in ("ACE_X.xlsx", "ACE_Y.xlsx")]
    x = [np.asarray(sheet, dtype=float) for sheet in tables[0].values()]
    y = [np.asarray(sheet, dtype=float)[:, -1] for sheet in tables[1].values()]
    rises = [np.column_stack([np.ones(len(day)), day - day[0]]) for day in x]
    return [(120.0 * np.arange(len(day)), rise, day - day[0]) for rise, day in zip(rises, y, strict=True)]


def ace(folder: Path) -> list[Course]:
    """The 18 days of the lathe, each predicted by the others."""
    days, courses = ace_days(folder), []
    for k, (time_s, rises, moved) in enumerate(days):
        others = [day for i, day in enumerate(days) if i != k]
        fit = np.linalg.lstsq(
            np.concatenate([x for _, x, _ in others]), np.concatenate([y for *_, y in others]), rcond=None
        )[0]
        courses.append(Course(f"d{k + 1}", time_s, rises @ fit, moved, NOTHING, np.zeros(0)))
    return courses


def refitted_rmse_um(old: Sequence[Days], days: Days, period_s: float, weight: float) -> float:
    """Coefficients fitted anew at every touch-off to old recordings (of each day, those of it) and to all touch-offs.

    `weight` of a touch-off in samples; inf: the old recordings count no more once there are three a coefficient.
    """
    squares, n = [], days[0][1].shape[1]
    touched, answer = np.zeros((n, n)), np.zeros(n)
    count = 0
    for before, (time_s, x, y) in zip(old, days, strict=True):
        old_x = np.concatenate([one for _, one, _ in before])
        start, goal = old_x.T @ old_x, old_x.T @ np.concatenate([one for *_, one in before])
        at = Course("", time_s, y, y, NOTHING, np.zeros(0)).touched_every(period_s).touched_at
        for first, last in zip([0, *(at + 1)], [*(at + 1), len(y)], strict=True):
            if np.isinf(weight) and count >= 3 * n:
                fit = np.linalg.lstsq(touched, answer, rcond=None)[0]
            else:
                share = 0.0 if np.isinf(weight) else weight
                fit = np.linalg.lstsq(start + share * touched, goal + share * answer, rcond=None)[0]
            squares.append((y[first:last] - x[first:last] @ fit) ** 2)
            if first < last and last - 1 in at:
                touched, answer = touched + np.outer(x[last - 1], x[last - 1]), answer + y[last - 1] * x[last - 1]
                count += 1
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def refitted(options: argparse.Namespace) -> None:
    """The table of --refit."""
    machines: dict[str, list[tuple[list[Days], Days, float]]] = {}
    for name, is_moved in (("simulated", False), ("simulated, gauge moved", True)):
        several = [simulated_days(seed, is_moved=is_moved) for seed in range(options.seeds)]
        machines[name] = [([days[:6]] * 18, days[6:], 60.0) for days in several]
    if options.ace is not None:
        days = ace_days(options.ace)
        machines["lathe"] = [([[*days[:k], *days[k + 1 :]] for k in range(len(days))], days, 30.0)]
    print("| machine | touch-off every | refitted, as a sample | as an hour | touch-offs alone |")
    print("|---|---|---:|---:|---:|")
    for name, several in machines.items():
        for hours in HOURS:
            found = [
                _joint([refitted_rmse_um(old, days, 3600.0 * hours, weight(hour)) for old, days, hour in several])
                for weight in (lambda _: 1.0, lambda hour: hour, lambda _: np.inf)
            ]
            print(f"| {name} | {hours:g} h | {' | '.join(f'{one:.2f}' for one in found)} |", flush=True)


def reset_rmse_um(courses: Sequence[Course]) -> float:
    """With the last reading as offset."""
    left = [
        one.recorded_um[one.judged] - one.modelled_um[one.judged] - known_before(LAST_READING, one).added_um
        for one in courses
    ]
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2)))


def without_false_readings(courses: Sequence[Course], false: Sequence[Course]) -> list[Course]:
    """The touch-offs of `courses` that are the same in `false`."""
    kept = [one.touched_um == other.touched_um for one, other in zip(courses, false, strict=True)]
    return [one.touched(one.touched_at[of], one.touched_um[of]) for one, of in zip(courses, kept, strict=True)]


def with_false_readings(courses: Sequence[Course], seed: int) -> list[Course]:
    """One touch-off in twenty is off by 50 µm, to either side."""
    rng, found = np.random.default_rng(seed), []
    for one in courses:
        n = len(one.touched_at)
        off = np.where(rng.random(n) < 0.05, rng.choice([-50.0, 50.0], n), 0.0)
        found.append(one.touched(one.touched_at, one.touched_um + off))
    return found


def row(name: str, several: Sequence[Sequence[Course]]) -> None:
    """A line of the table for each period; several machines are counted together."""
    for hours in HOURS:
        touched = [[one.touched_every(3600.0 * hours) for one in courses] for courses in several]
        of = [judged(courses, 3600.0 * hours) for courses in several]
        shares = [(one.overall.interval_share, len(one.runs)) for one in of if one.overall.interval_share is not None]
        held = f"{np.average([s for s, _ in shares], weights=[n for _, n in shares]):.1%}" if shares else "–"
        kinds = sorted({one.kind for one in of})
        reset = _joint([reset_rmse_um(courses) for courses in touched])
        cost, known_cost, reset_cost = cost_of_false_readings(touched)
        print(
            f"| {name} | {hours:g} h | {_joint([one.overall.before_rmse_um or 0.0 for one in of]):.1f} | "
            f"{_joint([one.overall.without_rmse_um or 0.0 for one in of]):.2f} | {reset:.2f} | {_of(of):.2f} | "
            f"{', '.join(kinds)} | {held} | {cost:+.1%} | {known_cost:+.1%} | {reset_cost:+.0%} |",
            flush=True,
        )


def cost_of_false_readings(touched: Sequence[Sequence[Course]]) -> tuple[float, float, float]:
    """By how much the errors grow over some draws: adapted, without these readings, with the last one as offset."""
    clean = _of([judged(courses, None) for courses in touched])
    draws = max(1, DRAWS // len(touched))
    machines = [*touched] * draws
    drawn = [with_false_readings(courses, 77 + 10 * n + k) for n in range(draws) for k, courses in enumerate(touched)]
    known = [without_false_readings(courses, false) for courses, false in zip(machines, drawn, strict=True)]
    adapted, taken_out = (_of([judged(courses, None) for courses in of]) / clean - 1.0 for of in (drawn, known))
    reset = _joint([reset_rmse_um(courses) for courses in drawn])
    return adapted, taken_out, reset / _joint([reset_rmse_um(courses) for courses in touched]) - 1.0


def _of(several: Sequence[Judged]) -> float:
    return _joint([one.overall.rmse_um or 0.0 for one in several])


def _joint(rmse_um: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(rmse_um))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ace", type=Path)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--refit", action="store_true")
    options = parser.parse_args()
    if options.refit:
        refitted(options)
        return
    print(
        "| machine | touch-off every | before [µm] | model alone | offset reset | adapted | kind | in 90 % interval | "
        "false readings | taken out | false, reset |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    row("simulated", [simulated(seed) for seed in range(options.seeds)])
    row("simulated, gauge moved", [simulated(seed, is_moved=True) for seed in range(options.seeds)])
    if options.ace is not None:
        row("lathe", [ace(options.ace)])
    still = [judged(simulated(100 + seed, has_drift=False), 7200.0).kind for seed in range(4 * options.seeds)]
    print(f"\nWithout any drift: {sum(kind == 'none' for kind in still)} of {len(still)} machines are not adapted.")


if __name__ == "__main__":
    main()
