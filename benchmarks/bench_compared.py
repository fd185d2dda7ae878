"""What other programs make of the same recordings: sets of sensors, models with memory, parameters of a real drive.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/bench_compared.py [--repeats 5]

Prints the tables of docs/explanation/compared-with.md. Needs `pip install selector[benchmarks]`; what is not installed
is named and left out.

All ways see the same rises of 37 thermometers and the hall, in the eight simulated days of fixtures/vmc37, and the same
real record of fixtures/emps. Each day is predicted by what was chosen and fitted on the seven others. Seconds are
processor time of this process on one thread, the median of repeats in turn, after one repeat that is not counted.
"""

from __future__ import annotations

import argparse
import importlib.util
import statistics
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from proving_ground.real.identification import identified_axis_of_servo
from selector.models.best_subsets.problem import cross_products
from selector.models.best_subsets.subsets import best_subsets
from selector.physics.drive.parts.axis import Servo
from selector.readers import read
from selector.recording import Recording
from selector.selection import Options, select

FIXTURES = Path(__file__).resolve().parents[1] / "fixtures"
SIZE = 4
PERIOD_S = 60.0
LAGS = (1, 31, 61)
"""Lags offered to NARX models [samples of a minute]."""
START = 5
"""Samples whose mean is the start of a day."""
THRESHOLDS = (0.0, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3)
"""Smallest rate that a term of the sparse regression may have [1/s, µm/(K·s)]."""

Day = tuple[np.ndarray, np.ndarray]
Choice = Callable[[Sequence[Day]], Sequence[int]]


def days_of(recording: Recording) -> tuple[tuple[str, ...], list[Day]]:
    """Names of the readings; for every day its rises [K] and Z [µm] from their start."""
    names = (*recording.with_role("temperature"), *recording.with_role("ambient"))
    found = []
    for run in recording.runs:
        table = recording.frame.xs(run)[[*names, "Z"]].interpolate().to_numpy()
        table = table - table[:START].mean(axis=0)
        found.append((table[:, :-1], table[:, -1]))
    return names, found


