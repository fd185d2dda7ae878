"""Placement before drilling: our choice of places against QR pivots (PySensors), greedy search and chance.

    python benchmarks/bench_placement.py [--refinement 0.2] [--split kinds mixed …] [--seeds 1 2 3] [--own-models]
    python benchmarks/bench_placement.py [--refinement 0.2] --growth

The virtual machining centre gets a thermometer at every candidate place, and one in the hall. Every way of choosing
sees the same training runs (temperature rises; ours and the greedy one also the displacements Z and Y) and names k
places. Then the same regressions are made for all of them from the training runs, static and with one lag of every
reading, whose time constant is chosen by leaving out training runs. What counts is the error on runs that nobody has
seen; the tables are medians over the seeds.

    kinds     learns r1-r4 of fixtures/vmc37 (steps, long heat, intermittent, random), predicts r5-r8 (coolant, warm
              start, cold morning, summer, winter)
    mixed     learns r1, r3, r5, r7, predicts r2, r4, r6, r8
    plenty    learns r1-r4 and 20 random shifts, which cost nothing but computing, predicts r5-r8
    drawn6    learns 6 random shifts, predicts 12 others
    drawn24   learns 24 random shifts, predicts 12 others

Needs `pip install selector[benchmarks]`.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from bench_reduction import shift

from selector.models.design import datum_of, lagged, rows_of
from selector.physics.thermal.field.machine import Sensor, VirtualMachine, sensor_candidates, virtual_machining_centre
from selector.physics.thermal.network.transient import simulate_heat
from selector.recording import Channel, Recording
from selector.selection import Options, Selection, select

ROOT = Path(__file__).resolve().parents[1]
RESPONSES = ("Z", "Y")
LARGEST = 6
OWN_SIZES = (2, 4, 6)
DRAWS = 100
TAUS_S = (600.0, 1200.0, 2400.0, 4800.0, 9600.0, 19200.0)
SPACINGS_M = (0.37, 0.17, 0.13, 0.11)
HALL = "hall"


@dataclass(frozen=True)
class Run:
    """Rises of the candidates [K] and displacements [µm] of a run."""

    name: str
    time_s: np.ndarray
    readings_degc: np.ndarray
    displacement_um: np.ndarray

    @property
    def rises_k(self) -> np.ndarray:
        return self.readings_degc - self.readings_degc[0]


def stories():
    spec = importlib.util.spec_from_file_location("make_vmc37", ROOT / "fixtures" / "make" / "vmc37.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["make_vmc37"] = module
    spec.loader.exec_module(module)
    for number, run in enumerate(module.runs(), 1):
        conditions, start_s = module.conditions_of(run)
        yield f"r{number}", conditions, start_s + np.arange(0.0, run.hours * 3600 + 1, 60.0)


def drawn(seeds: Sequence[int]):
    for seed in seeds:
        conditions = shift(seed)
        yield f"shift {seed}", conditions, conditions.time_s


def simulated(machine: VirtualMachine, names: Sequence[str], conditions, seed: int) -> list[Run]:
    noise = np.random.RandomState(seed)
    found = []
    for name, acting, time_s in conditions:
        history = simulate_heat(
            machine.system, machine.laws, acting, time_s=time_s, step_s=20.0, start_degc=float(acting.ambient_degc[0])
        )
        degc = history.probe_degc[:, [history.probes.index(each) for each in names]]
        hall = acting.ambient_degc[np.searchsorted(acting.time_s, time_s, side="right") - 1]
        degc = np.column_stack([degc, hall])
        um = history.displacement_um[:, [history.displacements.index(each) for each in RESPONSES]]
        found.append(
            Run(
                name,
                time_s - time_s[0],
                np.round(degc + noise.normal(0, 0.03, degc.shape), 2),
                np.round(um - um[0] + noise.normal(0, (0.5, 0.4), um.shape), 1),
            )
        )
    return found


def recording(runs: Sequence[Run], places: dict[str, Sensor]) -> Recording:
    channels = [Channel(n, "temperature", "degC", s.place, xyz_m=s.xyz_m) for n, s in places.items()]
    channels += [Channel(HALL, "ambient", "degC", "hall")]
    channels += [Channel(name, "displacement", "um", axis=name) for name in RESPONSES]
    tables = {
        run.name: pd.DataFrame(
            np.hstack([run.readings_degc, run.displacement_um]),
            index=pd.Index(run.time_s, name="time_s"),
            columns=[channel.name for channel in channels],
        )
        for run in runs
    }
    return Recording.from_runs(tables, channels, {})


def ours(selection: Selection) -> dict[int, list[int]]:
    """The set of every size with the smallest error on left-out training runs, relative to each displacement."""
    spread = {name: selection.proof.baselines_um[name]["mean"] for name in RESPONSES}
    score: dict[tuple[str, ...], float] = {}
    for one in selection.combinations:
        score[one.sensors] = score.get(one.sensors, 0.0) + (one.heldout_rmse_um / spread[one.response]) ** 2
    best: dict[int, tuple[str, ...]] = {}
    for sensors in sorted(score, key=score.__getitem__):
        best.setdefault(len(sensors), sensors)
    return {k: [selection.sensors.index(name) for name in sensors] for k, sensors in best.items()}


def qr_svd(rises: np.ndarray, k: int) -> list[int]:
    from pysensors.basis import SVD
    from pysensors.reconstruction import SSPOR

    model = SSPOR(basis=SVD(n_basis_modes=k, random_state=0), n_sensors=k)
    model.fit(rises, quiet=True, seed=0)
    return list(map(int, model.get_selected_sensors()))


def qr_snapshots(rises: np.ndarray) -> list[int]:
    """Pivots of the snapshots themselves, at most a thousand of them: PySensors squares their number."""
    from pysensors.basis import Identity
    from pysensors.reconstruction import SSPOR

    few = rises[:: max(1, len(rises) // 1000)]
    model = SSPOR(basis=Identity(n_basis_modes=len(few)), n_sensors=LARGEST)
    model.fit(few, quiet=True, seed=0)
    return list(map(int, model.get_selected_sensors()))


def greedy(training: Sequence[Run]) -> list[int]:
    """One place after the other, whichever lowers the training residual of Z and Y most."""
    rises = np.vstack([run.rises_k for run in training])
    target = np.vstack([run.displacement_um for run in training])
    target = (target - target.mean(axis=0)) / target.std(axis=0)
    chosen: list[int] = []
    for _ in range(LARGEST):

        def left(i: int) -> float:
            columns = np.column_stack([np.ones(len(rises)), rises[:, [*chosen, i]]])
            return float(((target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]) ** 2).sum())

        chosen.append(min((i for i in range(rises.shape[1]) if i not in chosen), key=left))
    return chosen


def columns_of(run: Run, sensors: Sequence[int], tau_s: float | None) -> np.ndarray:
    rises = run.rises_k[:, list(sensors)]
    parts = [np.ones((len(rises), 1)), rises]
    if tau_s is not None:
        n = len(sensors)
        parts.append(lagged(rises, run.time_s, np.full(n, tau_s), np.full(n, np.nan), np.zeros(n))[0])
    return np.hstack(parts)


def unseen_um(training: Sequence[Run], unseen: Sequence[Run], sensors: Sequence[int], tau_s: float | None):
    """Root mean square errors of Z and Y on unseen runs [µm]."""
    columns = np.vstack([columns_of(run, sensors, tau_s) for run in training])
    beta = np.linalg.lstsq(columns, np.vstack([run.displacement_um for run in training]), rcond=None)[0]
    errors = np.vstack([run.displacement_um - columns_of(run, sensors, tau_s) @ beta for run in unseen])
    return np.sqrt((errors**2).mean(axis=0))


def with_memory_um(training: Sequence[Run], unseen: Sequence[Run], sensors: Sequence[int]):
    def left_out(tau_s: float) -> float:
        """Squared error when each training run is predicted from the others, by cross-products."""
        products = []
        for run in training:
            both = np.hstack([columns_of(run, sensors, tau_s), run.displacement_um])
            products.append(both.T @ both)
        whole, n = np.sum(products, axis=0), 1 + 2 * len(sensors)
        error = 0.0
        for one in products:
            rest = whole - one
            beta = np.linalg.lstsq(rest[:n, :n], rest[:n, n:], rcond=1e-13)[0]
            error += float(np.trace(one[n:, n:] - 2 * beta.T @ one[:n, n:] + beta.T @ one[:n, :n] @ beta))
        return error

    return unseen_um(training, unseen, sensors, min(TAUS_S, key=left_out))


def own_um(selection: Selection, unseen: Recording):
    """Root mean square errors of Z and Y of the model that the selection made itself [um]."""
    learnt = selection.recipe.design
    design = replace(learnt, datum=datum_of(unseen, selection.recipe.sensors, learnt.responses, "rise"))
    rows = rows_of(unseen, design, unseen.runs)
    errors = [
        rows.responses[:, j] - selection.models[name].predicted(rows.variables)
        for j, name in enumerate(design.responses)
    ]
    return np.sqrt((np.array(errors) ** 2).mean(axis=1))


Rows = dict[str, dict[int, np.ndarray]]


def show(title: str, seeds: Sequence[Rows]) -> None:
    print(f"\n{title}: Z / Y on unseen runs [um rms]")
    print(f"{'':32s}" + "".join(f"{f'k = {k}':>13s}" for k in range(1, LARGEST + 1)))
    for name in seeds[0]:
        cells = []
        for k in range(1, LARGEST + 1):
            known = [rows[name][k] for rows in seeds if k in rows[name]]
            cells.append("{:6.2f}/{:5.2f}".format(*np.median(known, axis=0)) if known else "-")
        print(f"{name:32s}" + "".join(f"{cell:>13s}" for cell in cells), flush=True)


def compared(training: list[Run], unseen: list[Run], places: dict[str, Sensor], own_models: bool) -> dict[str, Rows]:
    """Title of a table -> way of choosing -> k -> errors of Z and Y."""
    rises = np.vstack([run.rises_k for run in training])
    names = [*places, HALL]
    learnt, new = recording(training, places), recording(unseen, places)
    free = select(learnt, Options(responses=RESPONSES, max_sensors=LARGEST))
    print(f"  by itself it keeps {', '.join(free.chosen)}", flush=True)
    chosen: dict[str, dict[int, list[int]]] = {"ours": ours(free)}
    own: Rows = {"ours, own model": {}, "ours, own model, --memory": {}} if own_models else {}
    for k in OWN_SIZES:
        for lags, name in enumerate(own):
            selection = select(learnt, Options(responses=RESPONSES, max_sensors=k, memory=bool(lags)))
            own[name][k] = own_um(selection, new)
    ways: dict[str, Callable[[int], list[int]]] = {
        "QR pivots, SVD of k modes": lambda k: qr_svd(rises, k),
        "QR pivots, SVD of 10 modes": lambda k: qr_svd(rises, 10)[:k],
    }
    for name, way in ways.items():
        chosen[name] = {k: way(k) for k in range(1, LARGEST + 1)}
    pivots, forward = qr_snapshots(rises), greedy(training)
    chosen["QR pivots, snapshots"] = {k: pivots[:k] for k in range(1, LARGEST + 1)}
    chosen["greedy on the training residual"] = {k: forward[:k] for k in range(1, LARGEST + 1)}
    for name, sets in chosen.items():
        print(f"  {name}, k = 4: " + ", ".join(names[i] for i in sets.get(4, [])))
    draw = np.random.RandomState(0)
    chance = {k: [draw.choice(len(names), k, replace=False) for _ in range(DRAWS)] for k in range(1, LARGEST + 1)}
    tables: dict[str, Rows] = {}
    for title, error, few in (
        ("static", lambda s: unseen_um(training, unseen, s, None), DRAWS),
        ("one lag each", lambda s: with_memory_um(training, unseen, s), DRAWS // 10),
    ):
        rows: Rows = {name: {k: error(s) for k, s in sets.items()} for name, sets in chosen.items()}
        drawn_um = {k: np.array([error(list(s)) for s in sets[:few]]) for k, sets in chance.items()}
        rows["chance, median"] = {k: np.median(errors, axis=0) for k, errors in drawn_um.items()}
        rows["chance, best tenth"] = {k: np.percentile(errors, 10, axis=0) for k, errors in drawn_um.items()}
        tables[title] = rows
    if own:
        tables["at most k places, model of its own"] = own
    return tables


def growth(refinement: float) -> None:
    print("processor time")
    print("places  build_s  simulate_s  select_s  select_memory_s  qr_s")
    for spacing_m in SPACINGS_M:
        places = sensor_candidates(spacing_m=spacing_m)
        started = time.process_time()
        machine = virtual_machining_centre(refinement=refinement, sensors={n: at.xyz_m for n, at in places.items()})
        built = time.process_time()
        training = simulated(machine, list(places), list(stories())[:4], seed=1)
        ran = time.process_time()
        seconds = []
        for memory in (False, True):
            begun = time.process_time()
            select(recording(training, places), Options(responses=RESPONSES, max_sensors=4, memory=memory))
            seconds.append(time.process_time() - begun)
        begun = time.process_time()
        qr_svd(np.vstack([run.rises_k for run in training]), 4)
        print(
            f"{len(places):6d}  {built - started:7.1f}  {ran - built:10.1f}  {seconds[0]:8.1f}  {seconds[1]:15.1f}"
            f"  {time.process_time() - begun:4.2f}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--refinement", type=float, default=1.0)
    parser.add_argument("--spacing", type=float, default=0.3)
    parser.add_argument("--split", choices=("kinds", "mixed", "plenty", "drawn6", "drawn24"), nargs="*")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument(
        "--own-models", action="store_true", help="also the models that select makes; minutes with 24 runs"
    )
    parser.add_argument("--growth", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    if options.growth:
        growth(options.refinement)
        return
    places = sensor_candidates(spacing_m=options.spacing)
    machine = virtual_machining_centre(refinement=options.refinement, sensors={n: at.xyz_m for n, at in places.items()})
    print(f"{len(places)} candidates and the hall, {machine.full.size} states, seeds {options.seeds}")
    for split in options.split or ("kinds", "mixed", "plenty", "drawn6", "drawn24"):
        print(f"\n== {split} ==")
        found: list[dict[str, Rows]] = []
        for seed in options.seeds:
            told = simulated(machine, list(places), stories(), seed)
            shifts = simulated(machine, list(places), drawn(range(100 * seed, 100 * seed + 36)), seed + 1000)
            training, unseen = {
                "kinds": (told[:4], told[4:]),
                "mixed": (told[0::2], told[1::2]),
                "plenty": (told[:4] + shifts[:20], told[4:]),
                "drawn6": (shifts[12:18], shifts[:12]),
                "drawn24": (shifts[12:], shifts[:12]),
            }[split]
            before = np.sqrt(np.mean(np.vstack([run.displacement_um for run in unseen]) ** 2, axis=0))
            print(f"seed {seed}: unseen runs without compensation Z {before[0]:.1f}, Y {before[1]:.1f} um rms")
            found.append(compared(training, unseen, places, options.own_models))
        for title in found[0]:
            show(title, [one[title] for one in found])


if __name__ == "__main__":
    main()
