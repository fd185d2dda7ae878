"""Which runs are the same file again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from selector.findings import Finding, Where


def file_copies(hashes: Mapping[str, str]) -> Iterator[Finding]:
    """Runs that are the same file again: leaving one out would prove nothing while its copy stays in."""
    first: dict[str, str] = {}
    for run, sha256 in hashes.items():
        original = first.setdefault(sha256, run)
        if original != run:
            yield Finding(
                "same-file-twice",
                "warning",
                f"Run {run} is the same file as run {original}; it is left out.",
                Where(run=run),
                {"sha256": sha256, "original": original},
                "give every recording once",
                "leave-out-run",
            )
