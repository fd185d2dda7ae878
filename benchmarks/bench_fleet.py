"""A fleet of small machines, one in twenty of them broken: who is told, the same bytes everywhere, cost, and murders.

python benchmarks/bench_fleet.py [--machines 200] [--runs 8] [--folder DIR] [--dask] [--no-kill] [--kill-every 10]
                                 [--copies 10000]

In turn: `select` alone and the study of a fleet on some machines; the fleet on one process and on two (bytes compared,
scaling); once more (nothing is done again); with a worker killed every so many seconds and the command itself killed in
the middle; with --dask on two workers of a LocalCluster, workers killed there, too, and its scheduler in the middle;
with --copies that many machines of which most have the recordings of another: what the fleet itself costs.

Scaling is told by processor time, which other work on the computer hardly changes: with enough processors a fleet takes
as long as the busiest of its processes.
"""

from __future__ import annotations

import argparse
import contextlib
import gzip
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

N_SENSORS, N_SAMPLES, PERIOD_S = 8, 60, 60.0
EVERY = 20
ALONE = 10


def recordings(folder: Path, seed: int, n_runs: int) -> None:
    """Two sources of heat, eight thermometers, a displacement."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    mix = rng.normal(size=(2, N_SENSORS))
    time_s = PERIOD_S * np.arange(N_SAMPLES)
    head = ",".join(["t [s]", *(f"T{i + 1} [degC]" for i in range(N_SENSORS)), "Z [um]"])
    for run in range(n_runs):
        heat = rng.uniform(1, 6, 2) * (1 - np.exp(-time_s[:, None] / rng.uniform([500, 2000], [700, 3000])))
        readings = 20 + heat @ mix + rng.normal(0, 0.05, (N_SAMPLES, N_SENSORS))
        gauge = heat @ [3.0, -2.0] + rng.normal(0, 0.2, N_SAMPLES)
        np.savetxt(
            folder / f"r{run + 1}.csv",
            np.column_stack([time_s, readings, gauge]),
            fmt="%.4f", delimiter=",", header=head, comments="",
        )  # fmt: skip


def without_displacement(folder: Path) -> None:
    """No gauge in any run."""
    for path in folder.iterdir():
        lines = path.read_text().splitlines()
        path.write_text("\n".join(line.rpartition(",")[0] for line in lines) + "\n")


BROKEN: dict[str, Callable[[Path], Any]] = {
    "no folder": shutil.rmtree,
    "empty folder": lambda folder: [path.unlink() for path in folder.iterdir()],
    "binary": lambda folder: (folder / "r1.csv").write_bytes(bytes(range(256)) * 100),
    "empty file": lambda folder: (folder / "r2.csv").write_bytes(b""),
    "text without numbers": lambda folder: (folder / "r3.csv").write_text("nothing\nwas\nrecorded\n"),
    "an archive": lambda folder: (folder / "r1.csv").write_bytes(gzip.compress(b"t,T1,Z")),
    "no displacement": without_displacement,
    "a machine file that is not TOML": lambda folder: (folder / "machine.toml").write_text("[channels"),
    "a machine file of other columns": lambda folder: (folder / "machine.toml").write_text(
        '[time]\ncolumn = "clock"\nunit = "s"\n[channels.A]\ncolumn = "A"\nrole = "temperature"\nunit = "degC"\n'
    ),
    "an option": lambda folder: None,
}  # fmt: skip


def plant(folder: Path, n_machines: int, n_runs: int) -> list[str]:
    """The machines and FLEET.toml; names of those that are broken."""
    broken = []
    for i in range(n_machines):
        name = f"m{i + 1:03d}"
        recordings(folder / "plant" / name, i, n_runs)
        if i % EVERY == EVERY - 1:
            list(BROKEN.values())[len(broken) % len(BROKEN)](folder / "plant" / name)
            broken.append(name)
    text = "[select]\nmax_sensors = 3\n[machines]\n"
    optional = broken[list(BROKEN).index("an option") :: len(BROKEN)]
    names = [f"m{i + 1:03d}" for i in range(n_machines)]
    text += "".join(f'{name} = "plant/{name}"\n' for name in names if name not in optional)
    text += "".join(f'[machines.{name}]\nruns = ["plant/{name}"]\nselect.must = ["T99"]\n' for name in optional)
    (folder / "FLEET.toml").write_text(text)
    return broken


def command(folder: Path, results: str, *arguments: str) -> list[str]:
    """The command line of a run into a results folder."""
    text = (folder / "FLEET.toml").read_text()
    named = folder / f"FLEET-{results}.toml"
    named.write_text(f'results = "{results}"\n{text}')
    return [sys.executable, "-m", "selector", "fleet", "run", str(named), *arguments, "--json"]


def run(line: list[str]) -> tuple[dict[str, Any], float, list[float]]:
    """(answer, seconds, seconds of processor time of each of its processes, the busiest first)."""
    start = time.perf_counter()
    used: dict[int, float] = {}
    with tempfile.TemporaryFile() as out:
        process = subprocess.Popen(line, stdout=out, stderr=subprocess.DEVNULL)
        while process.poll() is None:
            used |= processor_s(process.pid)
            time.sleep(0.05)
        if process.returncode:
            raise SystemExit(f"exit {process.returncode}: {' '.join(line)}")
        out.seek(0)
        return json.loads(out.read()), time.perf_counter() - start, sorted(used.values(), reverse=True)


def processor_s(pid: int) -> dict[int, float]:
    """Process → processor time so far [s], of a process and of all below it."""
    found = {}
    for one in below(pid)[0]:
        with contextlib.suppress(OSError):
            fields = Path(f"/proc/{one}/stat").read_text().rpartition(")")[2].split()
            found[one] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return found


def files(folder: Path) -> dict[str, bytes]:
    """Bytes of all selections and models."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.glob("*/[ms]*.json"))}


