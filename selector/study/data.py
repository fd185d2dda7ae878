"""What does a study work on: recordings without their faults, in memory or read piece by piece."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from selector.findings import Finding, Where
from selector.quality import StreamWithoutFaults, inspect, usable, without_faults
from selector.quality.finding_table import READINGS_LOST
from selector.readers import Machine, Overrides, Reading, is_large, machine, read, stream_parquet
from selector.readers.files import recording_files
from selector.readers.finding_table import FILES_SKIPPED, FINDINGS
from selector.readers.roles.names import printable_name
from selector.recording import Recording, RunSource, at_pauses, parted, thinned

INSPECTED_ROWS = 100_000
_BESIDE = (FILES_SKIPPED,)


@dataclass(frozen=True)
class StudyData:
    """Recordings without their faults, what was found about them, where they come from, how they were read.

    `files` are path and SHA-256 of what was read; the machine file, which has none yet, is apart. `beside` is what was
    found of other files in the folders, which is no part of a result.
    """

    source: RunSource
    findings: tuple[Finding, ...]
    provenance: dict[str, Any]
    description: dict[str, Any] | None
    files: tuple[tuple[str, str], ...] = ()
    machine_file: str | None = None
    beside: tuple[Finding, ...] = ()
    lost: Recording | None = None  #: The source without the lost readings that were filled in; None: none were


def study_data(runs: Sequence[Path], machine_file: Path | None, overrides: Overrides) -> StudyData:
    """What files and folders hold; large Parquet files are read piece by piece.

    Raises InputError: a file cannot be read, or the machine file does not fit.
    """
    if is_large(runs) and overrides.mean_s is None and not overrides.has_window:
        return _streamed(runs, machine_file, overrides)
    reading = read(runs, machine=machine_file, overrides=overrides)
    recording, faults = usable(reading.recording)
    return StudyData(
        recording,
        without_folders((*reading.findings, *faults)),
        provenance_of(reading),
        {**reading.description(), "drift": drift_of(recording)},
        reading.files,
        reading.machine_file,
        beside_recordings(reading.findings),
        at_pauses(without_faults(reading.recording, faults)) if READINGS_LOST in [one.id for one in faults] else None,
    )


def drift_of(recording: Recording) -> list[dict[str, Any]]:
    """Drift and tilt after ISO 230-3, one entry a run, for JSON."""
    from selector.physics.thermal.drift_quantities import drift_quantities

    return [one.as_dict() for one in drift_quantities(recording)]


def without_folders(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings of the recordings alone, files without their folders: the same recordings give the same result anywhere.

    What lies beside the recordings is told by `beside_recordings`.
    """
    return tuple(
        one
        if one.where.file is None
        else replace(one, where=replace(one.where, file=printable_name(Path(one.where.file).name)))
        for one in findings
        if one.id not in _BESIDE
    )


def beside_recordings(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings about other files in the folders; results that are written there must not change the next result."""
    return tuple(one for one in findings if one.id in _BESIDE)


def provenance_of(reading: Reading) -> dict[str, Any]:
    """The machine's name, and file and SHA-256 of every run, as reports show them."""
    return _provenance(reading.machine, {run.name: (run.file, run.sha256) for run in reading.runs})


def _provenance(declared: Machine | None, origins: Mapping[str, tuple[str, str]]) -> dict[str, Any]:
    runs = {run: {"file": printable_name(Path(file).name), "sha256": sha256} for run, (file, sha256) in origins.items()}
    return {"machine": None if declared is None else declared.machine.name, "runs": runs}


def _streamed(runs: Sequence[Path], machine_file: Path | None, overrides: Overrides) -> StudyData:
    used = machine_file or recording_files(runs).machine
    named = None if machine_file is None else machine(machine_file)
    stream = stream_parquet(runs, named, overrides)
    rows = sum(stream.rows(run) for run in stream.runs)
    stride = max(1, -(-rows // INSPECTED_ROWS))
    faults = inspect(thinned(stream, stride))
    found = FINDINGS.finding(
        "read-in-pieces",
        f"The recordings hold {rows} rows and were read in pieces; faults were looked for in every {stride}th row, and "
        "lost readings stay lost.",
        Where(),
        {"rows": rows, "stride": stride},
    )
    origins = {run: (str(entry["file"]), entry["sha256"]) for run, entry in stream.provenance["runs"].items()}
    return StudyData(
        parted(StreamWithoutFaults(stream, faults)),
        without_folders((*stream.findings, found, *faults)),
        _provenance(named, origins),
        None,
        tuple(origins.values()),
        None if used is None else str(used),
        beside_recordings(stream.findings),
    )
