"""Simulations of any kind for the tests of what is told of them."""

from __future__ import annotations

import tempfile
from pathlib import Path

from selector.findings import Finding
from selector.physics.simulation_kind import RunSettings, simulation_kinds
from selector.telling.page import account_page
from selector.telling.simulated import account_of
from selector.telling.simulated.result import SimulationResult

_FOLDER = tempfile.TemporaryDirectory()


def result(kind: str, text: str, said: Finding, *, driven: bool = False) -> SimulationResult:
    """The simulation of a model file with this text, or, driven, of one that follows a recording of itself."""
    one = simulation_kinds()[kind]
    path = Path(tempfile.mkdtemp(dir=_FOLDER.name)) / "<a>.toml"
    path.write_text(text, encoding="utf-8")
    model = one.model(one.read(path), {})
    how = RunSettings()
    done = one.planned(model, one.runs(model)[0] or "run <1>", how)
    if driven:
        done = one.driven(model, done.recording, how)
    summary = one.summary(done, lambda *_: None)
    return SimulationResult(kind, done, summary, (said, *one.findings_after(done, summary)), path)


def html(shown: SimulationResult) -> str:
    """The page of a simulation."""
    return account_page(account_of(shown, drawn=True))
