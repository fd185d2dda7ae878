"""What `select` promises on published recordings, and what later runs of the same rigs bear out.

python -m benchmarks.bench_real_promises FOLDER [--results FILE] [--sets a,b] [--apart | --seen] [--draws 2] [--memory]

FOLDER is what `benchmarks.real.promise_sets` has written. Of every set, 3, 4, 6 and 10 runs are given to `select` with
its defaults, the first ones and some drawn by chance; what it stores is applied to all other runs (to later ones of
the first), as `selector apply` does. Told is the error of the whole procedure, with the factor to which it is known;
true is what is left of the other runs. FILE keeps the answers, a line of JSON each: what is there is not asked again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.real.promise_sets import apart
from selector.controllers.application import apply_model, known_starts, sensor_starts
from selector.controllers.evaluator import first_finite
from selector.controllers.from_selection import model_file_of
from selector.errors import InputError
from selector.models.design import datum_of
from selector.models.run_before import begun
from selector.quality import inspect, usable, without_faults
from selector.readers import read
from selector.recording import Recording, at_pauses, thinned
from selector.selection import Options, select
from selector.selection.result import MOST_TOLD_FACTOR
from selector.telling.selected.advice import useless_responses

SIZES = (3, 4, 6, 10)
MOST_FURTHER = 24
NEAR = 1.5
Answer = dict[str, Any]


def part_of(recording: Recording, runs: Sequence[str]) -> Recording:
    """Some runs of a recording, with their clocks."""
    known = recording.provenance.get("runs", {})
    provenance = {**recording.provenance, "runs": {run: known[run] for run in runs if run in known}}
    return Recording.from_runs({run: recording.frame.loc[run] for run in runs}, recording.channels, provenance)


def drawn(name: str, runs: Sequence[str], size: int, draw: int) -> tuple[list[str], list[str]]:
    """(runs that are given, runs that come after or are left); draw 0 is first in time."""
    if draw == 0:
        seen, other = list(runs[:size]), list(runs[size:])
    else:
        seed = int.from_bytes(hashlib.sha256(f"{name} {size} {draw}".encode()).digest()[:8])
        chosen = set(np.random.default_rng(seed).choice(len(runs), size, replace=False).tolist())
        seen = [run for k, run in enumerate(runs) if k in chosen]
        other = [run for k, run in enumerate(runs) if k not in chosen]
    if len(other) > MOST_FURTHER:
        other = [other[k] for k in np.linspace(0, len(other) - 1, MOST_FURTHER).round().astype(int)]
    return seen, other


def plainly(model: Answer, recording: Recording, run: str, starts: dict[str, float], response: str) -> np.ndarray:
    """What the JSON of a linear model says of a run, by numpy alone [µm]."""
    (output,) = (one for one in model["outputs"] if one["name"] == response)
    inputs = {one["name"]: one for one in model["inputs"]}
    values = np.full(len(recording.time_s(run)), output["intercept"])
    for term in output["terms"]:
        product = np.full(len(values), term["coefficient"])
        for name, power in term["powers"].items():
            rise = recording.values(run, [name])[:, 0] - starts.get(name, 0.0)
            product *= ((rise - inputs[name]["centre"]) / inputs[name]["scale"]) ** power
        values += product
    return values


def without_gauge_faults(recording: Recording) -> Recording:
    """What `apply` compares with: runs that begin with their gauge, without the faults of their displacement."""
    outputs = recording.with_role("displacement")
    found = [one for one in inspect(recording, outputs) if one.action == "leave-out-stretch"]
    kept = without_faults(recording, [one for one in found if one.where.channel in outputs])
    return thinned(begun(kept, outputs), 1)


def asked(
    recording: Recording, clean: Recording, seen: Sequence[str], other: Sequence[str], options: Options
) -> Answer:
    """What `select` tells of some runs, and what the others bear out, of which `clean` has no faulty displacement."""
    (response,) = recording.with_role("displacement")
    used, faults = usable(part_of(recording, seen))
    selection = select(used, options, findings=faults)
    model = model_file_of(selection, used.channels, source=used)
    further = at_pauses(part_of(clean, [run for run in other if run in clean.runs]))
    starts = sensor_starts(model, further)
    found = apply_model(model, further, known_starts(starts))
    outside: dict[str, float] = {}
    for one in found.findings:
        if one.id == "outside-valid-range" and one.level == "warning":
            share = float(one.evidence["share_of_time"])
            outside[str(one.where.run)] = max(share, outside.get(str(one.where.run), 0.0))
    apart_um = [0.0]
    if not model.states:
        zeros, document = found.zeros_um, json.loads(model.model_dump_json(by_alias=True))
        for run, rows in found.predictions.groupby("run"):
            levels_at = {
                one.name: first_finite(further.values(run, [one.name])[:, 0]) for one in model.inputs
            } | known_starts(starts).get(run, {})
            own = plainly(document, further, run, levels_at, response) + zeros[run].get(response, 0.0)
            apart_um.append(float(np.nanmax(np.abs(own - rows[response].to_numpy()), initial=0.0)))
    known = selection.known
    sensors = [name for name in used.with_role("temperature") if name in further.names]

    def levels(of: Recording) -> dict[str, list[float]]:
        at = datum_of(of, sensors, (), "rise").levels
        return {run: [round(at[run].get(name, float("nan")), 4) for name in sensors] for run in of.runs}

    return {
        "told_um": selection.proof.rmse_um(response),
        "factor": known.factor_of(response) if known else None,
        "known": vars(known) if known else None,
        "left_out": selection.proof.left_out,
        "true_um": found.overall[response].rmse_um,
        "none_um": found.overall[response].before_rmse_um,
        "baselines_um": dict(selection.proof.baselines_um[response]),
        "fit_um": selection.models[response].rmse_um,
        "useless": response in useless_responses(selection),
        "chosen": list(selection.chosen),
        "findings": sorted({one.id for one in selection.findings if one.level != "info"}),
        "apart_um": max(apart_um),
        "parts": [
            [part.name, part.rmse_um, part.mean_um, part.before_rmse_um, part.n_samples]
            for part in selection.proof.parts_of(response)
        ],
        "runs": [
            [run, one[response].rmse_um, one[response].mean_um, one[response].before_rmse_um, one[response].n_samples,
             outside.get(run, 0.0)]
            for run, one in found.per_run.items() if one[response].n_samples
        ],
        "sensors": sensors, "starts_seen": levels(used), "starts_other": levels(further),
    }  # fmt: skip


def answers(folder: Path, names: Iterable[str], draws: int, options: Options, kept: Path | None) -> Iterator[Answer]:
    """The answer for every set, size and draw; from the file where it is there."""
    there: dict[tuple[str, int, int], Answer] = {}
    if kept and kept.exists():
        for line in kept.read_text(encoding="utf-8").splitlines():
            one = json.loads(line)
            there[one["set"], one["size"], one["draw"]] = one
    for name in names:
        recording: Recording | None = None
        runs = sorted(path.stem for path in (folder / name).glob("*.csv"))
        for size in SIZES:
            for draw in range(draws + 1) if len(runs) > size else ():
                if (name, size, draw) not in there:
                    if recording is None:
                        recording = read([folder / name], machine=folder / name / "machine.toml").recording
                        runs = [run for run in runs if run in recording.runs]
                        clean = without_gauge_faults(recording)
                    begin = time.process_time()
                    one: Answer = {"set": name, "size": size, "draw": draw}
                    try:
                        one |= asked(recording, clean, *drawn(name, runs, size, draw), options)
                    except InputError as error:
                        one["refused"] = str(error).splitlines()[0]
                    one["seconds"] = round(time.process_time() - begin, 2)
                    print(name, size, draw, one.get("refused", ""), one["seconds"], file=sys.stderr, flush=True)
                    there[name, size, draw] = one
                    if kept:
                        with kept.open("a", encoding="utf-8") as file:
                            file.write(json.dumps(one) + "\n")
                yield there[name, size, draw]


def inside_um(one: Answer) -> tuple[float, float, int]:
    """(error with the model, without it, number of runs) over the runs that stay within the valid range."""
    runs = [run for run in one["runs"] if run[5] == 0.0]
    n = sum(run[4] for run in runs)
    if not n:
        return np.nan, np.nan, 0
    return *(float(np.sqrt(sum(run[k] ** 2 * run[4] for run in runs) / n)) for k in (1, 3)), len(runs)


def row(name: str, some: Sequence[Answer], true_of: Callable[[Answer], tuple[float, float]]) -> str:
    """Cells of a table: true ÷ told, share within the factor that is told, share within 1.5, worse than none."""
    told = [one for one in some if one["factor"] is not None and np.isfinite(true_of(one)[0])]
    if not told:
        return f"| {name} | 0 |" + " – |" * 7
    ratio = np.array([true_of(one)[0] / one["told_um"] for one in told])
    factor = np.array([one["factor"] for one in told])
    known = factor <= MOST_TOLD_FACTOR
    held = np.abs(np.log(ratio)) <= np.log(factor)
    above = ratio > factor
    near = np.abs(np.log(ratio)) <= np.log(NEAR)
    worse = sum(true_of(one)[0] > true_of(one)[1] for one in told)
    low, middle, high = np.quantile(ratio, [0.05, 0.5, 0.95])
    span = f"{int(held[known].sum())} of {int(known.sum())} ({held[known].mean():.0%})" if known.any() else "–"
    over = f"{int(above[known].sum())}" if known.any() else "–"
    return (
        f"| {name} | {len(told)} | {middle:.2f} | {low:.2f} to {high:.2f} | {np.median(factor):.2f} | {span} | {over} "
        f"| {near.mean():.0%} | {worse} |"
    )


def tables(every: Sequence[Answer]) -> None:
    """Prints Markdown tables."""
    refused = [one for one in every if "refused" in one]
    every = [one for one in every if "refused" not in one and one["left_out"] != "block"]
    proposed = [one for one in every if not one["useless"]]
    print(
        f"{len(every)} answers, {len(refused)} refused, {len(every) - len(proposed)} 'do not use'; largest difference "
        f"between apply and plain numpy {max((one['apart_um'] for one in every), default=0.0):.1e} µm"
    )
    dropped = [one for one in every if one["useless"]]
    saved = sum(one["true_um"] < 0.9 * one["none_um"] for one in dropped if one["true_um"])
    print(f"of these 'do not use' {saved} would have been better than none by a tenth and more")
    head = (
        "| proposed | n | true ÷ told | 5 % to 95 % | factor told | within it | above | within 1.5 | worse than none |"
    )

    def all_runs(one: Answer) -> tuple[float, float]:
        return one["true_um"], one["none_um"]

    def in_range(one: Answer) -> tuple[float, float]:
        return inside_um(one)[:2]

    for said, true_of in (("all other runs", all_runs), ("those within the valid range", in_range)):
        print(f"\n{said}\n\n{head}\n|---|---:|---:|---:|---:|---:|---:|---:|---:|")
        print(row("all", proposed, true_of))
        for size in SIZES:
            print(row(f"{size} runs", [one for one in proposed if one["size"] == size], true_of))
        print(row("first in time", [one for one in proposed if one["draw"] == 0], true_of))
        print(row("drawn", [one for one in proposed if one["draw"]], true_of))
        few = [one for one in proposed if "few-runs" in one["findings"]]
        print(row("warned of few runs", few, true_of))
        print(row("not warned of few runs", [one for one in proposed if one not in few], true_of))
        for id_ in sorted({id_ for one in proposed for id_ in one["findings"]} - {"few-runs"}):
            print(row(f"warned: {id_}", [one for one in proposed if id_ in one["findings"]], true_of))
        for name in dict.fromkeys(one["set"] for one in every):
            print(row(name, [one for one in proposed if one["set"] == name], true_of))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--results", type=Path)
    parser.add_argument("--sets", help="only these, e.g. lathe,loggers")
    parser.add_argument("--apart", action="store_true", help="only those that are set apart by lot")
    parser.add_argument("--seen", action="store_true", help="only the others")
    parser.add_argument("--draws", type=int, default=2, help="draws by chance, beside the first in time")
    parser.add_argument("--memory", action="store_true")
    options = parser.parse_args()
    names = sorted(path.name for path in options.folder.iterdir() if path.is_dir())
    lot = set(apart())
    if options.sets:
        names = [name for name in names if name in options.sets.split(",")]
    if options.apart or options.seen:
        names = [name for name in names if (name in lot) == options.apart]
    asked_for = Options(memory=options.memory)
    tables(list(answers(options.folder, names, options.draws, asked_for, options.results)))


if __name__ == "__main__":
    main()