def told(title: str, answer: dict[str, Any], broken: list[str], seconds: float) -> None:
    """One line about a run: right, told, and whether those are the broken ones."""
    failed = [name for name, one in answer["machines"].items() if one["status"] == "failed"]
    verdict = "those that are broken" if sorted(failed) == sorted(broken) else f"NOT those that are broken: {failed}"
    print(
        f"{title}: {answer['done']} done, {answer['reused']} reused, {answer['failed']} failed ({verdict}), "
        f"{seconds:.1f} s",
        flush=True,
    )


def below(pid: int) -> tuple[list[int], set[int]]:
    """(a process and all that it and these have started, those of them that have started others)."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                parents.setdefault(parent, []).append(int(entry.name))
    found = [pid]
    for one in found:
        found += parents.get(one, [])
    return found, set(parents)


def workers_below(pid: int) -> list[int]:
    """Processes that a process has started, and those that these have: the leaves do the work."""
    found, parents = below(pid)
    return [
        one
        for one in found[1:]
        if one not in parents and b"resource_tracker" not in Path(f"/proc/{one}/cmdline").read_bytes()
    ]


@contextlib.contextmanager
def murders(pid: int, every_s: float) -> Iterator[list[int]]:
    """A worker of a process is killed every so often, another one each time."""
    ended, killed = threading.Event(), list[int]()

    def kill() -> None:
        while not ended.wait(every_s):
            with contextlib.suppress(OSError):
                there = workers_below(pid)
                if there:
                    os.kill(there[len(killed) % len(there)], signal.SIGKILL)
                    killed.append(pid)

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    try:
        yield killed
    finally:
        ended.set()
        thread.join()


def with_murders(folder: Path, broken: list[str], expected: dict[str, bytes], every_s: float) -> None:
    """Workers killed all the time, the command once, in the middle; then it goes on."""
    line = command(folder, "killed", "--jobs", "2")
    start = time.perf_counter()
    process = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    half = len(expected) // 4
    with murders(process.pid, every_s) as killed:
        while len(list((folder / "killed").glob("*/done.json"))) < half and process.poll() is None:
            time.sleep(0.1)
    process.kill()
    process.wait()
    kept = len(list((folder / "killed").glob("*/done.json")))
    print(f"the command was killed after {kept} answers and {len(killed)} killed workers", flush=True)
    # workers that were left alone end after the study that they are at
    process = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    with murders(process.pid, every_s) as more:
        out, _ = process.communicate()
    answer = json.loads(out)
    told(f"after {len(killed) + len(more)} killed workers", answer, broken, time.perf_counter() - start)
    print(f"  of {kept} answers before the command was killed {answer['reused']} were used again", flush=True)
    answer, seconds, _ = run(line)
    told("once more, nobody is killed", answer, broken, seconds)
    print(f"  same bytes: {files(folder / 'killed') == expected}", flush=True)


CLUSTER = """
import sys, time
from distributed import LocalCluster
if __name__ == "__main__":
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    print(cluster.scheduler_address, flush=True)
    time.sleep(86400)
