"""Whatever numbers are in a recording, the checks end with findings that can be written as JSON."""

from __future__ import annotations

import contextlib
import json

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import RecordingError
from selector.quality import inspect, without_faults
from selector.recording import Channel, Recording
from selector.units import CANONICAL_UNITS
from tests.quality.workshop import clean_recording, plain_recording, plain_tables

ODD = [0.0, 1.0, -0.0, 850.0, -9999.0, 1e30, 1e308, -1e308, 5e-324, np.nan, np.inf, -np.inf, 20.0, 20.1, 85.0]


@st.composite
def recordings(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    roles = draw(
        st.lists(st.sampled_from(["temperature", "ambient", "displacement", *CANONICAL_UNITS]), min_size=1, max_size=6)
    )
    channels = [Channel(f"c{i}", role, CANONICAL_UNITS[role]) for i, role in enumerate(roles)]
    tables = {}
    for run in range(draw(st.integers(1, 5))):
        rows = draw(st.sampled_from([1, 2, 3, 5, 8, 19, 40, 90, 200]))
        time = np.cumsum(rng.choice([1.0, 1.0, 1.0, 5.0, 100.0, 1e-6, 1e5], rows))
        values = rng.normal(20, 5, (rows, len(channels)))
        for i in range(len(channels)):
            kind = draw(st.integers(0, 8))
            if kind == 0:
                values[:, i] = np.nan
            elif kind == 1:
                values[:, i] = rng.choice(ODD, rows)
            elif kind == 2:
                values[:, i] = 5.0
            elif kind == 3:
                values[:, i] = np.round(20 + np.cumsum(rng.normal(0, 0.1, rows)), 1)
            elif kind == 4:
                values[:, i] *= 10.0 ** rng.integers(-300, 300)
            elif kind == 5:
                values[rng.random(rows) < 0.5, i] = np.nan
            elif kind == 6 and i:
                values[:, i] = 1.5 * values[:, 0] + 3
        tables[f"r{run}"] = pd.DataFrame(values, time, [channel.name for channel in channels])
    return Recording.from_runs(tables, channels)


@settings(max_examples=60)
@given(recordings())
def test_odd_numbers_end_in_findings(recording):
    findings = inspect(recording)
    text = json.dumps([finding.as_dict() for finding in findings], allow_nan=False)
    assert findings == inspect(recording)
    for finding in findings:
        assert finding.statement, text
        assert finding.suggestion
        assert finding.where.channel in (None, *recording.names)
        assert finding.where.run in (None, *recording.runs)
        if finding.action == "leave-out-stretch":
            assert finding.where.from_s <= finding.where.to_s
    with contextlib.suppress(RecordingError):
        without_faults(recording, findings)


def test_one_row():
    recording = plain_recording({"r1": plain_tables(runs=1)["r1"].iloc[:1]})
    assert {finding.id for finding in inspect(recording)} == {"short-run"}


def test_findings_are_sorted_and_can_be_restricted():
    tables = plain_tables()
    tables["r3"].iloc[100:110, 1] = 850.0
    tables["r1"].iloc[200:210, 2] = 850.0
    tables["r1"].iloc[100:110, 2] = -9999.0
    tables["r1"] = tables["r1"].drop(tables["r1"].index[500:600])
    recording = plain_recording(tables)
    places = [(f.where.run, f.where.channel, f.where.from_s) for f in inspect(recording)]
    assert places == [("r1", None, 9980.0), ("r1", "T2", 2000.0), ("r1", "T2", 4000.0), ("r3", "T1", 2000.0)]
    only = inspect(recording, channels=["T1"])
    assert [(f.where.run, f.where.channel) for f in only] == [("r1", None), ("r3", "T1")]
    with pytest.raises(RecordingError, match="no channel 'T99'"):
        inspect(recording, channels=["T99"])


def test_the_order_of_channels_does_not_matter():
    tables = plain_tables()
    tables["r2"].iloc[300:400, 3] = tables["r2"].iloc[300, 3]
    tables["r4"].loc[5000:, "T5"] -= 1.5
    turned = {run: table[table.columns[::-1]] for run, table in tables.items()}
    one, two = (inspect(plain_recording(each)) for each in (tables, turned))
    assert {f.statement for f in one} == {f.statement for f in two}


def test_many_channels_and_one_run():
    recording = clean_recording(5, runs=1, thermal=120)
    assert len(recording.names) > 120
    assert not [f.statement for f in inspect(recording) if f.action != "none"]
