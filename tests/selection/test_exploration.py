"""What the live page says of a λ and of a set is what `select` finds for the same."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from selector.errors import OptionError
from selector.models.design import datum_of, rows_of
from selector.models.least_squares import fault_gains
from selector.recording import Recording
from selector.selection import Options, select
from selector.selection.exploration import Exploration, plain_level
from selector.selection.fitting import Part, Recipe, final_models, predictions
from selector.selection.library import Shape
from selector.sensors.groups import LambdaStep, Partition
from tests.models.runs import InPieces, recording
from tests.selection.machines import SENSORS, machine

EXACT = 1e-9
"""Both go through sums of squares of the same samples in float64; conditions here stay below 1e6."""


@pytest.fixture(scope="module")
def source():
    return machine(n_runs=4, n=120, second=lambda u: 3 * u["air"] - u["column"])


@pytest.fixture(scope="module")
def explored(source):
    return Exploration.of(source)


def as_fitted(explored: Exploration, source: Recording, sensors):
    """(recipe, rows, models by samples) of a fixed set, with the functions that `select` uses."""
    question = explored.question
    datum = datum_of(source, question.sensors, question.responses, question.options.reference)
    recipe = Recipe.of(question, datum, tuple(sensors), Shape())
    rows = rows_of(source, recipe.design, source.runs)
    return recipe, rows, final_models(recipe, rows)


def assert_agrees(explored: Exploration, source: Recording, sensors, *, close=EXACT):
    recipe, rows, models = as_fitted(explored, source, sensors)
    found = explored.fixed(sensors)
    parts = [Part(run, (run,)) for run in source.runs]
    for name, model in models.items():
        j = recipe.design.responses.index(name)
        one = found.models[name]
        _, physical, _ = model.physical()
        assert [c.per_kelvin_um for c in one.coefficients] == pytest.approx(physical[1:], rel=close, abs=close)
        assert [c.vif for c in one.coefficients] == pytest.approx(model.vif, rel=close)
        assert (one.r2, one.adjusted_r2) == pytest.approx((model.r2, model.adjusted_r2), rel=close)
        assert one.rmse_um == pytest.approx(model.rmse_um, rel=close)
        for part, proof in zip(one.parts, parts, strict=True):
            unseen = rows.only(proof.unseen(rows))
            error = unseen.responses[:, j] - predictions(recipe, rows.only(proof.training(rows)), unseen)[:, j]
            assert part.name == proof.name
            assert part.n_samples == len(error)
            assert part.rmse_um == pytest.approx(np.sqrt(np.mean(error**2)), rel=close)
            assert part.before_rmse_um == pytest.approx(np.sqrt(np.mean(unseen.responses[:, j] ** 2)), rel=close)
        rise = explored.question.options.reference == "rise"
        for gain in fault_gains(model, rows.variables, recipe.sensors, {}, rise=rise):
            (mine,) = [one for one in found.faults if (one.sensor, one.response) == (gain.sensor, name)]
            assert dataclasses.astuple(mine)[2:] == pytest.approx(dataclasses.astuple(gain)[2:], rel=close, abs=close)


class TestAgreement:
    @pytest.mark.parametrize("sensors", [("T1",), ("T1", "T4"), ("T2", "T3", "T5", "T7"), SENSORS])
    def test_a_fixed_set_is_the_fit_on_the_samples(self, explored, source, sensors):
        assert_agrees(explored, source, sensors)

    def test_absolute_readings(self, source):
        assert_agrees(Exploration.of(source, Options(reference="absolute")), source, ("T1", "T4", "T6"))

    def test_two_runs(self):
        source = machine(n_runs=2, n=150)
        recipe, rows, _ = as_fitted(explored := Exploration.of(source), source, ("T1", "T4"))
        parts = explored.fixed(("T1", "T4")).models["Z"].parts
        assert [part.name for part in parts] == list(source.runs)
        for part, proof in zip(parts, (Part(run, (run,)) for run in source.runs), strict=True):
            unseen = rows.only(proof.unseen(rows))
            error = unseen.responses - predictions(recipe, rows.only(proof.training(rows)), unseen)
            # samples between the blocks of a run are in no fold: a sixth of them here
            assert 0.8 * len(unseen.run) < part.n_samples < len(unseen.run)
            assert part.rmse_um == pytest.approx(np.sqrt(np.mean(error[:, 0] ** 2)), rel=0.1)

    @given(st.sets(st.sampled_from(SENSORS), min_size=1, max_size=5))
    @settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
    def test_every_set_agrees(self, explored, source, sensors):
        assert_agrees(explored, source, sorted(sensors))

    @pytest.mark.parametrize("level", [0.99, 0.9, 0.5])
    def test_a_cut_takes_what_select_takes_at_that_level(self, explored, source, level):
        found = select(source, Options(level=level))
        cut = explored.cut(level)
        assert cut.taken == found.chosen
        assert cut.representatives == found.grouping.chosen.representatives
        assert [group.sensors for group in cut.groups] == list(found.grouping.chosen.rounds[0].partition.groups)
        document = found.as_dict()
        fixed = explored.fixed(cut.taken)
        for name, model in document["models"].items():
            one = fixed.models[name]
            assert {c.sensor: c.per_kelvin_um for c in one.coefficients} == pytest.approx(
                {next(iter(term["powers"])): term["coefficient"] for term in model["terms"]}, rel=EXACT
            )
            assert one.r2 == pytest.approx(model["r2"], rel=EXACT)
        for one in document["combinations"]:
            fixed = explored.fixed(one["sensors"]).models[one["response"]]
            assert fixed.heldout_rmse_um == pytest.approx(one["heldout_rmse_um"], rel=EXACT)
            assert fixed.adjusted_r2 == pytest.approx(one["adjusted_r2"], rel=EXACT)

    def test_without_a_level_the_choice_is_that_of_select(self, explored, source):
        found = select(source)
        assert explored.grouping.chosen.level == found.grouping.chosen.level
        assert found.chosen in explored.best_sets.values()

    def test_pieces_of_a_run_give_the_same(self, explored, source):
        pieces = Exploration.of(InPieces(source, 17))
        for name in ("Z", "Y"):
            one, other = (e.fixed(("T1", "T5")).models[name] for e in (explored, pieces))
            assert one.heldout_rmse_um == pytest.approx(other.heldout_rmse_um, rel=EXACT)
            assert [c.per_kelvin_um for c in one.coefficients] == pytest.approx(
                [c.per_kelvin_um for c in other.coefficients], rel=1e-7
            )


class TestHardRecordings:
    def test_a_single_run_leaves_its_blocks_out(self):
        source = machine(n_runs=1, n=240)
        explored = Exploration.of(source)
        assert explored.parts == "block"
        fixed = explored.fixed(("T1", "T4")).models["Z"]
        assert len(fixed.parts) == 8
        combination = {one.sensors: one.heldout_rmse_um for one in select(source, Options(level=0.0)).combinations}
        (sensors,) = combination
        assert explored.fixed(sensors).models["Z"].heldout_rmse_um == pytest.approx(combination[sensors], rel=EXACT)

    def test_conditions_are_left_out_whole(self, source):
        conditions = {"day1": "winter", "day2": "winter", "day3": "summer", "day4": "summer"}
        explored = Exploration.of(source, Options(conditions=conditions))
        assert explored.parts == "condition"
        assert [part.name for part in explored.fixed(("T1",)).models["Z"].parts] == ["winter", "summer"]

    def test_missing_samples_and_useless_sensors(self):
        source = machine(n_runs=4, n=120)
        frame = source.frame.copy()
        frame["T7"] = 21.0
        frame["T5"] = frame["T4"]
        frame.iloc[10:40, frame.columns.get_loc("T2")] = np.nan
        explored = Exploration.of(source.with_values(frame))
        assert "T7" not in explored.available
        assert {finding.where.channel for finding in explored.findings} >= {"T7"}
        fixed = explored.fixed(("T1", "T4", "T5"))
        assert fixed.n_samples == 480 - 30
        vif = {c.sensor: c.vif for c in fixed.models["Z"].coefficients}
        assert vif["T4"] == vif["T5"] == np.inf
        assert np.isfinite(vif["T1"])
        alone = explored.fixed(("T1", "T4"))
        assert fixed.models["Z"].heldout_rmse_um == pytest.approx(alone.models["Z"].heldout_rmse_um, rel=1e-6)
        found = select(source.with_values(frame), Options(level=0.9))
        for one in found.combinations:
            fixed = explored.fixed(one.sensors).models["Z"]
            assert fixed.heldout_rmse_um == pytest.approx(one.heldout_rmse_um, rel=EXACT)

    def test_a_large_offset_of_the_gauge_costs_few_digits(self):
        source = machine(n_runs=4, n=120, noise_um=0.01)
        frame = source.frame.copy()
        frame["Z"] += 1e4
        options = Options(reference="absolute")
        near, far = (Exploration.of(one, options).fixed(SENSORS) for one in (source, source.with_values(frame)))
        # squares of 1e4 µm are known to 1e-8 µm², of those of a tenth of a micron
        assert far.models["Z"].heldout_rmse_um == pytest.approx(near.models["Z"].heldout_rmse_um, rel=1e-5)

    def test_more_sensors_than_samples(self):
        rng = np.random.default_rng(0)
        t = np.arange(4) * 60.0
        runs = {
            f"r{r}": (
                t,
                {**{f"T{i}": 20 + rng.normal(0, 1, 4).cumsum() for i in range(1, 21)}, "Z": rng.normal(0, 5, 4)},
            )
            for r in range(3)
        }
        explored = Exploration.of(recording(runs), Options(reference="absolute"))
        cut = explored.cut(0.9)
        assert len(cut.taken) <= 5
        with pytest.raises(OptionError, match=r"12 complete samples .* 21 coefficients"):
            explored.fixed(explored.available)


class TestWishes:
    def test_never_must_and_max(self, explored, source):
        asked = explored.asking(Options(must=("T7",), never=("T1",), max_sensors=2))
        cut = asked.cut(0.9)
        assert "T7" in cut.taken
        assert "T1" not in {name for group in cut.groups for name in group.sensors}
        assert max(cut.best_sets) == 2
        assert cut.taken == select(source, Options(level=0.9, must=("T7",), never=("T1",), max_sensors=2)).chosen
        assert explored.cut(0.9).taken != cut.taken

    def test_a_dear_sensor_makes_room_for_its_like(self, explored):
        groups = explored.cut(0.95).groups
        (group,) = [group for group in groups if "T2" in group.sensors and len(group.sensors) > 1]
        assert "largest" in group.because
        dear = explored.asking(Options(cost={group.representatives[0]: 5.0}))
        assert dear.question.options.total_cost(group.representatives) == 5.0

    @pytest.mark.parametrize(
        ("wishes", "said"),
        [
            ({"must": ("T9",)}, "T9"),
            ({"never": SENSORS}, "every sensor is excluded"),
            ({"must": ("T1",), "never": ("T1",)}, "T1 in both"),
            ({"must": ("T1", "T2"), "max_sensors": 1}, "2 sensors"),
        ],
    )
    def test_impossible_wishes(self, explored, wishes, said):
        with pytest.raises(OptionError, match=said):
            explored.asking(Options(**wishes))

    def test_a_set_of_unknown_sensors(self, explored):
        with pytest.raises(OptionError, match="T9"):
            explored.fixed(("T1", "T9"))

    def test_groups_say_why(self, explored):
        cut = explored.asking(Options(must=("T3",))).cut(0.0)
        (group,) = cut.groups
        assert group.representatives == ("T3",)
        assert group.because == "must be kept"
        assert {group.because[:5] for group in explored.cut(1.0).groups} == {"alone"}


class TestLevels:
    def test_every_step_is_reached_by_its_plain_level(self, explored):
        for step in explored.steps:
            level = plain_level(step)
            assert explored.axis.at(level).partition == step.partition
            assert explored.cut(level).step.partition == step.partition

    @pytest.mark.parametrize(
        ("low", "high", "level"), [(0.96, 0.998, 0.99), (0.9971, 0.99782, 0.9978), (-1.0, 0.34, 0.3), (-1.0, -0.2, 0.0)]
    )
    def test_a_plain_level_has_few_digits(self, low, high, level):
        assert plain_level(LambdaStep(low, high, Partition((0,), high), None)) == level

    def test_a_level_that_is_none(self, explored):
        with pytest.raises(OptionError, match=r"λ = 1\.5"):
            explored.cut(1.5)