"""


@contextlib.contextmanager
def local_cluster(folder: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """(process of a scheduler with two nannies on this computer, its address)."""
    script = folder / "cluster.py"
    script.write_text(CLUSTER)
    # the file asks by its name what is imported, and a worker must not import this one
    process = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        assert process.stdout is not None
        yield process, process.stdout.readline().strip()
    finally:
        process.kill()
        process.wait()


def on_dask(folder: Path, broken: list[str], expected: dict[str, bytes], every_s: float) -> None:
    """Workers killed all the time, the scheduler once, in the middle; then with another scheduler it goes on."""
    start, n_killed, kept = time.perf_counter(), 0, dict[Path, int]()
    for is_first in (True, False):
        with local_cluster(folder) as (cluster, address):
            line = command(folder, "dask", "--dask", address)
            process = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            with murders(cluster.pid, every_s) if every_s else contextlib.nullcontext([]) as killed:
                while is_first and every_s and process.poll() is None and 4 * len(kept) < len(expected):
                    kept = times(folder / "dask")
                    time.sleep(0.1)
                if is_first and every_s:
                    cluster.kill()
                    begun = time.perf_counter()
                out, said = process.communicate()
            n_killed += len(killed)
        if not is_first or not every_s:
            break
        late_s = time.perf_counter() - begun
        print(f"scheduler killed after {len(kept)} answers: exit {process.returncode} after {late_s:.1f} s")
        last = said.strip().splitlines()[-1:]
        print(f"  {last}", flush=True)
        kept = times(folder / "dask")
    answer = json.loads(out)
    told(f"Dask, {n_killed} killed workers", answer, broken, time.perf_counter() - start)
    twice = sum(times(folder / "dask").get(place) != moment for place, moment in kept.items())
    print(f"  {len(kept)} answers before, {answer['reused']} used again, {twice} of them written twice")
    print(f"  same bytes: {files(folder / 'dask') == expected}", flush=True)


def times(folder: Path) -> dict[Path, int]:
    """When answers were written."""
    return {place: place.stat().st_mtime_ns for place in folder.glob("*/done.json")}


def of_copies(folder: Path, broken: list[str], n_machines: int) -> None:
    """Machines most of which have the recordings of another: all that a fleet costs beside its studies."""
    right = [place for place in sorted((folder / "plant").iterdir()) if place.name not in broken]
    for i in range(n_machines):
        of = right[i % len(right)]
        place = folder / "copies" / f"c{i + 1:05d}"
        place.mkdir(parents=True)
        for file in of.iterdir():
            os.link(file, place / file.name)
    # a results folder is that of one fleet: these begin with the answers, as if the machines had been renamed
    shutil.copytree(folder / "jobs2", folder / "answered", ignore=shutil.ignore_patterns("fleet.json"))
    named = folder / "FLEET-copies.toml"
    named.write_text('results = "answered"\nfolders = ["copies/*"]\n[select]\nmax_sensors = 3\n')
    line = [sys.executable, "-m", "selector", "fleet", "run", str(named), "--jobs", "2", "--json"]
    answer, seconds, used = run(line)
    print(
        f"{n_machines} machines: {answer['done']} done, {answer['reused']} reused, {seconds:.0f} s, of processor time:"
    )
    print(f"  {sum(used):.0f} s, each process {[round(one, 1) for one in used]}", flush=True)


def main() -> None:
    """All of it, in turn."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--machines", type=int, default=200)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--dask", action="store_true")
    parser.add_argument("--no-kill", action="store_true")
    parser.add_argument("--kill-every", type=float, default=10.0, metavar="S")
    parser.add_argument("--copies", type=int, default=0)
    asked = parser.parse_args()
    # as many threads as the fleet has
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    folder = asked.folder or Path(tempfile.mkdtemp())
    shutil.rmtree(folder, ignore_errors=True)
    broken = plant(folder, asked.machines, asked.runs)
    alone(folder, broken)
    used = {}
    for jobs in (1, 2):
        answer, seconds, used[jobs] = run(command(folder, f"jobs{jobs}", "--jobs", str(jobs)))
        told(f"{jobs} processes", answer, broken, seconds)
        print(f"  {sum(used[jobs]):.1f} s of processor time, each process {[round(one, 1) for one in used[jobs]]}")
    expected = files(folder / "jobs1")
    print(f"same bytes on one and on two: {files(folder / 'jobs2') == expected} ({len(expected)} files)")
    print(f"the busiest of two takes {used[2][0] / used[1][0]:.2f} of the processor time of one", flush=True)
    answer, again, _ = run(command(folder, "jobs2", "--jobs", "2"))
    told("once more", answer, broken, again)
    if not asked.no_kill:
        with_murders(folder, broken, expected, asked.kill_every)
    if asked.dask:
        on_dask(folder, broken, expected, 0.0 if asked.no_kill else asked.kill_every)
    if asked.copies:
        of_copies(folder, broken, asked.copies)


def alone(folder: Path, broken: list[str]) -> None:
    """Processor time of `select` alone and of the study of a fleet, in a process that has done some before."""
    from selector.fleet import answered, read_fleet
    from selector.fleet.machine_study import Task
    from selector.readers import Overrides
    from selector.selection import select
    from selector.study import options_of
    from selector.study.data import study_data

    fleet = read_fleet(folder / "FLEET.toml")
    right = [name for name in fleet.studies if name not in broken][:ALONE]
    options = options_of(fleet.studies[right[0]])

    def selected(name: str) -> None:
        material = study_data([folder / "plant" / name], None, Overrides())
        select(material.source, options, findings=material.findings, provenance=material.provenance)

    def asked(name: str) -> None:
        answered(Task(name, fleet.studies[name], folder / "alone", 3600.0))

    for name in right:
        selected(name)
    asked(right[0])
    shutil.rmtree(folder / "alone")
    for title, work in (("select alone", selected), ("study of a fleet", asked), ("the same, reused", asked)):
        start = time.process_time()
        for name in right:
            work(name)
        print(f"{title}: {(time.process_time() - start) / len(right):.3f} s of processor time", flush=True)


if __name__ == "__main__":
    main()
