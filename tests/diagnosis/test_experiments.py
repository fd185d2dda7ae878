"""The advised run tells apart what the record cannot; checked with truths that are no shape of the catalogue."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from selector.diagnosis.answer import NamedEffect
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.evidence.naming import named_effect
from selector.diagnosis.evidence.response import bench_of
from selector.diagnosis.evidence.search import Search, search, standings
from selector.diagnosis.next_run.experiments import Separation, extended, next_runs, separations, shortened
from selector.diagnosis.next_run.planned_runs import PlannedRun, planned_runs
from selector.recording import Channel

Vector = NDArray[np.float64]


# --- a heated machine: nodes in a row, finite differences


def heated(speeds: Sequence[Vector], *, slow_um: float, noise_um: float = 0.3, step_s: float = 60.0) -> Comparison:
    """Z follows the spindle quickly, as simulated, and through ten nodes of a column, which is not simulated."""
    rng = np.random.default_rng(11)
    parts = []
    for speed in speeds:
        heat = speed / 6000.0
        quick, column = np.zeros(len(heat)), np.zeros((len(heat), 10))
        for k in range(1, len(heat)):
            quick[k] = quick[k - 1] + step_s / 1500.0 * (heat[k - 1] - quick[k - 1])
            now = column[k - 1]
            flow = np.diff(np.r_[quick[k - 1], now, now[-1]])
            column[k] = now + step_s / 240.0 * (flow[1:] - flow[:-1])
        simulated = 40.0 * quick
        z = simulated + slow_um * column.mean(axis=1) + noise_um * rng.standard_normal(len(heat))
        parts.append((speed, 20.0 + 12.0 * quick + 0.05 * rng.standard_normal(len(heat)), z, simulated))
    lengths = [len(part[0]) for part in parts]
    speed, warm, z, simulated = (np.concatenate([part[k] for part in parts]) for k in range(4))
    channels = (
        Channel("n", "spindle_speed", "rpm"),
        Channel("T1", "temperature", "degC"),
        Channel("Z", "displacement", "um", axis="Z"),
    )
    return Comparison(
        runs=tuple(f"r{k}" for k in range(len(parts))),
        starts=(0, *np.cumsum(lengths).tolist()),
        time_s=np.concatenate([step_s * np.arange(n) for n in lengths]),
        channels=channels,
        recorded={"n": speed, "T1": warm, "Z": z},
        simulated={"Z": simulated},
        responses=("Z",),
        held_out=np.zeros(sum(lengths), dtype=bool),
    )


def found_in(comparison: Comparison, ids: Sequence[str], name: str) -> tuple[Search, NamedEffect]:
    """The search among these effects where `name` is named with its best shape, and the others are its rivals."""
    benches = {r: bench_of(comparison, r, [effect_of(id_) for id_ in ids])[0] for r in comparison.responses}
    found = search(benches, false_alarm=0.05, seed=0)
    alone = standings(found.benches, {}, {r: bench.white_target for r, bench in found.benches.items()}, seed=0)
    best = {r: alone[name].tested[r].best for r in alone[name].responses}
    found = replace(found, named={name: best}, standing=alone, rivals={name: ()}, weights={name: {name: 1.0}})
    effect = named_effect(comparison, found, name)
    return found, replace(effect, cannot_be_told_from=tuple(id_ for id_ in ids if id_ != name))


def lead(comparison: Comparison, ids: Sequence[str], name: str) -> float:
    """By how much the true effect lowers the whitened sum of squares more than the best rival; viscous is fitted
    beside it anyway."""
    standing = found_in(comparison, ids, name)[0].standing
    gains = {id_: sum(one.gain for one in of.tested.values()) for id_, of in standing.items()}
    return gains[name] - max((gains[id_] for id_ in ids if id_ != name and id_ in gains), default=0.0)


def weakest(pairs: Sequence[Separation]) -> float:
    return min(pair.d for pair in pairs)


@pytest.fixture(scope="module")
def warm_only() -> Comparison:
    """Two runs that only heat up, at two speeds: a slow mode and another law of speed look much alike."""
    return heated([np.full(150, 3000.0), np.full(150, 6000.0)], slow_um=2.0)


HEAT = ("thermal.memory", "thermal.speed_heating")


def test_a_duty_that_was_not_run_tells_memory_from_a_law_of_speed(warm_only: Comparison) -> None:
    found, effect = found_in(warm_only, HEAT, "thermal.memory")
    advised = next_runs(warm_only, found, [effect])
    best = advised[0]
    assert best.power is not None
    assert best.duration_s is not None
    assert set(best.separates) <= set(HEAT)
    plans = {plan.description: plan for plan in planned_runs(warm_only, "Z")}
    d = {words: weakest(separations(warm_only, found, effect, HEAT[1:], plan)) for words, plan in plans.items()}
    # all these runs take the same time, so the first is the one that separates most
    assert best.description == max(d, key=lambda words: d[words])
    # once more what was already run tells less than what is advised
    n = len(plans[best.description].inputs["n"])
    again = PlannedRun("the same again", {"n": np.full(n, 6000.0)}, 60.0 * n)
    assert weakest(separations(warm_only, found, effect, HEAT[1:], again)) < d[best.description]


def test_the_advised_run_of_the_true_machine_does_tell() -> None:
    speeds = [np.full(150, 3000.0), np.full(150, 6000.0)]
    record = heated(speeds, slow_um=0.8)
    found, effect = found_in(record, HEAT, "thermal.memory")
    advised = next_runs(record, found, [effect])[0]
    assert advised.power is not None
    plan = next(plan for plan in planned_runs(record, "Z") if plan.description == advised.description)
    more = heated([*speeds, plan.inputs["n"]], slow_um=0.8)
    # a lead of 8.8 is nine tenths of the weight, which is what `power` is the chance of
    assert lead(record, HEAT, "thermal.memory") < 8.8 < lead(more, HEAT, "thermal.memory")


@pytest.mark.parametrize("k", range(5))
def test_the_lead_comes_out_as_foretold(warm_only: Comparison, k: int) -> None:
    found, effect = found_in(warm_only, HEAT, "thermal.memory")
    plan = planned_runs(warm_only, "Z")[k]
    pair = next(p for p in separations(warm_only, found, effect, HEAT[1:], plan) if p.true == "thermal.memory")
    more = heated([np.full(150, 3000.0), np.full(150, 6000.0), plan.inputs["n"]], slow_um=2.0)
    # a lead has the mean d² and the spread 2·d; two spreads
    assert abs(lead(more, HEAT, "thermal.memory") - pair.d**2) < 4.0 * pair.d


def test_a_foretold_run_is_near_the_true_one(warm_only: Comparison) -> None:
    speed = np.where(np.arange(300) < 150, 4500.0, 0.0)
    longer = extended(warm_only, PlannedRun("", {"n": speed}, 18_000.0), "Z")
    assert longer is not None
    true = heated([speed], slow_um=2.0)
    n = len(speed)
    for name, told, is_ in (
        ("Z", longer.simulated["Z"][-n:], true.simulated["Z"]),
        ("T1", longer.recorded["T1"][-n:] - 20.0, true.recorded["T1"] - 20.0),
    ):
        # learnt from two heating runs, used for cooling: a tenth of the range is what a weighing needs
        assert np.sqrt(np.mean((told - is_) ** 2)) < 0.1 * np.ptp(is_), name


# --- an axis whose force is compared


def pushed(places: Sequence[Vector], *, dry_n: float, step_s: float = 0.004) -> Comparison:
    """Force of a linear motor on 40 kg; the simulation knows the mass only. Friction turns over as tanh of speed."""
    rng = np.random.default_rng(5)
    recorded, simulated, place_all = [], [], []
    for place in places:
        speed = np.gradient(place, step_s)
        inertia = 40.0 * np.gradient(speed, step_s)
        recorded.append(inertia + dry_n * np.tanh(speed / 5e-4) + 4.0 * rng.standard_normal(len(place)))
        simulated.append(inertia)
        place_all.append(place)
    lengths = [len(place) for place in places]
    return Comparison(
        runs=tuple(f"r{k}" for k in range(len(places))),
        starts=(0, *np.cumsum(lengths).tolist()),
        time_s=np.concatenate([step_s * np.arange(n) for n in lengths]),
        channels=(Channel("r", "position_command", "m", axis="X"), Channel("F", "force", "N", axis="X")),
        recorded={"r": np.concatenate(place_all), "F": np.concatenate(recorded)},
        simulated={"F": np.concatenate(simulated)},
        responses=("F",),
        held_out=np.zeros(sum(lengths), dtype=bool),
    )


def one_speed(n: int = 1500, step_s: float = 0.004) -> Vector:
    """To and fro at 0.1 m/s, with soft turns and without a dwell."""
    speed = 0.1 * np.clip(3.0 * np.sin(2.0 * np.pi * np.arange(n) * step_s / 2.0), -1.0, 1.0)
    return np.asarray(0.1 + np.cumsum(speed) * step_s)


FRICTION = ("drive.coulomb", "drive.viscous")


def test_two_speeds_both_ways_tell_dry_from_viscous_friction() -> None:
    record = pushed([one_speed(), one_speed()], dry_n=0.8)
    found, effect = found_in(record, FRICTION, "drive.coulomb")
    plans = planned_runs(shortened(record), "F")
    d = {p.description: weakest(separations(record, found, effect, FRICTION[1:], p)) for p in plans}
    two = next(d[words] for words in d if words.startswith("Move at constant") and " and " in words)
    same = next(d[words] for words in d if "there and back three times" in words)
    assert two > same
    advised = next_runs(record, found, [effect])
    assert advised[0].power is not None
    assert d[advised[0].description] > same
    plan = next(p for p in plans if p.description == advised[0].description)
    more = pushed([one_speed(), one_speed(), plan.inputs["r"]], dry_n=0.8)
    assert lead(more, FRICTION, "drive.coulomb") > lead(record, FRICTION, "drive.coulomb")


def test_without_a_menu_the_own_experiment_of_the_effect_is_named(warm_only: Comparison) -> None:
    found, effect = found_in(warm_only, HEAT, "thermal.memory")
    untestable = replace(effect, cannot_be_told_from=("thermal.coolant",))
    (run,) = next_runs(warm_only, found, [untestable])
    assert (run.description, run.power, run.duration_s) == (effect.experiment, None, None)


def test_what_is_told_needs_no_run(warm_only: Comparison) -> None:
    found, effect = found_in(warm_only, HEAT, "thermal.memory")
    assert next_runs(warm_only, found, [replace(effect, cannot_be_told_from=())]) == ()
    assert next_runs(warm_only, found, [replace(effect, cannot_be_told_from=(), suspected=True)]) == ()


@pytest.mark.parametrize(("d", "power"), [(0.0, 0.0), (np.sqrt(2.0 * np.log(0.85 / 0.15)), 0.5), (20.0, 1.0)])
def test_power_rises_from_nothing_through_a_half_to_one(d: float, power: float) -> None:
    # at d² = 2·ln(0.85/0.15) the expected lead is just what is asked for; at 20 its spread is 40 and the rest 197 above
    assert Separation("a", "b", d).power == pytest.approx(power, abs=1e-5)


def test_every_planned_run_keeps_within_what_was_recorded(warm_only: Comparison) -> None:
    for plan in planned_runs(warm_only, "Z"):
        speed = plan.inputs["n"]
        assert np.isfinite(speed).all()
        assert speed.min() >= 0.0
        assert speed.max() <= 6000.0
    record = pushed([one_speed()], dry_n=0.8)
    for plan in planned_runs(record, "F"):
        place, seen = plan.inputs["r"], record.recorded["r"]
        # the last stroke of a truncated programme may end anywhere within the travel; 2 % is the rounding of jerk
        slack = 0.02 * np.ptp(seen)
        assert seen.min() - slack <= place.min()
        assert place.max() <= seen.max() + slack
        assert np.abs(np.gradient(place, 0.004)).max() <= 1.05 * np.abs(np.gradient(seen, 0.004)).max()
