from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from selector.readers import Machine, Overrides, Reading, read

Reads = Callable[..., Reading]


@pytest.fixture
def reads(tmp_path: Path) -> Reads:
    """Write a file and read it: reads(content, name=..., written_as=..., machine=..., any override)."""

    def reading(
        content: str | bytes,
        name: str = "r1.csv",
        written_as: str = "utf-8",
        machine: Machine | Path | None = None,
        **overrides: object,
    ) -> Reading:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode(written_as))
        return read([path], machine, Overrides(**overrides))  # type: ignore[arg-type]

    return reading


@pytest.fixture
def times() -> Callable[[Reading], list[float]]:
    """Time of the only run, rounded to a microsecond: less than any stamp in these tests resolves."""

    def time_s(reading: Reading) -> list[float]:
        (run,) = reading.recording.runs
        return np.round(reading.recording.time_s(run), 6).tolist()

    return time_s


@pytest.fixture
def column() -> Callable[[Reading, str], list[float]]:
    """Values of a channel in the only run."""

    def values(reading: Reading, name: str) -> list[float]:
        (run,) = reading.recording.runs
        return reading.recording.values(run, [name])[:, 0].tolist()

    return values


@pytest.fixture
def ids() -> Callable[[Reading], set[str]]:
    """Findings at level warning or worse."""
    return lambda reading: {finding.id for finding in reading.findings if finding.level != "info"}
