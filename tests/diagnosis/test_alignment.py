"""Recording and simulation on one clock."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.diagnosis.matching.alignment import comparison_of, resolution
from selector.diagnosis.matching.usable import identical_responses
from selector.diagnosis.workflow import diagnosis
from selector.errors import InputError, OptionError
from selector.recording import Channel, Recording

Z = Channel("Z", "displacement", "um")
Y = Channel("Y", "displacement", "um")
T = Channel("T1", "temperature", "degC")
VALVE = Channel("valve", "state", "1")


def recording(runs, channels=(Z,), provenance=None):
    """{run: (time_s, {channel: values})}"""
    tables = {run: pd.DataFrame(columns, index=pd.Index(time)) for run, (time, columns) in runs.items()}
    return Recording.from_runs(tables, channels, provenance)


def noisy(n, seed=0, size=1.0):
    return np.round(size * np.random.default_rng(seed).normal(size=n), 2)


def pair(n=200, runs=("a", "b", "c")):
    time = np.arange(n) * 2.0
    course = np.sin(time / 50.0)
    rec = recording({run: (time, {"Z": np.round(10 * course + noisy(n, k), 2)}) for k, run in enumerate(runs)})
    sim = recording({run: (time, {"Z": 10 * course}) for run in runs})
    return rec, sim


def test_the_last_run_is_held_out():
    comparison = comparison_of(*pair())
    assert comparison.runs == ("a", "b", "c")
    assert np.array_equal(comparison.held_out, comparison.run_index == 2)
    assert comparison.responses == ("Z",)
    # rounding to 2 digits is all there is
    assert comparison.resolution["Z"] == pytest.approx(0.01, rel=1e-6)


def test_other_ways_to_hold_out():
    rec, sim = pair()
    assert np.array_equal(comparison_of(rec, sim, holdout="a").held_out, np.arange(600) < 200)
    share = comparison_of(rec, sim, holdout="0.25").held_out
    # a quarter of every run, at its end; one row is the rounding
    assert abs(share[:200].sum() - 50) <= 1
    assert share[150:200].all()
    assert not share[200:340].any()
    single = comparison_of(*pair(runs=("a",))).held_out
    assert abs(single.sum() - 60) <= 1
    assert single[-60:].all()


@pytest.mark.parametrize("holdout", ["0", "1.5", "nan", "d", "-0.2"])
def test_hold_outs_that_are_none(holdout):
    with pytest.raises(OptionError) as told:
        comparison_of(*pair(), holdout=holdout)
    assert told.value.where == "--holdout"
    assert "a, b, c" in told.value.expected


def test_the_only_run_cannot_be_held_out():
    with pytest.raises(OptionError, match="only run") as told:
        comparison_of(*pair(runs=("a",)), holdout="a")
    assert told.value.where == "--holdout"


@settings(max_examples=20)
@given(step=st.floats(0.3, 9.0), first=st.floats(0.0, 100.0), last=st.floats(300.0, 500.0), seed=st.integers(0, 1000))
def test_a_straight_line_is_read_exactly_whatever_the_grids(step, first, last, seed):
    random = np.random.default_rng(seed)
    time = np.sort(random.uniform(0.0, 400.0, 300))
    time[0] = 0.0
    time = np.unique(time)
    own = np.unique(np.r_[np.arange(first, last, step), last])
    rec = recording({"a": (time, {"Z": 3.0 * time + noisy(len(time), seed)})})
    sim = recording(
        {"a": (own - own[0], {"Z": 3.0 * own + 7.0})}, provenance={"runs": {"a": {"first_stamp_s": own[0]}}}
    )
    comparison = comparison_of(rec, sim)
    read = comparison.simulated["Z"]
    tolerance = 0.5 * np.median(np.diff(time))
    time = comparison.time_s
    inside = (time >= own[0]) & (time <= own[-1])
    outside = (time < own[0] - tolerance - 1e-9) | (time > own[-1] + tolerance + 1e-9)
    assert np.isnan(read[outside]).all()
    # exact but for rounding of 1 in 1e3
    assert np.allclose(read[inside], 3.0 * time[inside] + 7.0, rtol=0, atol=1e-9)


def test_a_coarse_simulation_is_compared_where_it_has_values():
    time = np.arange(0.0, 6000.0, 10.0)
    own = np.arange(3.0, 6000.0, 60.0)
    course = {"a": 200.0, "b": 300.0, "c": 250.0}  # bends within a simulated step
    rec = recording({run: (time, {"Z": 50.0 * np.sin(time / tau) + noisy(600, 2)}) for run, tau in course.items()})
    sim = recording(
        {run: (own - own[0], {"Z": 50.0 * np.sin(own / tau)}) for run, tau in course.items()},
        provenance={"runs": {run: {"first_stamp_s": 3.0} for run in course}},
    )
    comparison = comparison_of(rec, sim)
    assert np.array_equal(comparison.time_s[:3], [0.0, 60.0, 120.0])
    off = comparison.simulated["Z"] - np.concatenate([50.0 * np.sin(own / tau) for tau in course.values()])
    assert np.sqrt(np.mean(off**2)) < 0.6  # 3 s off at up to 0.25 per s; along the whole line 0.36 + what it cuts off
    assert {finding.id for finding in comparison.findings} == {"coarse-simulation"}
    assert comparison.findings[0].evidence["rows"] == 100


def test_clocks_that_start_elsewhere():
    time = np.arange(0.0, 400.0, 2.0)
    rec = recording({"a": (time, {"Z": time + noisy(200)})}, provenance={"runs": {"a": {"first_stamp_s": 30.0}}})
    later = recording({"a": (time, {"Z": time})}, provenance={"runs": {"a": {"first_stamp_s": 0.0}}})
    # same span, 7.5 % later: whether the zero differs or the clock is off cannot be seen; spans that fit are one span
    assert comparison_of(rec, later).simulated["Z"][0] == 0.0
    assert [f.id for f in comparison_of(rec, later).findings] == ["clocks-with-other-zeros"]
    slightly = recording({"a": (time, {"Z": time})}, provenance={"runs": {"a": {"first_stamp_s": 20.0}}})
    # 2.5 %: the stamps are believed, and the difference is there to be found
    assert comparison_of(rec, slightly).simulated["Z"][0] == 10.0
    dated = [{"runs": {"a": {"first_stamp_s": 0.0, "start": f"2026-11-20T08:00:{s:02d}"}}} for s in (12, 2)]
    rec, sim = (recording({"a": (time, {"Z": time + noisy(200, k)})}, provenance=p) for k, p in enumerate(dated))
    assert np.isnan(comparison_of(rec, sim).simulated["Z"][-1])


def test_states_hold_and_holes_stay_holes():
    time = np.arange(0.0, 300.0, 1.0)
    rec = recording({"a": (time, {"Z": noisy(300), "valve": (time > 151) * 1.0})}, (Z, VALVE))
    rare = np.where(np.arange(300) % 5 == 0, time, np.nan)
    rare[100:180] = np.nan
    sim = recording({"a": (time, {"Z": rare, "valve": (time >= 150) * 1.0})}, (Z, VALVE))
    comparison = comparison_of(rec, sim)
    read = comparison.simulated["Z"]
    assert np.allclose(read[:96], time[:96])
    assert np.isnan(read[96:180]).all()
    assert np.isfinite(read[180:295]).all()
    half = recording({"a": (time[::10], {"Z": time[::10], "valve": (time[::10] >= 150) * 1.0})}, (Z, VALVE))
    assert set(comparison_of(rec, half).simulated["valve"][:291]) == {0.0, 1.0}


def test_runs_and_channels_that_only_one_has():
    rec, sim = pair(runs=("a", "b", "c"))
    other = recording({run: (sim.time_s(run), {"Z": sim.values(run, ["Z"])[:, 0]}) for run in ("a", "c")})
    comparison = comparison_of(rec, other)
    assert comparison.runs == ("a", "c")
    assert [(f.id, f.where.run, f.action) for f in comparison.findings] == [("run-not-compared", "b", "leave-out-run")]
    assert [f.id for f in comparison_of(other, sim, responses=["Z"]).findings] == [
        "simulated-only",
        "same-file-twice",  # both are the course without its noise
        "simulation-is-recording",
    ]


def refused(rec, sim, **options):
    with pytest.raises(InputError) as told:
        comparison_of(rec, sim, **options)
    error = told.value
    assert all((error.found, error.expected, error.where, error.advice))
    assert "nan" not in error.found.lower()
    return error


def test_a_displacement_is_found_by_its_axis():
    height = Channel("Verlagerung Z", "displacement", "um", axis="Z")
    time = np.arange(200) * 2.0
    rec, sim = (
        recording({run: (time, {height.name: noisy(200, k)}) for k, run in enumerate("abc")}, (height,)) for _ in "rs"
    )
    for name in ("Z", "z", height.name):
        assert comparison_of(rec, sim, responses=[name]).responses == (height.name,)


def test_what_cannot_be_compared_is_refused():
    rec, sim = pair()
    time = rec.time_s("a")
    assert "recorded runs a, b, c" in refused(rec, pair(runs=("x",))[1]).found
    assert "recorded channels Z" in refused(rec, recording({"a": (time, {"Y": time})}, (Y,))).found
    assert refused(rec, sim, responses=["Y"]).where == "--response"
    warm = recording({"a": (time, {"Z": time})}, (Channel("Z", "temperature", "degC"),))
    assert "displacement" in refused(rec, warm).found
    later = recording({"a": (time, {"Z": time})}, provenance={"runs": {"a": {"first_stamp_s": 1e5}}})
    early = recording({"a": (time[:50], {"Z": time[:50]})}, provenance={"runs": {"a": {"first_stamp_s": 0.0}}})
    assert "no value" in refused(recording({"a": (time, {"Z": noisy(200)})}), later).found
    assert "held out" in refused(recording({"a": (time[:20], {"Z": noisy(20)})}), early).expected
    empty = recording({run: (time, {"Z": np.full(200, np.nan)}) for run in "abc"})
    assert "no value" in refused(rec, empty).found
    assert "recorded" in refused(empty, sim).found
    still = recording({run: (time, {"Z": np.zeros(200)}) for run in "abc"})
    assert "never moves" in refused(still, sim).found


def test_twenty_samples_are_too_few():
    assert re.match(r"Z .* 14 samples", refused(*pair(n=20, runs=("a",))).found)


@pytest.mark.parametrize("factor", [1e3, 1e-3, 1e6])
def test_simulations_in_another_unit_are_refused(factor):
    rec, sim = pair()
    error = refused(rec, sim.with_values(sim.frame * factor))
    assert re.search(r"[\d.e+-]+ times", error.found)
    assert "unit" in error.expected


def test_gains_that_a_calibration_may_have_are_compared():
    rec, sim = pair()
    for factor in (0.5, 1.8, 25.4):
        assert comparison_of(rec, sim.with_values(sim.frame / factor)).responses == ("Z",)


def test_a_response_that_differs_on_held_out_rows_only_is_told():
    rec, sim = pair()
    compared = comparison_of(rec, sim)
    course = np.where(compared.held_out, compared.simulated["Z"], compared.recorded["Z"])
    same = dataclasses.replace(compared, simulated={**compared.simulated, "Z": course})
    assert identical_responses(same) == ()
    answer = diagnosis(same)
    assert answer.verdict == "unexplained"
    assert [f.id for f in answer.findings] == ["differs-held-out"]
    assert "Z" in answer.headline
    assert answer.fit["Z"].train.rmse_before == 0.0 < answer.fit["Z"].heldout.rmse_before


def test_copies_are_told_and_inputs_left_out():
    rec, sim = pair()
    copy = comparison_of(rec, rec)
    assert identical_responses(copy) == ("Z",) == copy.responses
    assert [f.id for f in copy.findings] == ["simulation-is-recording"]
    time = rec.time_s("a")
    both = {run: (time, {"Z": rec.values(run, ["Z"])[:, 0], "T1": 20 + noisy(200, 9)}) for run in "abc"}
    given_back = {run: (time, {"Z": sim.values(run, ["Z"])[:, 0], "T1": both[run][1]["T1"]}) for run in "abc"}
    comparison = comparison_of(recording(both, (Z, T)), recording(given_back, (Z, T)))
    assert comparison.responses == ("Z",)
    assert [(f.id, f.where.channel) for f in comparison.findings] == [("input-of-simulation", "T1")]
    asked = comparison_of(recording(both, (Z, T)), recording(given_back, (Z, T)), responses=["T1", "Z"])
    assert asked.responses == ("Z",)
    assert [f.level for f in asked.findings] == ["warning"]


def test_readings_that_a_simulation_hands_back_on_its_own_clock_are_inputs():
    rec, sim = pair()
    time = rec.time_s("a")
    own = np.arange(time[0], time[-1], 1.7 * np.median(np.diff(time)))
    z = {run: (rec.values(run, ["Z"])[:, 0], sim.values(run, ["Z"])[:, 0]) for run in "abc"}
    warmth = {run: 20 + noisy(200, 9 + k).round(1) for k, run in enumerate("abc")}
    on = (time // 60.0 % 2.0).round()
    recorded = recording({r: (time, {"Z": z[r][0], "T1": warmth[r], "valve": on}) for r in "abc"}, (Z, T, VALVE))

    def compared(off_k):
        courses = {run: [np.interp(own, time, values) for values in (z[run][1], warmth[run], on)] for run in "abc"}
        given = {run: (own, {"Z": x, "T1": t.round(3) + off_k, "valve": v}) for run, (x, t, v) in courses.items()}
        return comparison_of(recorded, recording(given, (Z, T, VALVE)))

    found = [(f.id, f.where.channel) for f in compared(0.0).findings]
    assert compared(0.0).responses == ("Z",)
    assert {("input-of-simulation", "T1"), ("input-of-simulation", "valve")} <= set(found)
    # what is off by more than the rounding of the readings, 0.1 K, was computed
    assert compared(0.1).responses == ("Z", "T1")


@settings(max_examples=30)
@given(step=st.sampled_from([0.001, 0.05, 0.1, 0.5, 5.0]), offset=st.floats(-1e3, 1e3), seed=st.integers(0, 10**6))
def test_resolution_is_the_grid_of_the_readings(step, offset, seed):
    counts = np.round(np.random.default_rng(seed).normal(scale=30.0, size=400))
    # one hundredth: the grid is known from some hundred steps
    assert resolution(counts * step + offset) == pytest.approx(step, rel=1e-2)
    assert resolution(np.random.default_rng(seed).normal(size=400)) < 1e-2 * 1.0


def test_runs_are_compared_alike_in_whatever_order_they_are_given():
    time = np.arange(200) * 2.0
    courses = {run: {"Z": np.sin(time / 50.0) + noisy(200, k, 0.1)} for k, run in enumerate(("r1", "r2", "r10"))}
    given = {"": ("r1", "r2", "r10"), "r10": ("r10", "r1", "r2")}
    one, same = (
        comparison_of(
            recording({run: (time, courses[run]) for run in runs}),
            recording({run: (time, {"Z": np.sin(time / 50.0)}) for run in runs}),
            holdout=holdout or "last",
        )
        for holdout, runs in given.items()
    )
    assert one.runs == same.runs == ("r1", "r2", "r10")
    assert np.array_equal(one.recorded["Z"], same.recorded["Z"])
    assert np.array_equal(one.held_out, same.held_out)


def test_names_that_sort_alike_are_in_one_order_too():
    for names in (("r1", "r01"), ("b", "B")):
        assert comparison_of(*pair(runs=names)).runs == comparison_of(*pair(runs=names[::-1])).runs


def test_a_run_called_last_is_held_out_by_its_name():
    comparison = comparison_of(*pair(runs=("first", "last", "mid")))
    assert np.array_equal(comparison.held_out, comparison.run_index == comparison.runs.index("last"))


def test_the_last_given_is_held_out():
    comparison = comparison_of(*pair(runs=("b", "c", "a")))
    assert comparison.runs == ("a", "b", "c")
    assert np.array_equal(comparison.held_out, comparison.run_index == 0)


@pytest.mark.parametrize(
    ("late", "spacing", "is_input"),
    [(0.0, 0.8, True), (0.9, 0.8, True), (-0.9, 0.8, True), (1.0, 1.0, True), (-1.0, 1.0, True), (4.0, 0.8, False)],
)
def test_a_switch_that_is_handed_back_a_sample_later_is_an_input(late, spacing, is_input):
    rec, sim = pair()
    time = rec.time_s("a")
    sample = np.median(np.diff(time))
    z = {run: (rec.values(run, ["Z"])[:, 0], sim.values(run, ["Z"])[:, 0]) for run in "abc"}

    def on(at):
        return (np.maximum(at, 0.0) // (23.0 * sample) % 2.0).round()

    own = np.arange(0.0, time[-1], spacing * sample)
    given = {run: (own, {"Z": np.interp(own, time, z[run][1]), "valve": on(own - late * sample)}) for run in "abc"}
    recorded = recording({run: (time, {"Z": z[run][0], "valve": on(time)}) for run in "abc"}, (Z, VALVE))
    compared = comparison_of(recorded, recording(given, (Z, VALVE)))
    assert (compared.responses == ("Z",)) is is_input
    assert any(f.id == "input-of-simulation" and f.where.channel == "valve" for f in compared.findings) is is_input
