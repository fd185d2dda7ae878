"""Several time columns in one table: runs side by side, or channels of one run that have a clock each."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.readers import read


def block(step_s: float, rows: int) -> pd.DataFrame:
    time_s = step_s * np.arange(rows)
    return pd.DataFrame({"Time (s)": time_s, "T1 (°C)": 20.0 + 1e-3 * time_s, "Z (µm)": 2e-3 * time_s})


@pytest.mark.parametrize("above", ["", "Run #1,Run #1,Run #1,Run #2,Run #2,Run #2\n"])
def test_tables_side_by_side_are_runs_on_their_own_clocks(tmp_path, above):
    both = pd.concat([block(60.0, 300), block(90.0, 200)], axis=1)
    (tmp_path / "b.csv").write_text(above + both.to_csv(index=False), encoding="utf-8")
    reading = read([tmp_path / "b.csv"])
    assert [(run.name, run.rows, run.period_s) for run in reading.runs] == [("b_1", 300, 60.0), ("b_2", 200, 90.0)]
    assert [one.role for one in reading.channels] == ["temperature", "displacement"]
    z = reading.recording.values("b_2", ("Z",))[:, 0]
    np.testing.assert_allclose(z, 2e-3 * 90.0 * np.arange(200))
    [told] = [one for one in reading.findings if one.id in ("runs-side-by-side", "duplicate-header", "missing-stamps")]
    assert told.evidence["runs"] == ["b_1", "b_2"]


def test_channels_with_a_clock_each_are_one_run(tmp_path):
    slow, fast = block(60.0, 100)[["Time (s)", "T1 (°C)"]], block(6.0, 1000)[["Time (s)", "Z (µm)"]]
    pd.concat([slow, fast], axis=1).to_csv(tmp_path / "b.csv", index=False)
    reading = read([tmp_path / "b.csv"])
    [run] = reading.runs
    assert (run.name, run.rows, run.period_s) == ("b", 100, 60.0)
    z = reading.recording.values("b", ("Z",))[:, 0]
    # means of ten readings about each minute
    np.testing.assert_allclose(z[1:-1], 2e-3 * (60.0 * np.arange(1, 99) - 3.0))
    assert [one.evidence["clocks"] for one in reading.findings if one.id == "several-clocks"] == [2]


def test_a_second_column_of_one_name_that_is_no_clock_starts_no_run(tmp_path):
    table = block(60.0, 50)
    table["T"] = 21.0 + 0.1 * np.random.default_rng(0).standard_normal(50)
    table.assign(again=table["T"]).rename(columns={"again": "T"}).to_csv(tmp_path / "b.csv", index=False)
    reading = read([tmp_path / "b.csv"])
    assert [(run.name, run.rows) for run in reading.runs] == [("b", 50)]
    assert "duplicate-header" in {one.id for one in reading.findings}


def test_a_machine_file_that_names_the_second_columns_counts(tmp_path):
    pd.concat([block(60.0, 50), block(60.0, 50)], axis=1).to_csv(tmp_path / "b.csv", index=False)
    said = '[channels.Z]\ncolumn = "Z (µm).2"\nrole = "displacement"\n'
    (tmp_path / "m.toml").write_text(said, encoding="utf-8")
    assert [run.name for run in read([tmp_path / "b.csv"], tmp_path / "m.toml").runs] == ["b"]
