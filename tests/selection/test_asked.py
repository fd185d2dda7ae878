"""What is asked by name: a formula, a margin, a target; and the terms that are chosen singly."""

from __future__ import annotations

import json
import math

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm

from selector.cli import exit_status
from selector.controllers.from_selection import model_file_of
from selector.errors import OptionError
from selector.readers import read
from selector.selection import Options, select
from selector.selection.result_file import selection_of
from selector.selection.survey import gauge_noise
from selector.shipped import shipped
from selector.study import options_of, parsed_study, study_of, study_text
from selector.telling.selected.advice import advice

PATENT = "Z_embodiment2 ~ T1 + T3 + T1:T3 + T5"


@pytest.fixture(scope="module")
def patent():
    return read([shipped("patent8")]).recording


@pytest.fixture(scope="module")
def milling():
    return read([shipped("vmc37")]).recording


def test_the_second_model_of_the_patent_comes_out(patent):
    """P, embodiment 2: Z = 1.0168 + 11.5237 X1 + 4.4909 X2 − 0.5527 X1X2 − 3.6181 X3, X the rises of T1, T3, T5."""
    selection = select(patent, Options(formula=PATENT))
    document = selection.as_dict()["models"]["Z_embodiment2"]
    found = {"·".join(term["powers"]): term["coefficient"] for term in document["terms"]} | {"1": document["intercept"]}
    printed = {"1": 1.0168, "T1": 11.5237, "T3": 4.4909, "T1·T3": -0.5527, "T5": -3.6181}
    assert found == pytest.approx(printed, abs=6e-5)
    assert selection.chosen == ("T1", "T3", "T5")
    assert set(selection.models) == {"Z_embodiment2"}
    assert {one.sensors for one in selection.combinations} == {("T1", "T3", "T5")}


def test_a_formula_may_name_more_sensors_than_a_set_has_by_default(milling):
    named = tuple(one.name for one in milling.channels if one.role == "temperature")[:7]
    assert len(named) > Options().max_sensors
    selection = select(milling, Options(formula=f"Z ~ {' + '.join(f'`{name}`' for name in named)}"))
    assert selection.chosen == named
    assert len(selection.as_dict()["models"]["Z"]["terms"]) == len(named)


@pytest.mark.parametrize("formula", ["Z ~ T1:T3", "Z ~ I(T1**2) + T3", "Z ~ T1 + I(T1**3) + T1:T3"])
def test_products_without_their_factors_are_fitted_as_they_stand(patent, formula):
    """The same as ordinary least squares on the rises themselves."""
    selection = select(patent, Options(formula=formula))
    frame = patent.frame.dropna()
    rise = {name: (frame[name] - frame[name].iloc[0]).to_numpy() for name in ("T1", "T3")}
    columns = {"T1": rise["T1"], "T3": rise["T3"], "T1·T3": rise["T1"] * rise["T3"]}
    columns |= {"T1^2": rise["T1"] ** 2, "T1^3": rise["T1"] ** 3}
    document = selection.as_dict()["models"]["Z"]
    names = ["·".join(n if p == 1 else f"{n}^{p}" for n, p in term["powers"].items()) for term in document["terms"]]
    expected = sm.OLS(frame["Z"].to_numpy(), sm.add_constant(np.column_stack([columns[name] for name in names]))).fit()
    np.testing.assert_allclose(
        [document["intercept"], *(term["coefficient"] for term in document["terms"])], expected.params, rtol=1e-7
    )
    assert document["r2"] == pytest.approx(expected.rsquared, abs=1e-10)


def test_a_formula_comes_back_from_its_result_its_study_and_its_model(patent, tmp_path):
    selection = select(patent, Options(formula="Z ~ T1 + T3 + T1:T3"))
    document = json.loads(json.dumps(selection.as_dict()))
    again = selection_of(document)
    assert (again.recipe.shape, again.recipe.terms) == (selection.recipe.shape, selection.recipe.terms)
    assert again.options == selection.options
    made = study_of(tmp_path, [tmp_path / "r.csv"], select=selection.options)
    assert options_of(parsed_study(study_text(made))) == selection.options
    model = model_file_of(selection, patent.channels, source=patent)
    assert {entry.name for entry in model.inputs} == {"T1", "T3"}


