"""Which recordings came after a model: those later than all that it was learnt from and judged on."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from selector.findings import Finding
from selector.quality import inspect
from selector.readers import Reading
from selector.recording import Recording

Files = Sequence[Path]  #: Of recordings


def by_age(reading: Reading, seen: Collection[str]) -> tuple[dict[str, Path], dict[str, Path]]:
    """Distinct recordings, as SHA-256 → file, oldest first: up to the newest of those seen (SHA-256), and after it."""
    of = {run.name: run for run in reading.runs}
    files: dict[str, Path] = {}
    for name in runs_by_age(reading.recording):
        files.setdefault(of[name].sha256, Path(of[name].file))
    first = 1 + max((number for number, sha256 in enumerate(files) if sha256 in seen), default=-1)
    pairs = list(files.items())
    return dict(pairs[:first]), dict(pairs[first:])


def older_unseen(earlier: Mapping[str, Path], known: Collection[str]) -> str:
    """What is told of recordings that are not new because one that was seen is newer, as by a clock in the future.

    `known` (SHA-256) are those that a model learnt from, and all that were there when it was compared with another.
    """
    older = [path.name for sha256, path in earlier.items() if sha256 not in known]
    if not older:
        return ""
    told = (
        f"{len(older)} that were never used are older than {list(earlier.values())[-1].name}, by clock or else by name"
    )
    return f"{told}, such as {older[-1]}: is one of them wrong?"


def runs_by_age(recording: Recording) -> list[str]:
    """Runs as they were recorded, by their clock where each has one; else as they are named."""
    known = recording.provenance.get("runs", {})
    starts = {name: known.get(name, {}).get("start") for name in recording.runs}
    return list(starts) if None in starts.values() else sorted(starts, key=lambda name: str(starts[name]))


def part_of(reading: Reading, files: Collection[Path]) -> Reading:
    """The runs of some of the files, under the names that they have beside all others."""
    runs = tuple(run for run in reading.runs if Path(run.file) in files)
    names = {run.name for run in runs}
    frame = reading.recording.frame
    recording = reading.recording.with_values(frame[frame.index.get_level_values("run").isin(names)])
    return replace(reading, recording=recording, runs=runs, findings=tuple(_told_of(reading.findings, names)))


def faults_beside(whole: Reading, known: Files, later: Files, channels: Collection[str]) -> Iterator[Finding]:
    """Findings of level error about some channels in later recordings, judged beside those known before.

    What most runs have is taken for usual: of later ones alone, or many beside few, what all of them have is not seen.
    """
    part = part_of(whole, [*known, *later])
    found = inspect(part.recording, [name for name in channels if name in part.recording.names])
    runs = {run.name for run in part.runs if Path(run.file) in later}
    yield from _told_of([one for one in found if one.level == "error"], runs)


def _told_of(findings: Collection[Finding], runs: Collection[str]) -> Iterator[Finding]:
    for one in findings:
        named = [one.where.run] if one.where.run is not None else one.evidence.get("runs")
        if not isinstance(named, list) or any(name in runs for name in named):
            yield one
