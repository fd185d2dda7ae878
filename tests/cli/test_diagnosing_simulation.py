"""How simulated files are read beside recorded ones: their units, and what is said of what they lack."""

from __future__ import annotations

import numpy as np
import pytest

from selector.cli import exit_status
from tests.cli.test_diagnosing import command, courses, folder, refused, seen, write

__all__ = ["folder", "seen"]


def with_header(folder, header, *, factor=1.0, rows=slice(None)):
    for k, run in enumerate(("r1", "r2", "r3")):
        t, _, simulated = courses(k)
        columns = [t[rows], factor * simulated["Z"][rows], simulated["Y"][rows]]
        write(folder / "sim" / f"{run}.csv", ["t", header, "Y"], columns)


@pytest.mark.parametrize("header", ["Z [mm]", "Z (mm)", "Z_mm"])
def test_units_in_simulated_headers_are_those_of_the_simulation(folder, seen, header):
    with_header(folder, header, factor=1e-3)
    assert exit_status(command(folder)) == 0
    course = np.concatenate([courses(k)[2]["Z"] for k in range(3)])
    # what is written has ten digits
    assert np.abs(seen[0].simulated["Z"] - course).max() < 1e-6
    assert [finding.id for finding in seen[0].findings] == []


def test_a_unit_that_the_option_says_is_that_of_the_recording(folder, seen):
    with_header(folder, "Z [mm]", factor=1e-3)
    assert exit_status(command(folder, "--unit", "Z=um")) == 0
    assert np.nanmax(seen[0].simulated["Z"]) == pytest.approx(courses(0)[2]["Z"].max(), rel=1e-6)


def test_what_is_no_unit_in_the_headers_of_the_recordings_is_none_in_those_of_the_simulation(folder, seen):
    machine = folder / "machine.toml"
    machine.write_text(machine.read_text(encoding="utf-8").replace("[channels.Z]", "[channels.Z_m]"), encoding="utf-8")
    for k, run in enumerate(("r1", "r2", "r3")):
        t, recorded, simulated = courses(k)
        for path, of in ((folder / f"{run}.csv", recorded), (folder / "sim" / f"{run}.csv", simulated)):
            write(path, ["t", *(f"{name}_m" if name == "Z" else name for name in of)], [t, *of.values()])
    assert exit_status(command(folder)) == 0
    assert np.nanmax(seen[0].simulated["Z_m"]) == pytest.approx(courses(0)[2]["Z"].max(), rel=1e-6)


def test_of_a_simulation_with_another_clock_and_other_columns_the_columns_are_named(folder, seen, capsys):
    """It can be read without the clock of the recordings, so that is not what is wrong with it."""
    for run in ("r1", "r2", "r3"):
        t, _, simulated = courses(0)
        write(folder / "sim" / f"{run}.csv", ["time_s", "elsewhere"], [t, simulated["Z"]])
    said = refused(capsys, command(folder))
    assert "elsewhere" in said
    assert "time column" not in said


def test_another_quantity_in_the_simulated_header_is_refused(folder, seen, capsys):
    with_header(folder, "Z [degC]")
    said = refused(capsys, command(folder))
    assert "degC" in said
    assert "simulation" in said
    assert seen == []


def test_an_unknown_unit_of_time_is_told_with_its_own_option(folder, seen, capsys):
    assert "--simulation-time-unit" in refused(capsys, command(folder, "--simulation-time-unit", "parsec"))


def test_what_was_not_simulated_is_told(folder, seen):
    for k, run in enumerate(("r1", "r2", "r3")):
        t, _, simulated = courses(k)
        write(folder / "sim" / f"{run}.csv", ["t", "Y"], [t, simulated["Y"]])
    assert exit_status(command(folder)) == 0
    told = [finding for finding in seen[0].findings if finding.id == "recorded-only"]
    assert [(finding.level, finding.where.channel) for finding in told] == [("info", "Z")]
    assert exit_status(command(folder, "--response", "Y")) == 0
    assert "recorded-only" not in [finding.id for finding in seen[1].findings]


def test_a_simulation_of_other_channels_is_told_with_those_that_it_has(folder, seen, capsys):
    for run in ("r1", "r2", "r3"):
        t, _, simulated = courses(0)
        write(folder / "sim" / f"{run}.csv", ["t", "Q7", "Q8"], [t, simulated["Z"], simulated["Y"]])
    said = refused(capsys, command(folder))
    assert "Q7, Q8" in said
    assert "T1, Z, Y" in said
