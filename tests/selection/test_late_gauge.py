"""A gauge that begins later than the thermometers, at any reading: the run counts from there, in fit, proof and use."""

from __future__ import annotations

import numpy as np
import pytest

from selector.controllers.application import apply_model, known_starts, sensor_starts, without_displacement_faults
from selector.controllers.from_selection import model_file_of
from selector.controllers.model_file import Input, ModelFile, Output, State, Term
from selector.models.run_before import another_before, begun, chain_before, runs_before
from selector.quality.completeness import START_SAMPLES
from selector.recording import Recording
from selector.selection import Options, select
from tests.controllers.stepwise import Evaluator
from tests.models.runs import InPieces, recording
from tests.selection.machines import found_ids, linear, machine

LATE, OFFSETS_UM = 60, (140.0, -90.0, 260.0, 35.0, -180.0)


def late(rows: int = LATE, offsets_um: tuple[float, ...] = OFFSETS_UM) -> Recording:
    """Five runs whose gauge has an offset of its own and says nothing in so many first rows."""
    whole = machine(linear, n_runs=5, n=400)
    runs = {}
    for k, run in enumerate(whole.runs):
        values = dict(zip(whole.names, whole.values(run, whole.names).T.copy(), strict=True))
        values["Z"] += offsets_um[k]
        values["Z"][:rows] = np.nan
        runs[run] = (whole.time_s(run), values)
    return recording(runs)


def test_the_offset_of_the_gauge_is_in_no_error():
    found = select(late(), Options(max_sensors=2))
    plain = select(late(LATE, (0.0,) * 5), Options(max_sensors=2)).proof.rmse_um("Z")
    # without offsets some runs begin so near to 0 that the gauge counts as zeroed there
    assert found.proof.rmse_um("Z") == pytest.approx(plain, rel=0.1)
    assert found.proof.rmse_um("Z") < 1.5


def test_what_is_applied_counts_from_there_too():
    source = late()
    found = select(source, Options(max_sensors=2))
    model = model_file_of(found, source.channels)
    compared, told = without_displacement_faults(model, source)
    assert {one.where.run for one in told if one.id == "gauge-begins-late"} == set(source.runs)
    applied = apply_model(model, compared, known_starts(sensor_starts(model, compared))).overall["Z"]
    assert applied.rmse_um < 1.2 * found.proof.rmse_um("Z")
    assert applied.n_samples == 5 * (400 - LATE)


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_read_in_pieces_a_run_begins_at_the_same_sample(size):
    source = late()
    pieces = list(begun(InPieces(source, size), ("Z",)).chunks(source.runs[1], ("T1", "Z")))
    time_s, values = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    np.testing.assert_array_equal(time_s, source.time_s(source.runs[1])[LATE:])
    np.testing.assert_array_equal(values, source.values(source.runs[1], ("T1", "Z"))[LATE:])


def test_a_run_whose_gauge_begins_in_time_or_never_stays_whole():
    in_time = late(START_SAMPLES - 1)
    assert begun(in_time, ("Z",)) is in_time
    never = late(400)
    assert begun(never, ("Z",)) is never


def _begins_at(step_s: float, rows: dict[str, list[int]]) -> float:
    """When a run of 200 samples begins of which these displacements read something in these rows."""
    t = step_s * np.arange(200.0)
    values = {name: np.where(np.isin(np.arange(200), at), 7.0, np.nan) for name, at in rows.items()}
    source = InPieces(recording({"r": (t, {"T1": t, **values})}), 7)
    return float(next(iter(begun(source, [*rows]).chunks("r", ("T1",))))[0][0])


@pytest.mark.parametrize(
    ("step_s", "rows", "begins"),
    [
        (60.0, {"Z": [14, 90]}, 0),
        (60.0, {"Z": [40, 90]}, 40),
        (300.0, {"Z": [2, 90]}, 0),
        (300.0, {"Z": [12, 90]}, 12),
        (60.0, {"X": [*range(200)], "Z": [40, 90]}, 40),
        (60.0, {"X": [20, 120], "Z": [26, 126]}, 20),
        (60.0, {"X": [0, 60, 120], "Z": [66, 126]}, 60),
        (60.0, {"X": [], "Z": [40, 90]}, 40),
        (60.0, {"X": [20], "Z": [90]}, 0),
    ],
    ids=[
        "in-time",
        "late",
        "slow",
        "slow-late",
        "one-of-two",
        "probed-in-turn",
        "forgotten-once",
        "no-X",
        "never-both",
    ],
)
def test_a_run_begins_where_all_its_displacements_read_something(step_s, rows, begins):
    assert _begins_at(step_s, rows) == begins * step_s


