"""The simulated heating tests and duty cycles are what their generator makes, and say that they are simulated."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures"
MADE = runpy.run_path(str(FIXTURES / "make" / "dutycycle.py"))


def test_the_generator_makes_these_files(tmp_path):
    MADE["main"](tmp_path)
    names = sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*.csv"))
    assert names == sorted(path.relative_to(FIXTURES / "dutycycle") for path in (FIXTURES / "dutycycle").rglob("*.csv"))
    for name in names:
        ours, shipped = (
            np.loadtxt(folder / name, delimiter=",", skiprows=1) for folder in (tmp_path, FIXTURES / "dutycycle")
        )
        # another build of the linear algebra may round a reading of 0.1 µm the other way
        assert ours == pytest.approx(shipped, abs=0.1001)


@pytest.mark.parametrize("file", ["README.md", "machine.toml", "observed/machine.toml"])
def test_it_says_that_it_is_simulated(file):
    assert "SIMULATED" in (FIXTURES / "dutycycle" / file).read_text(encoding="utf-8").splitlines()[0]
