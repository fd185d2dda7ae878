"""Small cuts of the recordings whose licence allows to pass them on, of the development half.

python -m benchmarks.real.cut FOLDER OUT

From the folder that `benchmarks.real.collect` wrote: some files of each rig, of them every so many rows and the columns
that are read, with the licence and a SOURCE.md that says where they come from. Each cut is at most 150 kB.
"""

from __future__ import annotations

import argparse
import io
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from benchmarks.real.rigs.rosa import HEALTHY
from benchmarks.real.sources import SOURCES, Source, halves

LARGEST_BYTES = 150_000


@dataclass(frozen=True)
class Cut:
    """Of one rig: the files, one row of how many is kept, and the columns, if not all."""

    rig: str
    files: tuple[str, ...]
    one_of: int
    columns: tuple[str, ...] = ()


_FRICTION = "results_pneumatic-actuator/data/friction"
_SPEED = "codes/Testing/speed_data"
_DRONE = ("sinal1_semi_estatica", "sinal2_degraus", "sinal3_swept_sine", "sinal4_multiseno")
_SUPPORT = ("ref_support_load_01", "support_load_01", "support_load_02", "support_load_03")

CUTS = (
    Cut(
        "rosa",
        (*HEALTHY, *(f"Manual D Mode/merged_data{k}.csv" for k in (400, 408, 417, 421, 429, 433))),
        2,
        ("Time", "Desired Speed", "Shaft Control Effort", "Actual Speed", "D-mode attribute", "LinAcc. z"),
    ),
    Cut("pneumatic", tuple(f"{_FRICTION}/O-ring257_{bar}bar.csv" for bar in (1, 3, 5, 7)), 4),
    Cut("anti_cogging", tuple(f"{_SPEED}/{name}.txt" for name in ("speed_test", "speed_test_old", "speed_test1")), 12),
    Cut("quarter_drone", tuple(f"data/quarter_drone/{name}_malha_fechada.csv" for name in _DRONE), 5),
    Cut(
        "bridge",
        tuple(
            f"Settlements/UniBw_2022-04-11_{name}{of}At100Hz.csv.zip" for name in _SUPPORT for of in ("DMS_CN", "Force")
        ),
        50,
    ),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    for cut in CUTS:
        if halves()[cut.rig] != "development":
            raise SystemExit(f"{cut.rig} is set apart: nothing of it is passed on")
        sizes = written(cut, options.folder / cut.rig, options.out / cut.rig)
        print(f"{cut.rig:16s} {len(sizes)} files, {sum(sizes)} bytes, the largest {max(sizes)}")


def written(cut: Cut, folder: Path, out: Path) -> list[int]:
    """Sizes [bytes] of the files that were written, licence and source beside them."""
    sizes = []
    for name in cut.files:
        target = out / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(_thinned(folder / name, cut))
        sizes.append(target.stat().st_size)
        if sizes[-1] > LARGEST_BYTES:
            raise SystemExit(f"{target} has {sizes[-1]} bytes")
    licence = next(folder.glob("LICENSE*"))
    (out / "LICENSE").write_bytes(licence.read_bytes())
    source = next(source for source in SOURCES if source.rig == cut.rig)
    (out / "SOURCE.md").write_text(_source(cut, source, licence.read_text(encoding="utf-8")), encoding="utf-8")
    return sizes


def _thinned(path: Path, cut: Cut) -> bytes:
    if path.suffix == ".zip":
        with zipfile.ZipFile(path) as archive:
            (name,) = archive.namelist()
            text = _rows(archive.read(name).decode("latin-1"), cut).encode("latin-1")
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(zipfile.ZipInfo(name), text, zipfile.ZIP_DEFLATED)
        return packed.getvalue()
    return _rows(path.read_text(encoding="utf-8"), cut).encode()


def _rows(text: str, cut: Cut) -> str:
    if cut.columns:
        table = pd.read_csv(io.StringIO(text), skipinitialspace=True, dtype=str)
        return str(table[list(cut.columns)].iloc[:: cut.one_of].to_csv(index=False, lineterminator="\n"))
    head, *rows = text.splitlines()
    return "\n".join([head, *rows[:: cut.one_of]]) + "\n"


def _source(cut: Cut, source: Source, licence: str) -> str:
    rights = next((line.strip() for line in licence.splitlines() if line.strip().startswith("Copyright")), "")
    columns = f", of the columns only {', '.join(cut.columns)}" if cut.columns else ""
    return (
        f"Real recordings, from the public {source.published}; the paths are those of the repository.\n\n"
        f"Licence: {source.licence}, in LICENSE beside this file. {rights}\n\n"
        f"How cut: the header and one row of {cut.one_of}{columns}. What was recorded, how it is read and what it "
        f"shows: benchmarks/real/rigs/{cut.rig}.py.\n"
    )


if __name__ == "__main__":
    main()
