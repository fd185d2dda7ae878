"""Which readings a simulation was computed from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.diagnosis.shapes.residual import read_by, weights_of_readings
from selector.diagnosis.workflow import diagnosis
from selector.recording import Channel
from tests.diagnosis.made import comparison

N = 3 * 600
TIME = np.tile(np.linspace(0.0, 6.0, N // 3), 3)


def reading(drift):
    """Three temperatures, two of which drive the simulation of Z; in r2 the first one runs away by so much [K]."""
    rng = np.random.default_rng(11)
    made = comparison({"Z": np.zeros(N)})
    true = {f"T{k + 2}": 21.0 + (2.0 + k) * np.sin(TIME * (1.0 + 0.4 * k) + k) for k in range(3)}
    shown = {name: values + 0.02 * rng.standard_normal(N) for name, values in true.items()}
    late = np.where(made.run_index == 1, np.clip(TIME - 2.0, 0.0, None) / 4.0, 0.0)
    shown["T2"] = shown["T2"] + drift * late
    start = np.array([made.starts[k] for k in made.run_index])

    def rise(values):
        return values - values[start]

    simulated = 3.0 * rise(shown["T2"]) - 2.0 * rise(shown["T4"])
    recorded = 3.0 * rise(true["T2"]) - 2.0 * rise(true["T4"]) + 0.3 * rng.standard_normal(N)
    return replace(
        made,
        channels=(*made.channels, *(Channel(name, "temperature", "degC") for name in shown)),
        recorded={**made.recorded, **shown, "Z": recorded},
        simulated={"Z": simulated},
    )


def test_what_a_simulation_reads_is_read_off_its_course():
    made = reading(0.0)
    weights = weights_of_readings(made, "Z")
    assert weights["T2"] == pytest.approx(3.0, rel=0.02)
    assert weights["T4"] == pytest.approx(-2.0, rel=0.02)
    assert read_by(made, "Z") == ("T4", "T2")


def test_a_simulation_of_its_own_reads_nothing():
    made = reading(0.0)
    own = np.sin(1.7 * TIME) ** 3
    assert read_by(replace(made, simulated={"Z": own}), "Z") == ()


def test_a_fault_that_may_be_in_what_the_simulation_reads_is_told_so():
    found = diagnosis(reading(1.5))
    assert found.verdict == "data-fault"
    assert "T2" in found.effects[0].statement