def test_a_model_with_memory_goes_on_from_what_was_read_before_a_late_gauge():
    state = State(name="T1_lag", source="T1", tau_s=5000.0)
    item = Input(name="T1", reference="rise", valid_min=-5.0, valid_max=50.0)
    term = Term(powers={"T1_lag": 1}, coefficient=2.0)
    output = Output(name="Z", axis="Z", reference="rise", intercept=0.0, terms=(term,))
    model = ModelFile(name="lags", inputs=(item,), states=(state,), outputs=(output,))
    for rows, begins in ((LATE, LATE), (START_SAMPLES - 1, 0)):
        source = late(rows)
        compared, told = without_displacement_faults(model, source)
        assert compared.runs == source.runs
        late_in = [one for one in told if one.id == "gauge-begins-late"]
        assert len(late_in) == (5 if begins else 0)
        assert all(f"compared from {30 * begins} s on" in one.statement and one.level == "info" for one in late_in)
        starts = known_starts(sensor_starts(model, compared))
        found = apply_model(model, compared, starts)
        for run in source.runs:
            alone = Evaluator(model, starts[run])
            readings = zip(source.time_s(run), source.values(run, ["T1"])[:, 0], strict=True)
            course = np.array([alone.step(time, {"T1": reading})["Z"] for time, reading in readings])[begins:]
            course += (
                Evaluator(model, starts[run]).step(0.0, {"T1": source.values(run, ["T1"])[begins, 0]})["Z"] - course[0]
            )
            of_run = found.predictions["run"] == run
            np.testing.assert_allclose(found.predictions["Z"][of_run] - found.zeros_um[run]["Z"], course, atol=1e-9)
            assert found.per_run[run]["Z"].n_samples == 400 - max(rows, begins)


def hidden(truth: dict[str, np.ndarray]) -> np.ndarray:
    return linear(truth) - 12.0 * truth["hidden"]


def forgetful(rows: int) -> tuple[Recording, Recording]:
    """Runs of a machine with a hidden body whose gauge begins so many rows late: whole, and without what was before."""
    whole = machine(hidden, n_runs=4, n=rows + 300, tau_hidden_s=9000.0)
    late_runs, cut_runs = {}, {}
    for k, run in enumerate(whole.runs):
        values = dict(zip(whole.names, whole.values(run, whole.names).T.copy(), strict=True))
        values["Z"] += OFFSETS_UM[k] - values["Z"][rows]
        cut_runs[run] = (whole.time_s(run)[rows:], {name: of[rows:] for name, of in values.items()})
        values["Z"][:rows] = np.nan
        late_runs[run] = (whole.time_s(run), values)
    return recording(late_runs), recording(cut_runs)


@pytest.mark.parametrize("most_rows", [10**6, 500], ids=["all", "thinned"])
def test_memory_knows_what_the_machine_did_before_its_gauge_began(monkeypatch, most_rows):
    monkeypatch.setattr("selector.selection.fitting.MAX_ROWS", most_rows)
    source, cut = forgetful(200)
    options = Options(max_sensors=2, memory=True)
    known, forgotten = select(source, options), select(cut, options)
    assert known.recipe.design.lags
    assert known.proof.rmse_um("Z") < 0.4 * forgotten.proof.rmse_um("Z")
    assert "memory-goes-on" not in found_ids(known)
    results = known.statsmodels_results("Z", source)
    assert results.nobs == known.models["Z"].n_samples
    assert known.known.in_a_row == 0


def test_a_run_that_is_called_like_what_was_read_before_a_gauge_is_read_itself():
    plain = forgetful(200)[0]
    names = ("day2 before its gauge", *plain.runs[1:])
    called = recording({
        name: (plain.time_s(run), dict(zip(plain.names, plain.values(run, plain.names).T, strict=True)))
        for name, run in zip(names, plain.runs, strict=True)
    })  # fmt: skip
    source = begun(called, ("Z",))
    times = np.concatenate([time_s for time_s, _ in source.chunks(names[0], ("T1",))])
    np.testing.assert_array_equal(times, plain.time_s(plain.runs[0])[200:])
    before, _ = runs_before(source, source.runs)["day2"]
    times = np.concatenate([time_s for time_s, _ in source.chunks(before, ("T1",))])
    np.testing.assert_array_equal(times, plain.time_s(plain.runs[1])[:200])


def test_memory_goes_on_from_the_run_before_through_what_was_not_gauged():
    source = begun(forgetful(200)[0], ("Z",))
    day, morning = source.runs[:2]
    provenance = {"runs": {day: {"start": "2026-03-02T08:00:00"}, morning: {"start": "2026-03-03T08:00:00"}}}
    source.provenance = provenance
    follows = runs_before(source, source.runs)
    assert [later_s for _, later_s in chain_before(follows, morning, np.array([1e6]))] == [86400.0, 86400.0, 0.0]
    assert another_before(follows, morning)
    assert not another_before(follows, day)