@pytest.mark.parametrize(
    ("asked", "where"),
    [
        ({"formula": "Z ~ T1 + T99"}, "--formula"),
        ({"formula": "Q ~ T1"}, "--formula"),
        ({"formula": "Z ~ T1", "must": ("T1",)}, "--formula"),
        ({"formula": "Z ~ T1", "memory": True}, "--formula"),
        ({"formula": "Z ~ T1", "target": 3.0}, "--formula"),
        ({"formula": "Z ~ T1", "responses": ("Y",)}, "--response and --formula"),
        ({"within": 1.0, "target": 3.0}, "--within"),
        ({"within": -1.0}, "--within"),
        ({"target": 0.0}, "--target"),
        ({"target": math.nan}, "--target"),
    ],
)
def test_what_contradicts_itself_or_is_not_there_is_refused(patent, asked, where):
    with pytest.raises(OptionError) as caught:
        select(patent, Options(**asked))
    assert caught.value.where == where


def test_a_target_is_reached_by_the_whole_procedure_with_as_few_sensors_as_that_takes(milling):
    sizes = []
    for target in (5.0, 3.0):
        selection = select(milling, Options(responses=("Z",), target=target))
        assert selection.proof.rmse_um("Z") <= target * 1.02
        assert "target-missed" not in {finding.id for finding in selection.findings}
        sizes.append(len(selection.chosen))
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[-1]


def test_a_target_that_nothing_reaches_is_told(milling):
    selection = select(milling, Options(responses=("Z",), target=0.1))
    missed = next(finding for finding in selection.findings if finding.id == "target-missed")
    assert missed.evidence["heldout_rmse_um"]["Z"] == pytest.approx(selection.proof.rmse_um("Z"))
    verdict, (first, *_) = advice(selection)
    assert verdict != "good"
    assert first.index("0.1 µm") < first.index("Keep sensor")


def test_a_wider_margin_takes_fewer_sensors(milling):
    chosen = {}
    for within in (0.0, 1.0, 100.0):
        selection = select(milling, Options(responses=("Z",), within=within))
        errors = {one.sensors: one.heldout_rmse_um for one in selection.combinations}
        assert errors[selection.chosen] <= min(errors.values()) + within + 1e-9
        chosen[within] = len(selection.chosen)
    assert chosen[0.0] > chosen[1.0] > chosen[100.0] == 1


def test_the_noise_of_a_gauge_is_seen_beneath_a_machine_that_warms_up():
    rng = np.random.default_rng(0)
    time = np.arange(4000) * 10.0
    drift = 40.0 * (1.0 - np.exp(-time / 3000.0)) + 5.0 * np.sin(time / 2000.0)
    for noise in (0.1, 0.4, 2.0):
        seen = gauge_noise((drift + rng.normal(0.0, noise, len(time)))[:, None])
        assert seen[0] == pytest.approx(noise, rel=0.06)


def test_where_all_thermometers_are_left_out_the_advice_names_faults_beside_roles(tmp_path, capsys):
    table = pd.DataFrame({"t [min]": np.arange(60.0), "T1 [degC]": -9999.0, "T2 [degC]": -9999.0})
    for run in ("r1", "r2"):
        table.assign(**{"Z [um]": np.linspace(0.0, 20.0, 60)}).to_csv(tmp_path / f"{run}.csv", index=False)
    assert exit_status(["select", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert "no temperature channel" in told
    assert "mend the faults" in told
    # what is advised shows them
    assert exit_status(["describe", str(tmp_path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["findings"]
    assert {one["where"]["channel"] for one in found if one["action"] == "leave-out-channel"} == {"T1", "T2"}


def test_the_span_of_large_errors_is_told_without_powers_of_ten(milling):
    large = milling.with_values(milling.frame.assign(Z=200.0 * milling.frame["Z"]))
    [few] = [one for one in select(large, Options(responses=("Z",))).findings if one.id == "few-runs"]
    low, high = few.evidence["between_um"]["Z"]
    assert high > 100.0
    assert f"Z by {low:.0f} to {high:.0f} µm" in few.statement
