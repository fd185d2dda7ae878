"""Candidates in model files: they become thermometers of the file, and what contradicts them is refused."""

from __future__ import annotations

import numpy as np
import pytest

from selector.errors import ModelFileError
from selector.physics.model_text import plain_values
from selector.physics.thermal.field.geometry import MachineGeometry
from selector.physics.thermal.field.machine import sensor_candidates
from selector.physics.thermal.field_model import with_candidates
from selector.physics.thermal.model_file import checked_model_file
from selector.physics.thermal.network.heat_system import Conditions
from selector.physics.thermal.thermal_model import thermal_model

HEAD = {"model": {"kind": "field", "name": "candidates"}, "run": {"duration_min": 60.0}}
COARSE = {"refinement": 0.2}


def file_with(**sections):
    conditions = {"spindle_speed_rpm": 2000.0}
    return checked_model_file({**HEAD, "conditions": conditions, "field": COARSE, **sections})


def test_candidates_become_thermometers_after_those_of_the_file():
    geometry = {"column_top_m": 1.9}
    file = file_with(
        candidates={"spacing_m": 0.4, "noise_k": 0.05},
        sensors=[{"name": "T01"}],
        field={**COARSE, "geometry": geometry},
    )
    written = with_candidates(file)
    expected = sensor_candidates(MachineGeometry(**geometry), 0.4)
    assert [s.name for s in written.sensors] == ["T01", *expected]
    assert {s.name: (s.place, s.xyz, s.noise_k) for s in written.sensors[1:]} == {
        name: (at.place, at.xyz_m, 0.05) for name, at in expected.items()
    }
    assert checked_model_file(plain_values(written)) == written
    assert with_candidates(written) is written


def test_a_simulation_has_a_channel_for_every_candidate_and_the_nearer_to_the_bearing_the_warmer():
    model = thermal_model(file_with(candidates={"surfaces": ["headstock"]}))
    expected = sensor_candidates(surfaces=("headstock",))
    thermometers = [channel for channel in model.outputs if channel.role == "temperature"]
    assert {c.name: (c.place, c.xyz_m) for c in thermometers} == {n: (s.place, s.xyz_m) for n, s in expected.items()}
    hour = Conditions(np.array([0.0, 3600.0]), spindle_speed=2000.0, ambient_degc=20.0)
    recording = model.simulate(hour, instruments=False)
    last = recording.frame.iloc[-1]
    side = [c for c in thermometers if c.place.startswith("headstock, left") and c.xyz_m[1] > 0.5]
    slide = [c for c in thermometers if c.place.startswith("headstock slide, left")]
    # beside the bearings, 0.1 m from their seats, against the slide, 0.4 m away
    assert min(last[c.name] for c in side) > max(last[c.name] for c in slide) + 0.5


@pytest.mark.parametrize(
    ("sections", "key", "found"),
    [
        ({"candidates": {"spacing_m": 0.01}}, "candidates.spacing_m", "0.01"),
        ({"candidates": {"spacing_m": 0.05}}, "candidates", "more than 1000"),
        ({"candidates": {"surfaces": ["colum"]}}, "candidates", "'colum'"),
        ({"candidates": {"surfaces": []}}, "candidates.surfaces", "()|\\[\\]"),
        ({"candidates": {}, "sensors": [{"name": "P07", "at": "T01"}]}, r"sensors\[1\].name", "P07"),
        ({"candidates": {}, "gauges": [{"name": "P01", "of": "Z"}]}, r"gauges\[1\].name", "P01"),
        ({"candidates": {}, "field": {"geometry": {"colum_top_m": 1.9}}}, "field.geometry.colum_top_m", "colum_top_m"),
        ({"candidates": {}, "field": {"geometry": {"column_top_m": 0.5}}}, "field.geometry", "column_top_m"),
        (
            {"candidates": {"spacing_m": 0.09}, "sensors": [{"name": f"S{i}", "at": "T01"} for i in range(900)]},
            "candidates.spacing_m",
            "900 thermometers",
        ),
        ({"candidates": {"spacing_mm": 300}}, "candidates.spacing_mm", "spacing_m"),
    ],
)
def test_what_contradicts_the_candidates_is_refused(sections, key, found):
    with pytest.raises(ModelFileError, match=found) as caught:
        with_candidates(file_with(**sections))
    assert caught.match(f"key {key}")
