"""The virtual machining centre of the package beside static regressions on its thermometers."""

from __future__ import annotations

from collections.abc import Sequence

from selector.proof.real.regressed import regressed
from selector.readers.reading import read
from selector.recording import Recording
from selector.shipped import shipped

FEW = ("T01", "T05", "T08", "T13", "T27", "T28", "T36")
"""Thermometers that serve a regression well (fixtures/vmc37/README.md)."""


def vmc37(thermometers: Sequence[str] = (), responses: Sequence[str] = ("Y", "Z")) -> tuple[Recording, Recording]:
    """All eight runs, and a regression on rises of thermometers (default: of all) fitted to all runs but the last."""
    folder = shipped("vmc37")
    recording = read([folder / f"r{k}.csv" for k in range(1, 9)], machine=folder / "machine.toml").recording
    chosen = list(thermometers) or [c.name for c in recording.channels if c.role in ("temperature", "ambient")]
    return recording, regressed(recording, responses, chosen, recording.runs[:-1], of_rises=True)
