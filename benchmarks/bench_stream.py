"""Peak memory and time of `selector select` on Parquet recordings that do not fit: 37 sensors × 10⁷ samples.

python benchmarks/bench_stream.py [--rows 1000000] [--runs 10] [--keep FOLDER]

Writes the recordings (about 3 GB of float64) to a temporary folder, then runs the command line in a process of its own
and reads the operating system's peak of its resident memory. The goal is 1 GiB, imports included.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.signal import lfilter

N_SENSORS, PERIOD_S = 37, 0.1
MACHINE = "[time]\ncolumn = 't'\nunit = 's'\n" + "".join(
    f"[channels.T{i + 1}]\nrole = 'temperature'\nunit = 'degC'\n" for i in range(N_SENSORS)
)


def write_run(path: Path, rng: np.random.Generator, rows: int, weights: np.ndarray, taus_s: np.ndarray) -> None:
    """One run: 37 first-order responses to four switched heat sources, and a displacement of three of them."""
    steps = rng.integers(0, 2, size=(4, rows // 20_000 + 1)) * rng.uniform(0.5, 1.5, size=(4, 1))
    sources = np.repeat(steps, 20_000, axis=1)[:, :rows]
    columns = {"t": np.arange(rows) * PERIOD_S}
    z = np.zeros(rows)
    for j in range(N_SENSORS):
        share = PERIOD_S / taus_s[j]
        rise = lfilter([share], [1.0, share - 1.0], weights[j] @ sources)
        columns[f"T{j + 1}"] = 20.0 + rise + 0.05 * rng.normal(size=rows)
        z += {0: 5.0, 11: 2.5, 29: -1.5}.get(j, 0.0) * rise
    columns["Z"] = z + 0.5 * rng.normal(size=rows)
    pq.write_table(pa.table(columns), path, row_group_size=100_000, compression="zstd", compression_level=1)


def main() -> None:
    """Write, run, print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    weights = rng.dirichlet(np.ones(4) * 0.5, size=N_SENSORS) * rng.uniform(3, 12, size=(N_SENSORS, 1))
    taus_s = np.exp(rng.uniform(np.log(600), np.log(9000), size=N_SENSORS))
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "machine.toml").write_text(
            MACHINE + "[channels.Z]\nrole = 'displacement'\nunit = 'um'\naxis = 'Z'\n", encoding="utf-8"
        )
        files = [folder / f"r{k + 1}.parquet" for k in range(options.runs)]
        for file in files:
            if not file.exists():
                write_run(file, rng, options.rows, weights, taus_s)
        program = (
            "import re, sys; from selector.cli import exit_status; code = exit_status(sys.argv[1:]);"
            "peak = re.search('VmHWM:[^0-9]*([0-9]+)', open('/proc/self/status').read());"
            "print(peak.group(1), file=sys.stderr); sys.exit(code)"
        )
        command = ["select", *map(str, files), "--machine", str(folder / "machine.toml"), "--json"]
        start = time.perf_counter()
        done = subprocess.run([sys.executable, "-c", program, *command], capture_output=True, text=True, check=False)
        seconds = time.perf_counter() - start
        if done.returncode:
            sys.exit(done.stderr)
        peak_mib = int(done.stderr.split()[-1]) / 1024
        result = json.loads(done.stdout)
        size = sum(file.stat().st_size for file in files) / 2**30
        print(f"{options.runs} runs × {options.rows} samples × {N_SENSORS} sensors, {size:.2f} GiB of Parquet")
        print(f"{seconds:.0f} s, peak {peak_mib:.0f} MiB (goal 1024)")
        print("chosen", result["chosen"]["sensors"], "unseen RMS", result["models"]["Z"]["heldout_rmse_um"], "µm")


if __name__ == "__main__":
    main()
