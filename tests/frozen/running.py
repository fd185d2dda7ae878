"""Runs every frozen command with one checkout of the program and keeps what it printed and wrote."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

JOBS = Path(__file__).with_name("jobs.toml")
MODES = ("screen", "json")
_NEEDS = re.compile(r"shown:([\w-]+)")


@dataclass(frozen=True)
class Job:
    name: str
    command: str

    @property
    def needs(self) -> tuple[str, ...]:
        """Jobs whose files this one reads."""
        return tuple(dict.fromkeys(_NEEDS.findall(self.command)))

    def words(self, mode: str) -> list[str]:
        command = self.command.replace("{out}", f"{mode}/{self.name}")
        return [*shlex.split(_NEEDS.sub(r"screen/\1", command)), *(["--json"] if mode == "json" else [])]


def jobs(quick: bool = False, only: str = "") -> list[Job]:
    """The jobs whose name contains `only`, after those whose files they read."""
    table = tomllib.loads(JOBS.read_text(encoding="utf-8"))
    known = {name: Job(name, command) for part in table.values() for name, command in part.items()}
    wanted = [name for name in known if only in name and not (quick and name in table["slow"])]
    ordered: dict[str, Job] = {}

    def take(name: str) -> None:
        for needed in known[name].needs:
            take(needed)
        ordered.setdefault(name, known[name])

    for name in wanted:
        take(name)
    return list(ordered.values())


def record(checkout: Path, chosen: list[Job], folder: Path, workers: int = 2) -> None:
    """Run the jobs with the package in `checkout`; what it prints and writes is kept in `folder`.

    Both checkouts read the fixtures of this one: what a fixture says may change, what is told of it may not.
    """
    folder.mkdir(parents=True)
    (folder / "fixtures").symlink_to(JOBS.parents[2] / "fixtures")
    waiting, done = list(chosen), set[str]()
    with ThreadPoolExecutor(workers) as pool:
        while waiting:
            ready = [job for job in waiting if done.issuperset(job.needs)]
            for _ in pool.map(lambda job: _run(job, checkout.resolve(), folder), ready):
                pass
            done.update(job.name for job in ready)
            waiting = [job for job in waiting if job.name not in done]


def _run(job: Job, checkout: Path, folder: Path) -> None:
    environment = os.environ | {
        "PYTHONPATH": str(checkout), "COLUMNS": "120", "LC_ALL": "C.UTF-8", "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1", "NO_COLOR": "1",
    }  # fmt: skip
    for mode in MODES:
        out = folder / mode / job.name
        out.mkdir(parents=True)
        argv = [sys.executable, "-P", "-c", "from selector.cli import main; main()", *job.words(mode)]
        done = subprocess.run(argv, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        (out / "stdout.txt").write_text(done.stdout, encoding="utf-8")
        refused = done.stderr if done.returncode else ""
        (out / "exit.txt").write_text(f"{done.returncode}\n{refused}", encoding="utf-8")
        print(f"  {done.returncode}  {mode:6}  {job.name}", file=sys.stderr, flush=True)
