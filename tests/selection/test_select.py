"""The whole selection on machines whose truth is known."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from selector.errors import OptionError, RecordingError
from selector.findings import Finding
from selector.selection import Options, select
from tests.models.runs import InPieces, recording
from tests.selection.machines import SENSORS, found_ids, linear, machine, one_finding


def selected(source, **options):
    return select(source, Options(**options))


@pytest.fixture(scope="module")
def plain():
    """Selection on a linear machine with default options."""
    return selected(machine())


class TestInStatsmodels:
    def check(self, found, source):
        results = found.statsmodels_results("Z", source)
        _, coefficients, errors = found.models["Z"].physical()
        assert results.nobs == found.models["Z"].n_samples
        assert results.params.to_numpy() == pytest.approx(coefficients, rel=1e-8)
        assert results.bse.to_numpy() == pytest.approx(errors, rel=1e-8)
        return results

    def test_the_final_model_as_it_was_fitted(self, plain):
        results = self.check(plain, machine())
        assert results.pvalues["T1"] < 1e-6
        assert "hac-panel" in results.summary().as_text().lower()

    def test_a_model_with_memory_on_thinned_samples(self, monkeypatch):
        monkeypatch.setattr("selector.selection.fitting.MAX_ROWS", 500)
        source = machine(n_runs=4)
        found = selected(source, memory=True)
        assert found.models["Z"].n_samples <= 500
        self.check(found, source)

    def test_another_recording_is_refused(self, plain):
        with pytest.raises(OptionError) as refused:
            plain.statsmodels_results("Z", machine(seed=7))
        assert refused.value.where == "statsmodels_results"
        assert f" {plain.models['Z'].n_samples} samples" in refused.value.expected


def test_an_error_of_no_response_says_what_there_is(plain):
    for errors in (plain.proof.rmse_um, plain.proof.max_um):
        with pytest.raises(RecordingError) as caught:
            errors("Q")
        assert (caught.value.found, caught.value.expected) == ("no channel 'Q'", "one of Z")


class TestPlantedTruth:
    @pytest.mark.parametrize("seed", range(4))
    def test_the_sensors_that_matter_are_chosen(self, seed):
        """One of the spindle and one of the column; the sharp ones of each, and the air never."""
        found = selected(machine(seed=seed))
        assert {"T1", "T4"} <= set(found.chosen)
        assert not {"T6", "T7"} & set(found.chosen)
        # noise of the displacement 0.5; sensors add √(6² + 4²) · 0.01 = 0.07, five runs and starts the rest
        assert found.proof.rmse_um("Z") == pytest.approx(0.5, abs=0.1)
        assert found.proof.baselines_um["Z"]["none"] > 10

    def test_coefficients_are_those_of_the_law(self):
        found = selected(machine(noise_um=0.1), max_sensors=2)
        terms, coefficients, errors = found.models["Z"].physical()
        by_name = dict(zip(map(str, terms), zip(coefficients[1:], errors[1:], strict=True), strict=True))
        for name, truth in {"T1": 6.0, "T4": -4.0}.items():
            value, error = by_name[name]
            assert value == pytest.approx(truth, abs=0.05)
            assert abs(value - truth) < 5 * error + 0.02

    def test_a_square_is_found_when_squares_are_offered(self):
        source = machine(lambda u: 3 * u["spindle"] + 0.5 * u["spindle"] ** 2 - 4 * u["column"])
        poor, rich = selected(source), selected(source, degree=2)
        assert "T1^2" in [str(term) for term in rich.models["Z"].terms]
        assert rich.proof.rmse_um("Z") < 0.7 < 2.0 < poor.proof.rmse_um("Z")
        assert "terms-that-help" in found_ids(rich)

    def test_a_product_is_found_when_products_are_offered(self):
        source = machine(lambda u: 3 * u["spindle"] + u["spindle"] * u["column"])
        found = selected(source, interactions=True)
        assert "T1·T4" in [str(term) for term in found.models["Z"].terms]
        assert found.proof.rmse_um("Z") < 0.7

    def test_squares_that_do_not_help_are_not_used(self):
        found = selected(machine(), degree=2, interactions=True)
        assert all(term.degree == 1 for term in found.models["Z"].terms)
        assert "terms-not-used" in found_ids(found)

    @pytest.mark.parametrize("seed", range(2))
    def test_the_time_constant_of_a_hidden_mass(self, seed):
        """Within 15 %. The displacement follows the spindle 30 min late, which no sensor shows."""
        source = machine(lambda u: 2 * u["spindle"] + 6 * u["hidden"], seed=seed, tau_hidden_s=1800.0)
        found = selected(source, memory=True)
        taus = [lag.tau_s for lag in found.recipe.design.lags]
        assert any(abs(tau / 1800.0 - 1) < 0.15 for tau in taus), taus
        static = found.proof.baselines_um["Z"]["chosen, linear"]
        assert found.proof.rmse_um("Z") < 0.35 * static
        assert found.proof.rmse_um("Z") < 0.75

    def test_memory_that_does_not_help_is_not_used(self):
        assert not selected(machine(), memory=True).recipe.design.lags

    def test_a_displacement_driven_by_speed_needs_the_speed(self):
        source = machine(lambda u: 3 * u["air"] + 0.004 * u["speed"], speed=True, n=120)
        found = selected(source, memory=True)
        assert "n" in found.recipe.design.inputs
        # some of these runs start with the spindle turning; what it has grown by then no recording holds
        assert found.proof.rmse_um("Z") < 0.35 * found.proof.baselines_um["Z"]["all sensors"]

    def test_two_responses_share_one_set(self):
        found = selected(machine(second=lambda u: 3 * u["air"] - u["column"]))
        assert set(found.models) == {"Z", "Y"}
        assert {"T1", "T4", "T6"} <= set(found.chosen)
        assert found.models["Z"].scaling.variables == found.models["Y"].scaling.variables
        assert found.proof.rmse_um("Y") < 0.65

    @pytest.mark.parametrize("seed", [1, 2])
    def test_a_response_that_is_mostly_noise_hides_no_error_of_another(self, seed):
        source = machine(
            lambda u: 10 * u["spindle"] - 1.2 * u["column"],
            second=lambda u: 0.4 * u["air"] + 0.3 * u["column"],
            noise_um=0.3,
            n=120,
            seed=seed,
        )
        found = selected(source, max_sensors=3)
        assert set(found.chosen) == {"T1", "T4", "T6"}
        # 0.30 µm is the noise of the gauge; without a sensor of the column 0.46 µm and more are left
        assert found.proof.rmse_um("Z") < 0.37
        assert found.equal is not None
        assert max(one.heldout_rmse_um[0] for one in found.equal.sets) < 0.40


class TestOptions:
    def test_must(self):
        found = selected(machine(), must=("T7",))
        assert "T7" in found.chosen
        assert all("T7" in one.sensors for one in found.combinations)

    def test_never(self):
        found = selected(machine(), never=("T1", "T4"))
        assert not {"T1", "T4"} & set(found.sensors)
        assert not {"T1", "T4"} & set(found.chosen)

    def test_max_sensors(self):
        found = selected(machine(), max_sensors=1)
        assert found.chosen == ("T1",)
        assert max(len(one.sensors) for one in found.combinations) == 1

    def test_a_dear_sensor_is_replaced_within_the_tolerance(self):
        cheap = selected(machine(), tolerance=0.05)
        dear = selected(machine(), tolerance=0.05, cost={"T1": 10.0})
        assert "T1" in cheap.chosen
        assert "T1" not in dear.chosen
        assert dear.options.total_cost(dear.chosen) < 10

    def test_a_wider_tolerance_never_needs_more_sensors(self):
        sizes = [len(selected(machine(), tolerance=tolerance).chosen) for tolerance in (0.0, 0.001, 0.05, 0.5)]
        assert sizes == sorted(sizes, reverse=True)
        assert sizes[-1] == 1

    def test_the_tolerance_is_kept(self):
        found = selected(machine(), tolerance=0.001)
        adjusted = {one.sensors: one.adjusted_r2 for one in found.combinations}
        # λ is auto, so that the best of all sets is among those compared
        assert adjusted[found.chosen] >= max(adjusted.values()) - 0.001

    def test_a_given_level_searches_representatives_only(self):
        found = selected(machine(), level=0.98)
        representatives = {found.sensors[i] for i in found.grouping.chosen.rounds[-1].representatives}
        assert found.grouping.chosen.level == 0.98
        assert all(set(one.sensors) <= representatives for one in found.combinations)
        assert set(found.chosen) <= representatives

    def test_rounds(self):
        found = selected(machine(), level=(0.98, 0.5), rounds=2)
        first, second = found.grouping.chosen.rounds
        assert (first.level, second.level) == (0.98, 0.5)
        assert len(second.representatives) < len(first.representatives)

    def test_ridge_costs_what_it_says(self):
        found = selected(machine(n=60, noise_um=3.0), ridge=True)
        evidence = one_finding(found, "ridge").evidence
        assert evidence["heldout_rmse_um"] <= evidence["heldout_rmse_um_without"]
        assert found.models["Z"].ridge == evidence["penalty"]

    def test_absolute_readings(self):
        """The law counts from the start of each day; absolute readings need the air for what the day began with."""
        rise, absolute = selected(machine()), selected(machine(), reference="absolute")
        assert absolute.options.reference == "absolute"
        assert rise.proof.rmse_um("Z") < absolute.proof.rmse_um("Z")
        assert absolute.models["Z"].valid_range[0][0] > 10

    def test_conditions_are_left_out_together(self):
        found = selected(machine(n_runs=6), conditions={"day1": "wet", "day2": "wet", "day3": "dry", "day4": "dry"})
        assert found.proof.left_out == "condition"
        assert [part.name for part in found.proof.per_response["Z"]] == ["wet", "dry", "day5", "day6"]


class TestProof:
    def test_runs_are_left_out_in_turn(self, plain):
        assert plain.proof.left_out == "run"
        parts = plain.proof.per_response["Z"]
        assert [part.name for part in parts] == [f"day{i}" for i in range(1, 6)]
        pooled = np.sqrt(np.mean([part.rmse_um**2 for part in parts]))
        assert plain.proof.rmse_um("Z") == pytest.approx(pooled)
        assert plain.proof.max_um("Z") == max(part.max_um for part in parts)

    def test_a_single_run_is_cut_in_blocks_and_that_is_said(self):
        found = selected(machine(n_runs=1))
        assert found.proof.left_out == "block"
        assert "one-run-only" in found_ids(found)
        assert "only run" in found.because

    def test_two_runs(self):
        found = selected(machine(n_runs=2))
        assert found.proof.left_out == "run"
        assert len(found.proof.per_response["Z"]) == 2
        assert "few-runs" in found_ids(found)

    def test_noise_is_not_predicted(self):
        """No leak: choosing among many sensors inside the folds must not make noise look predictable."""
        ratios, leaky = [], []
        for seed in range(8):
            rng = np.random.default_rng(seed)
            names = [*(f"T{j}" for j in range(20)), "Z"]
            source = recording(
                {f"r{r}": (np.arange(30.0), {name: rng.normal(size=30) for name in names}) for r in range(5)}
            )
            found = selected(source, reference="absolute")
            mean = found.proof.baselines_um["Z"]["mean"]
            ratios.append(found.proof.rmse_um("Z") / mean)
            leaky.append(min(one.heldout_rmse_um for one in found.combinations) / mean)
            assert "no-better-than-nothing" in found_ids(found) or ratios[-1] < 1
        # a set that was chosen on all runs and then tested on them looks better than nothing …
        assert np.mean(leaky) < 0.99
        # … and the whole procedure, honestly, does not: it pays for its useless coefficients
        assert 1.0 < np.mean(ratios) < 1.15

    def test_a_model_no_better_than_nothing_is_called_that(self):
        found = selected(machine(lambda u: 0 * u["air"]))
        finding = one_finding(found, "no-better-than-nothing")
        assert finding.level == "error"

    def test_the_error_curve_falls_and_then_stays(self, plain):
        sizes = [point.n_sensors for point in plain.proof.curve]
        assert sizes == sorted(sizes)
        errors = [point.rmse_um[0] for point in plain.proof.curve]
        assert errors[0] > 3 * errors[1]
        assert min(errors[1:]) > 0.8 * errors[1]

    def test_stability_of_a_clear_choice(self, plain):
        assert plain.stability["T1"] == 1.0
        assert plain.stability["T4"] > 0.9

    def test_an_outlying_run_is_named(self):
        day = iter(range(100))
        source = machine(lambda u: (6.0 if next(day) != 3 else 12.0) * u["spindle"] - 4 * u["column"], n_runs=6)
        found = selected(source, max_sensors=2)
        assert one_finding(found, "one-part-unlike-the-others").where.run == "day4"

    def test_a_hotter_run_is_an_extrapolation(self):
        day = iter(range(100))

        def law(u):
            if next(day) == 5:
                for name in ("spindle", "column"):
                    u[name] *= 5.0
            return 6 * u["spindle"] - 4 * u["column"]

        found = selected(machine(law, n_runs=6))
        said = one_finding(found, "runs-outside-the-others").statement
        assert "day6" in said
        assert re.search(r"T\d [^.]*[\d.]+ K", said)


class TestResult:
    def test_every_sensor_has_a_reason(self, plain):
        assert set(plain.reasons) == set(SENSORS)
        for name, reason in plain.reasons.items():
            assert reason.startswith("kept:" if name in plain.chosen else "dropped:")
            # sets with more sensors are no measure of what one is worth
            if worth := re.search(r"without it .*\((.*)\) has ([\d.]+) times", reason):
                assert len(worth[1].split(", ")) <= len(plain.chosen)
                assert float(worth[2]) >= 1.0

    def test_a_choice_at_the_limit_is_told(self, plain):
        found = selected(machine(), max_sensors=1)
        finding = one_finding(found, "choice-at-limit")
        assert finding.statement.startswith("1 sensor ")
        assert "--max-sensors " in finding.statement
        assert "--max-sensors 4" in finding.suggestion
        assert "at most 1 sensor " in found.because
        assert "choice-at-limit" not in found_ids(plain)
        assert "choice-at-limit" not in found_ids(selected(machine(), max_sensors=1, must=("T1",)))

    def test_collinear_terms_do_not_take_back_the_choice(self):
        for ridge in (False, True):
            advice = one_finding(
                selected(machine(), must=("T1", "T2", "T3"), ridge=ridge), "collinear-terms"
            ).suggestion
            assert "unseen" in advice
            assert "fewer" not in advice
            assert ("--ridge" in advice) is not ridge

    def test_the_reason_holds_the_errors_that_the_rule_compares(self, plain):
        errors = {set_.sensors: set_.heldout_rmse_um for set_ in plain.combinations}
        best = min(error for sensors, error in errors.items() if len(sensors) <= len(plain.chosen))
        assert f"best Z {best:.3g} µm" in plain.because
        fewer = plain.fixed_set_errors_um("Z")[len(plain.chosen) - 1]
        count = len(plain.chosen) - 1
        assert f"best with {count} sensor{'' if count == 1 else 's'} Z {fewer:.3g} µm (" in plain.because
        assert f"{100 * (fewer / best - 1):.0f} % " in plain.because
        assert "Z from" in plain.because

    def test_json_is_strict_and_complete(self, plain):
        text = json.dumps(plain.as_dict(), allow_nan=False)
        document = json.loads(text)
        assert document["schema"] == "selector.selection/1"
        assert set(document) >= {
            *("schema", "sensors", "similarity", "closure", "lambda", "rounds", "combinations", "chosen"),
            *("models", "findings"),
        }
        assert document["sensors"] == list(SENSORS)
        model = document["models"]["Z"]
        assert set(model) >= {
            *("terms", "intercept", "r2", "adjusted_r2", "rmse_um", "heldout_rmse_um", "heldout_max_um", "per_run")
        }
        assert set(model["terms"][0]) >= {"powers", "coefficient", "standard_error", "vif"}
        assert set(document["combinations"][0]) >= {"sensors", "response", "r2", "adjusted_r2", "heldout_rmse_um"}
        assert set(document["rounds"][0]) >= {"groups", "representatives"}

    def test_the_same_input_gives_the_same_output(self, plain):
        again = selected(machine())
        assert json.dumps(again.as_dict()) == json.dumps(plain.as_dict())

    def test_the_order_of_the_sensors_does_not_matter(self, plain):
        source = machine()
        turned = recording(
            {
                run: (source.time_s(run), {name: source.values(run, [name])[:, 0] for name in reversed(source.names)})
                for run in source.runs
            }
        )
        found = selected(turned)
        assert set(found.chosen) == set(plain.chosen)
        assert found.proof.rmse_um("Z") == pytest.approx(plain.proof.rmse_um("Z"), rel=1e-6)

    def test_recordings_that_are_read_in_pieces_give_the_same(self, plain):
        cut = select(InPieces(machine(), 47))
        assert cut.chosen == plain.chosen
        assert cut.proof.rmse_um("Z") == pytest.approx(plain.proof.rmse_um("Z"), rel=1e-9)
        assert cut.models["Z"].coefficients == pytest.approx(plain.models["Z"].coefficients, rel=1e-9)

    def test_progress_goes_from_nothing_to_all(self):
        seen = []
        select(machine(n_runs=2, n=60), progress=lambda what, share: seen.append((what, share)))
        shares = [share for _, share in seen]
        assert shares == sorted(shares)
        assert (shares[0], shares[-1]) == (0.0, 1.0)
        assert seen[-1][0] == "done"

    def test_findings_and_provenance_that_were_passed_in_are_kept_worst_first(self):
        told = (Finding("told", "info", "something"), Finding("warned", "warning", "something else"))
        found = select(machine(), findings=told, provenance={"files": 3})
        assert set(map(id, told)) <= set(map(id, found.findings))
        levels = [("error", "warning", "info").index(finding.level) for finding in found.findings]
        assert levels == sorted(levels)
        assert found.provenance == {"files": 3}

    def test_traces_hold_the_unseen_predictions(self, plain):
        trace = plain.proof.traces[0]
        part = plain.proof.per_response["Z"][0]
        error = trace.measured_um[:, 0] - trace.predicted_um[:, 0]
        # both courses are rounded to 0.0001 µm
        assert np.sqrt(np.mean(error**2)) == pytest.approx(part.rmse_um, abs=1e-4)


class TestToldWithoutTheRun:
    @pytest.mark.parametrize("seed", [1, 6])
    def test_number_of_sensors_and_offer_of_a_run_are_decided_without_it(self, seed, monkeypatch):
        """With the least error of all runs together each run would help to choose what it then proves."""
        source = machine(
            lambda truth: linear(truth) + 4.0 * truth["hidden"] * np.tanh(truth["air"]), n_runs=4, n=100, seed=seed
        )
        told = selected(source, memory=True, max_sensors=4).proof
        monkeypatch.setattr("selector.selection.workflow.FEWEST_TO_DECIDE", 5)
        lucky = selected(source, memory=True, max_sensors=4).proof
        # what the others would have taken is never better for the run that is left out than the best for all
        assert told.rmse_um("Z") > lucky.rmse_um("Z")
        assert {len(part.sensors) for part in told.per_response["Z"]} == {1, 2}
        # what each size reaches is as it was: only which of them is told changes
        assert told.curve == lucky.curve
