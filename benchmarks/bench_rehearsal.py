"""Faults rehearsed on the shipped spindle test, through the program of every control that this machine can execute.

    python benchmarks/bench_rehearsal.py MODEL.json [--targets python,c,st,linuxcnc,sinumerik,fanuc]

MODEL.json is what `selector select` makes of fixtures/spindle46/tests.parquet with --response Z --max-sensors 4. A row
per fault: rms and largest µm left after it, what the program follows, and after how many seconds it reacts; the targets
agree where one row stands for all of them.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from selector.exporting import ExportOptions, export_model

SPINDLE = Path(__file__).parents[1] / "fixtures" / "spindle46"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("--targets", default="python,c,st,linuxcnc,sinumerik,fanuc")
    asked = parser.parse_args()
    options = ExportOptions(replay=[SPINDLE / "tests.parquet"], machine=SPINDLE / "machine.toml")
    rows: dict[tuple[str, ...], list[str]] = {}
    for target in asked.targets.split(","):
        with tempfile.TemporaryDirectory() as folder:
            replay = export_model(asked.model, target, Path(folder) / "out", options).replay
        if replay is None:
            print(f"{target}: not executed on this machine")
            continue
        print(f"{target}: {replay.executed_by}", flush=True)
        for one in replay.rehearsal:
            reacts = "never" if one.reacts_after_s is None else f"{one.reacts_after_s:.0f}"
            sizes = f"{one.left.rmse_um:.2f}", f"{one.left.max_um:.1f}", f"{one.healthy_rmse_um:.2f}"
            rows.setdefault((one.sensor or "control", one.fault, *sizes, one.mode, reacts), []).append(target)
    print("| what fails | how | left rms | left largest | healthy rms | follows | reacts after [s] | targets |")
    for key, targets in sorted(rows.items()):
        print("| " + " | ".join([*key, ", ".join(targets)]) + " |")


if __name__ == "__main__":
    main()
