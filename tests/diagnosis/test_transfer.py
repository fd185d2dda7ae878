"""What unseen rows bear out is named where the likelihood names nothing; shapes at a wrong time tell how much it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.evidence.misfit import elsewhere
from selector.diagnosis.evidence.response import bench_of
from selector.diagnosis.evidence.search import Search, search
from selector.diagnosis.evidence.transfer import _Shapes, borne_out, leaves_far_less
from selector.diagnosis.workflow import diagnosis
from selector.recording import Channel
from tests.diagnosis.made import coloured, comparison

N = 600


def missing_memory(seed: int, size: float) -> Comparison:
    """Three runs of which a slow part of the heat is missing, under noise that wanders."""
    random = np.random.default_rng(seed)
    plain = comparison({"Z": coloured("ar", 3 * N, random)})
    recorded = plain.recorded | {"Z": plain.recorded["Z"] + size * missing_course(plain)}
    return replace(plain, recorded=recorded)


def missing_course(plain: Comparison) -> np.ndarray:
    """A slow part of the heat in every run, of spread 1."""
    slow = np.zeros(3 * N)
    for k, warm in enumerate(plain.simulated["Z"]):
        slow[k] = 0.0 if k % N == 0 else slow[k - 1] + 0.004 * (warm - slow[k - 1])
    return slow / slow.std()


@pytest.mark.parametrize("is_shifted", [False, True])
def test_shares_are_those_of_least_squares(is_shifted):
    bench, _ = bench_of(missing_memory(0, 3.0), "Z", catalogue())
    shapes = _Shapes(bench)
    rows = elsewhere(bench.runs, np.random.default_rng(3)) if is_shifted else np.arange(3 * N)
    shares = shapes.shares(rows)
    fitted, held, target = bench.fitted, ~bench.fitted, bench.target
    assert len(shares) > 20
    assert set(np.diff(np.sort(rows))) == {1}

    def left(columns):
        return target - columns @ np.linalg.lstsq(columns[fitted], target[fitted], rcond=None)[0]

    plain = left(bench.nuisance)
    for v, share in list(zip(shapes.numbers, shares, strict=True))[::7]:
        after = left(np.column_stack([bench.nuisance, bench.raw(v)[np.argsort(rows)]]))
        here = 1.0 - np.mean(after[fitted] ** 2) / np.mean(plain[fitted] ** 2)
        there = 1.0 - np.mean(after[held] ** 2) / min(np.mean(plain[held] ** 2), np.mean(target[held] ** 2))
        assert share == pytest.approx(min(here, there), abs=1e-6)


def test_a_shape_explains_what_it_does_between_its_bounds():
    bench, _ = bench_of(missing_memory(0, 3.0), "Z", catalogue())
    shapes = _Shapes(bench)
    rows = np.arange(3 * N)
    told = dict(zip(shapes.numbers, shapes.shares(rows), strict=True))
    v = max((one for one in told if bench.counts[one] == 1), key=lambda one: told[one])
    column, target, fitted = bench.raw(v), bench.target, bench.fitted
    assert told[v] > 0.2
    base = np.column_stack([bench.nuisance, column])
    scale = float(bench.scales[bench.candidates[v].columns][0])
    half = 0.5 * np.linalg.lstsq(base[fitted], target[fitted], rcond=None)[0][-1]
    bounds = ((min(half / scale, 0.0), max(half / scale, 0.0)),)
    bounded = [
        replace(one, variant=replace(one.variant, bounds=bounds)) if k == v else one
        for k, one in enumerate(bench.candidates)
    ]
    of = dict(zip(shapes.numbers, _Shapes(replace(bench, candidates=bounded)).shares(rows), strict=True))[v]

    def left(values):
        return values - bench.nuisance @ np.linalg.lstsq(bench.nuisance[fitted], values[fitted], rcond=None)[0]

    plain, after = left(target), left(target - half * column[:, 0])
    here = 1.0 - np.mean(after[fitted] ** 2) / np.mean(plain[fitted] ** 2)
    there = 1.0 - np.mean(after[~fitted] ** 2) / min(np.mean(plain[~fitted] ** 2), np.mean(target[~fitted] ** 2))
    assert of == pytest.approx(min(here, there), abs=1e-6)
    assert of < told[v]


def test_shapes_that_stand_in_every_run_are_the_same_at_any_time_and_are_not_asked():
    bench, _ = bench_of(missing_memory(0, 3.0), "Z", catalogue())
    v = _Shapes(bench).numbers[0]
    column = np.repeat([0.0, 1.0, 1.0], N)[:, None]
    of = bench.candidates[v]
    standing = replace(of, variant=replace(of.variant, columns=column + 0.01 * of.variant.columns))
    some = list(bench.candidates)
    some[v] = standing
    assert v not in _Shapes(replace(bench, candidates=some)).numbers


def unnamed(asked: Comparison) -> Search:
    benches = {name: bench_of(asked, name, catalogue())[0] for name in asked.responses}
    return replace(search(benches, false_alarm=0.02, seed=0), named={})


@pytest.mark.parametrize("seed", range(3))
def test_noise_that_wanders_bears_nothing_out(seed):
    asked = comparison({"Z": 3.0 * coloured("ar", 3 * N, np.random.default_rng(seed))})
    found = unnamed(asked)
    assert borne_out(asked, found, seed=0) is found


def test_without_unseen_rows_nothing_is_borne_out():
    asked = missing_memory(0, 3.0)
    everything = replace(asked, held_out=np.zeros(3 * N, dtype=bool))
    found = unnamed(everything)
    assert borne_out(everything, found, seed=0) is found


def test_unseen_rows_that_are_simulated_exactly_bear_nothing_out():
    plain = tap()
    exact = np.where(plain.held_out, plain.simulated["a"], plain.recorded["a"])
    asked = replace(plain, recorded={"a": exact})
    found = unnamed(asked)
    assert borne_out(asked, found, seed=0) is found


def tap() -> Comparison:
    """A free decay of two modes, of which one is simulated."""
    t = np.arange(512) / 512.0

    def rings(hz, damping, size):
        return size * np.exp(-2.0 * np.pi * hz * damping * t) * np.sin(2.0 * np.pi * hz * t)

    simulated = rings(8.0, 0.01, 20.0)
    recorded = simulated + rings(50.0, 0.008, 12.0) + 0.3 * np.random.default_rng(5).standard_normal(512)
    return Comparison(
        runs=("tap",),
        starts=(0, 512),
        time_s=t,
        channels=(Channel("a", "acceleration", "m/s^2"),),
        recorded={"a": recorded},
        simulated={"a": simulated},
        responses=("a",),
        held_out=np.arange(512) >= 360,
    )


def swinging() -> Comparison:
    """A pendulum that is pushed every six seconds, of which nothing is simulated."""
    n, step_s, omega = 2400, 0.02, 2.0 * np.pi * 0.7
    push = np.where(np.arange(n) % 300 < 5, 1.0, 0.0)
    _, angle, _ = lsim(([omega**2], [1.0, 0.04 * omega, omega**2]), push, np.arange(n) * step_s)
    noise = 0.05 * np.std(angle) * np.random.default_rng(2).standard_normal(n)
    return Comparison(
        runs=("pushed",),
        starts=(0, n),
        time_s=np.arange(n) * step_s,
        channels=(Channel("u", "voltage", "V", axis="X"), Channel("angle", "position", "m", axis="C")),
        recorded={"u": push, "angle": angle + noise},
        simulated={"angle": np.zeros(n)},
        responses=("angle",),
        held_out=np.arange(n) >= 1700,
    )


def test_of_what_rings_all_the_time_a_shape_has_to_leave_less_than_at_a_wrong_time():
    """At a wrong time a shape that rings explains most, so that no share is a quarter more."""
    asked = swinging()
    told = borne_out(asked, unnamed(asked), seed=0)
    assert set(told.named) == {"vibration.mode"}
    share, by_chance = told.carried["vibration.mode"]
    assert share > 0.99
    assert by_chance.max() > 0.8


def test_what_carries_is_told_with_how_sure_it_can_be():
    told = borne_out(tap(), unnamed(tap()), seed=0)
    assert set(told.named) == {"vibration.mode"} == told.doubted
    assert told.rivals["vibration.mode"] == ()
    assert told.weights["vibration.mode"] == {"vibration.mode": 1.0}
    share, by_chance = told.carried["vibration.mode"]
    assert share > 1.25 * by_chance.max()


def test_where_the_likelihood_names_nothing_the_answer_names_what_carries(monkeypatch):
    """A free decay is what a filter of noise makes, too: of a measured one the likelihood may say nothing."""

    def nothing(benches, **options):
        return replace(search(benches, **options), named={})

    monkeypatch.setattr("selector.diagnosis.workflow.search", nothing)
    answer = diagnosis(tap())
    (effect,) = answer.effects
    assert answer.verdict == "missing-physics"
    assert effect.id == "vibration.mode"
    assert effect.parameters["frequency_hz"].value == pytest.approx(50.0, rel=0.01)
    assert effect.confidence <= 0.75
    assert effect.p_value == pytest.approx(1.0 / 61.0)
    assert "chosen-by-unseen-rows" in {one.id for one in answer.findings}
    assert answer.fit["a"].heldout.rmse_after < 0.8 * answer.fit["a"].heldout.rmse_before


@pytest.mark.parametrize("is_one_run", [False, True])
def test_a_little_part_of_a_record_of_one_run_is_no_name(is_one_run):
    random = np.random.default_rng(2)
    plain = comparison({"Z": random.standard_normal(3 * N)})
    asked = replace(plain, recorded=plain.recorded | {"Z": plain.recorded["Z"] + 0.25 * missing_course(plain)})
    if is_one_run:
        asked = replace(asked, runs=("r1",), starts=(0, 3 * N), time_s=np.arange(3 * N) * 30.0)
    answer = diagnosis(asked)
    named, seen = ({effect.id for effect in of} for of in (answer.effects, answer.also_seen))
    assert "thermal.memory" in (seen if is_one_run else named)
    assert "thermal.memory" not in (named if is_one_run else seen)


def test_what_recalibration_takes_is_not_borne_out():
    found = unnamed(tap())
    owned = {name: replace(bench, own={"vibration.mode": slice(0, 0)}) for name, bench in found.benches.items()}
    assert borne_out(tap(), replace(found, benches=owned), seed=0).named == {}


@pytest.mark.parametrize("hz", [23.7, 60.0])
def test_a_hum_in_one_run_is_a_line_or_at_one_speed_a_ripple(hz):
    n = 6000
    time_s = np.arange(n) * 0.002
    noise = np.random.default_rng(4).standard_normal(n)
    channels = (Channel("x", "position", "m", axis="X"), Channel("F", "force", "N", axis="X"))
    recorded = {"x": 0.1 * time_s, "F": 40.0 + 5.0 * np.sin(2.0 * np.pi * hz * time_s) + noise}
    made = Comparison(("r1",), (0, n), time_s, channels, recorded, {"F": np.full(n, 40.0)}, ("F",), time_s > 8.4)
    (effect,) = diagnosis(made, seed=0).effects
    assert {effect.id, *effect.cannot_be_told_from} >= {"vibration.line", "drive.ripple"}
    if effect.id == "vibration.line":
        assert effect.parameters["frequency_hz"].value == pytest.approx(hz, rel=1e-3)
        assert effect.parameters["amplitude"].value == pytest.approx(5.0, rel=0.05)
    else:
        assert effect.parameters["lead_mm"].value == pytest.approx(1e3 * 0.1 / hz, rel=1e-2)


def test_names_give_way_to_what_leaves_half_of_what_they_do_and_not_to_their_like():
    asked = missing_memory(0, 3.0)
    nothing = unnamed(asked)
    carried = borne_out(asked, nothing, seed=0)
    assert leaves_far_less(carried, nothing)
    assert not leaves_far_less(carried, carried)
    elsewhere = replace(nothing, named={"data.step": {"Y": 0}})
    assert not leaves_far_less(carried, elsewhere)
