"""The same recordings declared in another way: every effect offers the same shapes, whatever columns are called."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.shapes.heating import spindle_law
from selector.diagnosis.shapes.linear_response import inputs, members
from selector.recording import Channel
from tests.diagnosis.effects.heated_machine import Physics, comparison_of, recorded, simulation

THERMAL = [effect for effect in catalogue() if effect.family == "thermal"]


@pytest.fixture(scope="module")
def machine() -> Comparison:
    """A machine with hall, coolant, its temperature, feed and hydraulics; the simulation has none of them."""
    physics = Physics(hall=1.0, coolant_w_per_m2k=120.0, feed_w=40.0, hydraulics_w=60.0)
    record = recorded(physics, 1)
    plain = comparison_of(record, simulation(Physics(), 1, record))
    chilled = 19.0 + np.round(1.5 * np.sin(plain.time_s / 1700.0), 1)
    tank = Channel("Tk", "temperature", "degC", "coolant tank")
    recorded_too = {**plain.recorded, "Tk": chilled}
    return replace(plain, channels=(*plain.channels, tank), recorded=recorded_too)


def in_other_order(comparison: Comparison) -> Comparison:
    backwards = dict(reversed(comparison.recorded.items()))
    return replace(comparison, channels=comparison.channels[::-1], recorded=backwards)


def with_other_names(comparison: Comparison) -> Comparison:
    called = {channel.name: f"q{99 - 7 * k}" for k, channel in enumerate(comparison.channels)}
    return replace(
        comparison,
        channels=tuple(replace(channel, name=called[channel.name]) for channel in comparison.channels),
        recorded={called[name]: values for name, values in comparison.recorded.items()},
        simulated={called[name]: values for name, values in comparison.simulated.items()},
        responses=tuple(called[name] for name in comparison.responses),
        resolution={called[name]: step for name, step in comparison.resolution.items()},
    )


def turned(comparison: Comparison) -> Comparison:
    names = comparison.responses
    recorded_so = {name: -values if name in names else values for name, values in comparison.recorded.items()}
    return replace(comparison, recorded=recorded_so, simulated={n: -comparison.simulated[n] for n in names})


def zeroed_elsewhere(comparison: Comparison) -> Comparison:
    names = comparison.responses
    recorded_so = {n: values + 41.7 if n in names else values for n, values in comparison.recorded.items()}
    return replace(comparison, recorded=recorded_so, simulated={n: comparison.simulated[n] + 41.7 for n in names})


def cut_in_two(comparison: Comparison) -> Comparison:
    """The first run as two, of which the second begins with the machine as warm as it is then."""
    end, time_s = comparison.starts[1], np.array(comparison.time_s)
    half = end // 2
    time_s[half:end] -= time_s[half]
    runs, starts = ("r1a", "r1b", *comparison.runs[1:]), (0, half, *comparison.starts[1:])
    return replace(comparison, runs=runs, starts=starts, time_s=time_s)


def shapes(comparison: Comparison, response: str) -> dict[str, np.ndarray]:
    """Effect → what every column, beside an offset, makes of one course, without its sign, in ascending order."""
    course = np.random.default_rng(3).normal(size=len(comparison.time_s))
    course -= course.mean()
    return {
        effect.id: np.sort([a for v in effect.variants(comparison, response) for a in np.abs(course @ v.columns)])
        for effect in THERMAL
        if effect.testable(comparison, response) is None
    }


@pytest.mark.parametrize("again", [in_other_order, with_other_names, turned, zeroed_elsewhere])
def test_shapes_are_the_same_however_the_machine_is_declared(
    machine: Comparison, again: Callable[[Comparison], Comparison]
) -> None:
    declared = again(machine)
    names = dict(zip((c.name for c in machine.channels), (c.name for c in declared.channels), strict=True))
    response = names["Z"] if again is with_other_names else "Z"
    before, after = shapes(machine, "Z"), shapes(declared, response)
    assert set(before) == set(after) == {effect.id for effect in THERMAL}
    for id_, columns in before.items():
        # sums in another order; what a ridge takes out of a sensor is told to six digits
        assert after[id_] == pytest.approx(columns, rel=1e-5, abs=1e-5 * columns.max()), id_


def test_of_many_forces_and_members_those_that_move_most_are_looked_at() -> None:
    n = 400
    rng = np.random.default_rng(2)
    channels = [Channel(f"F{k}", "force", "N") for k in range(5)] + [
        Channel(f"a{k}", "acceleration", "m/s^2") for k in range(5)
    ]
    courses = {c.name: (1 + k % 5) * rng.normal(size=n) for k, c in enumerate(channels)}
    shaken = Comparison(
        ("r1",),
        (0, n),
        0.001 * np.arange(n),
        tuple(channels),
        courses,
        {"a0": courses["a0"]},
        ("a0",),
        np.arange(n) > 300,
    )
    for comparison in (shaken, in_other_order(shaken)):
        assert inputs(comparison, "a0") == ("F4", "F3", "F2", "F1")
        assert members(comparison, "a0") == ("a4", "a3", "a2")


@pytest.mark.parametrize("exponent", [1.0, 1.4, 2.0])
def test_the_law_of_speed_is_the_same_in_a_run_that_is_cut_in_two(exponent: float) -> None:
    hall = Physics(hall=1.0)
    whole = comparison_of(recorded(hall, 1), recorded(replace(hall, law=((1.0, exponent),)), 1))
    for response in ("Z", "Y"):
        one, two = spindle_law(whole, response), spindle_law(cut_in_two(whole), response)
        assert one is not None
        assert two is not None
        # seen: 0.01; 0.4 to 1.6 where the half that begins warm counts as cold
        assert two.exponent == pytest.approx(one.exponent, abs=0.03)
        assert two.share > 0.999


def explained_by_coolant(comparison: Comparison) -> float:
    """Share of the mismatch that the best shape of the coolant explains, beside an offset and a gain."""
    simulated, apart = comparison.simulated["Z"], comparison.difference("Z")
    plain = np.column_stack([np.ones_like(simulated), simulated])

    def left(columns: np.ndarray) -> float:
        table = np.column_stack([plain, columns])
        return float(np.sum((apart - table @ np.linalg.lstsq(table, apart)[0]) ** 2))

    variants = next(effect for effect in THERMAL if effect.id == "thermal.coolant").variants(comparison, "Z")
    return 1.0 - min(left(one.columns) for one in variants) / left(plain[:, :0])


def test_coolant_draws_as_much_from_a_machine_that_is_warm_when_a_run_begins() -> None:
    wet = recorded(Physics(coolant_w_per_m2k=120.0), 1)
    whole = comparison_of(wet, simulation(Physics(), 1, wet))
    # seen: 0.003 less; 0.4 less where the half that begins warm counts as cold
    assert explained_by_coolant(cut_in_two(whole)) > explained_by_coolant(whole) - 0.02