def stacked(days: Sequence[Day]) -> Day:
    return np.vstack([x for x, _ in days]), np.concatenate([y for _, y in days])


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def seconds(ways: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Median processor seconds of each way, in turn."""
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for repeat in range(repeats + 1):
        for name, work in ways.items():
            started = time.process_time()
            work()
            if repeat:
                spent[name].append(time.process_time() - started)
    return {name: statistics.median(values) for name, values in spent.items()}


# Sets of sensors


def exact(days: Sequence[Day]) -> Sequence[int]:
    x, y = stacked(days)
    return best_subsets(cross_products(x, y), len(y), max_size=SIZE).by_size[SIZE][0].columns


def correlated(days: Sequence[Day]) -> Sequence[int]:
    x, y = stacked(days)
    return np.argsort([-abs(np.corrcoef(column, y)[0, 1]) for column in x.T])[:SIZE].tolist()


def everything(days: Sequence[Day]) -> Sequence[int]:
    return range(days[0][0].shape[1])


def qr_pivots(days: Sequence[Day]) -> Sequence[int]:
    from pysensors.basis import SVD
    from pysensors.reconstruction import SSPOR

    x, _ = stacked(days)
    model = SSPOR(basis=SVD(n_basis_modes=SIZE, random_state=0), n_sensors=SIZE).fit(x, quiet=True)
    return model.get_selected_sensors().tolist()


def sequential(days: Sequence[Day], *, floating: bool = False, by_day: bool = False) -> Sequence[int]:
    from mlxtend.feature_selection import SequentialFeatureSelector
    from sklearn.linear_model import LinearRegression

    x, y = stacked(days)
    ends = np.cumsum([len(one) for _, one in days])
    rows = np.arange(len(y))
    folds = [
        (rows[(rows < end - len(one)) | (rows >= end)], rows[end - len(one) : end])
        for end, (_, one) in zip(ends, days, strict=True)
    ]
    chosen = SequentialFeatureSelector(
        LinearRegression(), SIZE, floating=floating, scoring="neg_mean_squared_error", cv=folds if by_day else 0
    ).fit(x, y)
    return list(chosen.k_feature_idx_)


def exhaustive(days: Sequence[Day], size: int) -> Sequence[int]:
    from mlxtend.feature_selection import ExhaustiveFeatureSelector
    from sklearn.linear_model import LinearRegression

    x, y = stacked(days)
    return list(
        ExhaustiveFeatureSelector(
            LinearRegression(), size, size, scoring="neg_mean_squared_error", cv=0, print_progress=False
        )
        .fit(x, y)
        .best_idx_
    )


THOROUGH = {"exchange_num": 38, "important_search": 0, "max_iter": 100}
"""All columns may be exchanged: no worse than the defaults, which find 1 instead of 2 of the 37 best sets."""


def splicing(days: Sequence[Day]) -> Sequence[int]:
    from abess.linear import LinearRegression

    x, y = stacked(days)
    return np.flatnonzero(LinearRegression(support_size=SIZE, **THOROUGH).fit(x, y).coef_).tolist()


CHOICES: Mapping[str, tuple[str | None, Choice]] = {
    "exact search, `selector.models`": (None, exact),
    "`abess`, splicing": ("abess", splicing),
    "`mlxtend`, forward": ("mlxtend", sequential),
    "`mlxtend`, floating": ("mlxtend", lambda days: sequential(days, floating=True)),
    "`mlxtend`, forward, by left-out day": ("mlxtend", lambda days: sequential(days, by_day=True)),
    "`PySensors`, QR pivots of 4 modes": ("pysensors", qr_pivots),
    "spreadsheet: the best correlated": (None, correlated),
    "spreadsheet: all 38": (None, everything),
}


def fitted_rest(days: Sequence[Day], columns: Sequence[int], left_out: Day) -> np.ndarray:
    """What the regression on these columns leaves of a day [µm]."""
    x, y = stacked(days)
    table = np.column_stack([np.ones(len(y)), x[:, list(columns)]])
    weights = np.linalg.lstsq(table, y, rcond=None)[0]
    return left_out[1] - np.column_stack([np.ones(len(left_out[1])), left_out[0][:, list(columns)]]) @ weights


def sets_table(recording: Recording, repeats: int) -> None:
    _, days = days_of(recording)
    here = {name: choose for name, (package, choose) in CHOICES.items() if is_here(package)}
    options = Options(responses=("Z",), max_sensors=SIZE)
    ways: dict[str, Callable[[], object]] = {name: lambda c=choose: c(days) for name, choose in here.items()}
    spent = seconds({**ways, "select": lambda: select(recording, options)}, repeats)
    print(f"| way, {SIZE} of 38 | fitted, µm | unseen days, µm | worst day, µm | to choose, s |")
    print("|---|---:|---:|---:|---:|")
    study = select(recording, options)
    parts = study.proof.per_response["Z"]
    inside = rms(np.array([error for error, _ in study.fit_per_run["Z"].values()]))
    print(
        f"| `selector select`, at most {SIZE} ({len(study.chosen)} taken) | {inside:.2f} "
        f"| {rms(np.array([part.rmse_um for part in parts])):.2f} | {max(part.rmse_um for part in parts):.2f} "
        f"| {spent['select']:.2f} |"
    )
    for name, choose in here.items():
        columns = choose(days)
        fitted = rms(np.array([rms(fitted_rest(days, columns, day)) for day in days]))
        unseen = []
        for k, day in enumerate(days):
            others = [*days[:k], *days[k + 1 :]]
            unseen.append(rms(fitted_rest(others, choose(others), day)))
        print(f"| {name} | {fitted:.2f} | {rms(np.array(unseen)):.2f} | {max(unseen):.2f} | {spent[name]:.3f} |")
    print(f"| without compensation | {rms(np.array([rms(y) for _, y in days])):.1f} | | | |\n")


def search_table(recording: Recording, repeats: int) -> None:
    """The same question, least squares on all days, to which there is one right answer."""
    _, days = days_of(recording)
    x, y = stacked(days)
    cross = cross_products(x, y)
    best = best_subsets(cross, len(y))
    ways: dict[str, Callable[[], object]] = {"ours": lambda: best_subsets(cross_products(x, y), len(y))}
    if is_here("abess"):
        from abess.linear import LinearRegression

        ways["abess"] = lambda: [LinearRegression(support_size=k, **THOROUGH).fit(x, y) for k in range(1, x.shape[1])]
    spent = seconds(ways, repeats)
    print("| all sizes from 1 to 37 of 38 | sets with the least squares | processor time, s |")
    print("|---|---:|---:|")
    print(f"| `best_subsets`, proved: {best.proved} | 37 of 37 | {spent['ours']:.3f} |")
    if "abess" in ways:
        right, worst = 0, 0.0
        for k in range(1, x.shape[1]):
            columns = np.flatnonzero(LinearRegression(support_size=k, **THOROUGH).fit(x, y).coef_)
            over = rest_of(x, y, columns) / best.by_size[k][0].rss - 1.0
            right += over < 1e-6
            worst = max(worst, over)
        print(f"| `abess`, the worst {100 * worst:.1f} % above the least | {right} of 37 | {spent['abess']:.3f} |")
    if is_here("mlxtend"):
        for size in (2, 3):
            started = time.process_time()
            found = exhaustive(days, size)
            same = tuple(found) == tuple(best.by_size[size][0].columns)
            print(
                f"| `mlxtend`, exhaustive, {size} of 38 only, once | {'the same' if same else 'ANOTHER'} "
                f"| {time.process_time() - started:.1f} |"
            )
    print()


def independent_table() -> None:
    """The same question where columns are independent and five of them count; once, after the compilation above."""
    if not is_here("abess"):
        return
    from abess.linear import LinearRegression

    rng = np.random.default_rng(0)
    print("| independent columns | abess finds the least squares | abess, s | `best_subsets`, with proof, s |")
    print("|---|---:|---:|---:|")
    for columns, largest in ((60, 20), (300, 6)):
        x = rng.standard_normal((500, columns))
        y = x[:, :5] @ np.linspace(0.4, 0.9, 5) + rng.standard_normal(500)
        started = time.process_time()
        best = best_subsets(cross_products(x, y), len(y), max_size=largest)
        ours_s = time.process_time() - started
        started = time.process_time()
        sizes = range(1, largest + 1)
        found = [np.flatnonzero(LinearRegression(support_size=k, **THOROUGH).fit(x, y).coef_) for k in sizes]
        abess_s = time.process_time() - started
        right = sum(rest_of(x, y, found[k - 1]) < best.by_size[k][0].rss * (1 + 1e-6) for k in sizes)
        print(f"| up to {largest} of {columns} | {right} of {largest} sizes | {abess_s:.2f} | {ours_s:.2f} |")
    print()


def rest_of(x: np.ndarray, y: np.ndarray, columns: np.ndarray) -> float:
    table = np.column_stack([np.ones(len(y)), x[:, columns]])
    return float(np.sum((y - table @ np.linalg.lstsq(table, y, rcond=None)[0]) ** 2))


# Models with memory


def narx(days: Sequence[Day], left_out: Day, *, feedback: bool = True) -> np.ndarray:
    """Z of a day from its start by a NARX or NFIR model (FROLS) of all readings, run freely.

    A machine at rest stands before every day, so that no lag reaches into another one.
    """
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS

    rest = (np.zeros((max(LAGS), left_out[0].shape[1])), np.zeros(max(LAGS)))
    x, y = stacked([part for day in days for part in (rest, day)])
    model = FROLS(
        order_selection=True, n_info_values=20, ylag=1, xlag=[list(LAGS)] * x.shape[1],
        basis_function=Polynomial(degree=1), model_type="NARMAX" if feedback else "NFIR",
    )  # fmt: skip
    model.fit(X=x, y=y[:, None])
    x, y = stacked([rest, left_out])
    return model.predict(X=x, y=y[: max(LAGS), None]).ravel()[max(LAGS) :]


def sparse_rate(days: Sequence[Day], left_out: Day) -> np.ndarray:
    """Z of a day by a sparse rate of change (SINDy), its threshold chosen on one of the other days."""
    columns = list(exact(days))  # with all 38, which go together, it runs away
    *days, left_out = [(x[:, columns], y) for x, y in (*days, left_out)]
    best = min(THRESHOLDS, key=lambda one: rms(days[-1][1] - _integrated(_rate(days[:-1], one), days[-1])))
    return _integrated(_rate(days, best), left_out)


def _rate(days: Sequence[Day], threshold: float) -> np.ndarray:
    import pysindy

    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=threshold),
        feature_library=pysindy.PolynomialLibrary(degree=1),
        differentiation_method=pysindy.SmoothedFiniteDifference(smoother_kws={"window_length": 31, "polyorder": 3}),
    )
    model.fit([y[:, None] for _, y in days], t=PERIOD_S, u=[x for x, _ in days])
    return model.coefficients()[0]


def _integrated(weights: np.ndarray, day: Day) -> np.ndarray:
    """dZ/dt = w₀ + w₁·Z + w·T by Euler, from Z = 0; a runaway stays where it left the range of machines."""
    drive = weights[0] + day[0] @ weights[2:]
    z = np.zeros(len(day[1]))
    for k in range(1, len(z)):
        z[k] = np.clip(z[k - 1] + PERIOD_S * (weights[1] * z[k - 1] + drive[k - 1]), -1e4, 1e4)
    return z


MEMORIES: Mapping[str, tuple[str, Callable[[Sequence[Day], Day], np.ndarray]]] = {
    "`SysIdentPy`, NFIR, FROLS": ("sysidentpy", lambda days, day: narx(days, day, feedback=False)),
    "`SysIdentPy`, NARX run freely, FROLS": ("sysidentpy", narx),
    "`PySINDy`, sparse rate of Z from 4 readings": ("pysindy", sparse_rate),
}


def memory_table(recording: Recording, repeats: int) -> None:
    _, days = days_of(recording)
    here = {name: predict for name, (package, predict) in MEMORIES.items() if is_here(package)}
    options = Options(responses=("Z",), memory=True)
    ways: dict[str, Callable[[], object]] = {
        name: lambda p=predict: p(days[:-1], days[-1]) for name, predict in here.items()
    }
    spent = seconds({**ways, "select": lambda: select(recording, options)}, repeats)
    print("| way | unseen days, µm | median day, µm | worst day, µm | s |")
    print("|---|---:|---:|---:|---:|")
    study = select(recording, options)
    errors = [part.rmse_um for part in study.proof.per_response["Z"]]
    print(f"| `selector select --memory`, {len(study.chosen)} sensors | {_row(errors)} | {spent['select']:.1f} |")
    for name, predict in here.items():
        errors = [rms(day[1] - predict([*days[:k], *days[k + 1 :]], day)) for k, day in enumerate(days)]
        print(f"| {name} | {_row(errors)} | {spent[name]:.1f} |")
    print()


def _row(errors: Sequence[float]) -> str:
    return f"{rms(np.array(errors)):.2f} | {statistics.median(errors):.2f} | {max(errors):.2f}"


# Parameters of a real drive

PUBLISHED = {"mass, kg": 95.1089, "viscous, N·s/m": 203.5034, "dry, N": 20.3935, "offset, N": -3.1648}


def drive_table(repeats: int) -> None:
    folder = FIXTURES / "emps"
    frame = read([folder / "DATA_EMPS.mat"], machine=folder / "machine.toml").recording.frame
    position, voltage = frame["position"].to_numpy(), frame["command"].to_numpy()
    servo = Servo(160.18, 243.45, actuator_gain=35.15065, sample_s=1e-3, feedback="motor")
    ways: dict[str, Callable[[], Sequence[float]]] = {
        "`selector`, inverse dynamic model": lambda: identified_axis_of_servo(1e-3, position, voltage, servo).values
    }
    if is_here("pysindy"):
        ways["`PySINDy`, STLSQ with sign(v) in the library"] = lambda: sparse_drive(position, voltage)
    spent = seconds(ways, repeats)
    print(f"| way | {' | '.join(PUBLISHED)} | s |")
    print("|---|" + "---:|" * (len(PUBLISHED) + 1))
    print(f"| published by the authors of the record | {' | '.join(f'{v:.2f}' for v in PUBLISHED.values())} | |")
    for name, work in ways.items():
        print(f"| {name} | {' | '.join(f'{value:.2f}' for value in work())} | {spent[name]:.2f} |")


def sparse_drive(position_m: np.ndarray, voltage_v: np.ndarray, gain_n_per_v: float = 35.15065) -> list[float]:
    """Acceleration as a sparse sum of speed, its sign, voltage and a constant."""
    import pysindy

    smooth = pysindy.SmoothedFiniteDifference(smoother_kws={"window_length": 21, "polyorder": 3})
    speed = smooth(position_m[:, None], 1e-3)
    library = pysindy.CustomLibrary(
        [lambda v: v, lambda v: np.sign(v)], function_names=[lambda v: v, lambda v: f"sign({v})"]
    )
    # the sign of the voltage is no physics of this axis: only its own value
    both = pysindy.GeneralizedLibrary([library, pysindy.PolynomialLibrary(degree=1)], inputs_per_library=[[0], [1]])
    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=0.01, alpha=0.0), feature_library=both, differentiation_method=smooth
    )
    model.fit(speed, t=1e-3, u=voltage_v[:, None])
    by_speed, by_sign, constant, by_voltage = model.coefficients()[0]
    mass = gain_n_per_v / by_voltage
    return [mass, -by_speed * mass, -by_sign * mass, -constant * mass]


def is_here(package: str | None) -> bool:
    return package is None or importlib.util.find_spec(package) is not None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--repeats", type=int, default=5)
    repeats = parser.parse_args().repeats
    warnings.simplefilter("ignore")  # remarks of the others about their own arguments
    missing = [name for name in ("abess", "mlxtend", "pysensors", "pysindy", "sysidentpy") if not is_here(name)]
    print(f"not installed: {', '.join(missing) or 'none'}\n")
    recording = read([FIXTURES / "vmc37"]).recording
    sets_table(recording, repeats)
    search_table(recording, repeats)
    independent_table()
    memory_table(recording, repeats)
    drive_table(repeats)


if __name__ == "__main__":
    main()
