"""A small study on disk for the tests of pages: four runs of a simulated machine with seven thermometers."""

from __future__ import annotations

from pathlib import Path

from tests.selection.machines import SENSORS, machine

PLACES_M = {name: (0.05 * i, 0.1 * i, 0.4 + 0.2 * i) for i, name in enumerate(SENSORS[:-1])}
"""Where the sensors sit; nothing is said of the last one."""


def written(folder: Path) -> list[Path]:
    """Recordings and ``machine.toml`` in a folder that exists; the recordings."""
    source = machine(n_runs=4, n=120, second=lambda u: 3 * u["air"] - u["column"])
    files = []
    for run in source.runs:
        files.append(folder / f"{run}.csv")
        source.frame.xs(run, level="run").to_csv(files[-1])
    lines = ['[time]\ncolumn = "time_s"\nunit = "s"\n']
    for name in SENSORS:
        place = f"xyz = {list(PLACES_M[name])}\n" if name in PLACES_M else ""
        lines.append(f'[channels.{name}]\nrole = "temperature"\nunit = "degC"\n{place}')
    lines += [f'[channels.{name}]\nrole = "displacement"\nunit = "um"\naxis = "{name}"\n' for name in ("Z", "Y")]
    (folder / "machine.toml").write_text("\n".join(lines), encoding="utf-8")
    return files
