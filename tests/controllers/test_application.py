"""A model on recordings that it has not seen: figures, findings, files."""

from __future__ import annotations

import csv
import json

import numpy as np
import pandas as pd
import pytest

from selector.controllers.application import apply_model, write_predictions
from selector.controllers.evaluator import evaluate
from selector.controllers.model_file import Guard, ModelFile
from selector.errors import OptionError, RecordingError, UnitError
from tests.controllers.model_builders import recording_of, rich_model, rise_model, run_table, warm_up


def with_inputs(**changes) -> ModelFile:
    model = rise_model()
    return model.model_copy(update={"inputs": tuple(item.model_copy(update=changes) for item in model.inputs)})


def perfect_run(error_um=0.0, **readings) -> pd.DataFrame:
    time_s, given = warm_up()
    given |= readings
    return run_table(time_s, given | {"Z": evaluate(rise_model(), time_s, given)["Z"] + error_um})


def of_kind(application, kind: str) -> list:
    return [f for f in application.findings if f.id == "sensor-looks-broken" and f.evidence["kind"] == kind]


def ids(application) -> list[str]:
    return [finding.id for finding in application.findings]


def test_a_perfect_model_leaves_nothing():
    table = perfect_run()
    application = apply_model(rise_model(), recording_of({"r1": table}))
    figures = application.per_run["r1"]["Z"]
    assert figures.rmse_um == 0.0
    assert figures.max_um == 0.0
    assert figures.before_max_um == np.max(np.abs(table["Z"]))
    assert figures.before_rmse_um == pytest.approx(np.sqrt(np.mean(table["Z"] ** 2)), rel=1e-14)
    assert application.findings == ()


def test_figures_by_hand_and_pooled():
    # errors of 3 µm in 200 samples and of −6 µm in 200 samples
    recording = recording_of({"a": perfect_run(3.0), "b": perfect_run(-6.0)})
    application = apply_model(rise_model(), recording)
    # the sum of a prediction and 3.0 is rounded once
    assert application.per_run["a"]["Z"].rmse_um == pytest.approx(3.0, rel=1e-13)
    assert application.per_run["b"]["Z"].max_um == pytest.approx(6.0, rel=1e-13)
    assert application.overall["Z"].rmse_um == pytest.approx(np.sqrt((9 + 36) / 2), rel=1e-13)
    assert application.overall["Z"].max_um == pytest.approx(6.0, rel=1e-13)
    assert application.overall["Z"].n_samples == 400


def test_json_is_the_contract_to_the_letter():
    application = apply_model(rise_model(), recording_of({"r7": perfect_run(1.0)}))
    document = json.loads(json.dumps(application.as_dict(), allow_nan=False))
    assert list(document) == ["schema", "per_run", "overall", "findings"]
    assert document["schema"] == "selector.application/1"
    four = ["rmse_um", "max_um", "before_rmse_um", "before_max_um"]
    assert list(document["per_run"]["r7"]["Z"]) == four
    assert list(document["overall"]["Z"]) == four


def test_the_start_can_be_given():
    time_s, readings = warm_up()
    warm = {name: values[100:] for name, values in readings.items()}
    whole = evaluate(rise_model(), time_s, readings)["Z"]
    recording = recording_of({"warm": run_table(time_s[100:] - time_s[100], warm | {"Z": whole[100:]})})
    told = apply_model(rise_model(), recording, {"warm": {"T1": 20.0, "T3": 20.0}})
    assert told.overall["Z"].rmse_um == 0.0
    untold = apply_model(rise_model(), recording)
    assert untold.overall["Z"].rmse_um > 1.0
    partly = apply_model(rise_model(), recording, {"warm": {"T1": 20.0}})
    assert 0.0 < partly.overall["Z"].rmse_um != untold.overall["Z"].rmse_um


def test_an_output_that_is_a_rise_starts_at_the_first_displacement():
    model = rise_model()
    rise = model.model_copy(update={"outputs": (model.outputs[0].model_copy(update={"reference": "rise"}),)})
    table = perfect_run()
    table["Z"] += 70.0 - table["Z"].iloc[0] + 0.0
    table.iloc[0, table.columns.get_loc("Z")] = np.nan
    start = table["Z"].iloc[1]
    application = apply_model(rise, recording_of({"r": table}))
    assert application.overall["Z"].before_max_um == np.nanmax(np.abs(table["Z"] - start))


def test_leaving_the_valid_range_is_said_with_place_time_and_amount():
    time_s, readings = warm_up()
    readings["T3"] = readings["T3"] + np.where(time_s >= 9000.0, 4.0, 0.0)
    application = apply_model(rise_model(), recording_of({"r": perfect_run(T3=readings["T3"])}))
    (finding,) = [one for one in application.findings if one.id == "outside-valid-range"]
    outside = readings["T3"] - 20.0 > 8.0
    assert finding.where.channel == "T3"
    assert finding.where.run == "r"
    assert finding.where.from_s == time_s[outside][0]
    assert finding.where.to_s == time_s[outside][-1]
    assert finding.evidence["largest_excess"] == pytest.approx(np.max(readings["T3"]) - 28.0, rel=1e-12)
    assert finding.evidence["share_of_time"] == pytest.approx(np.mean(outside), rel=1e-12)  # even sampling
    assert " K" in finding.statement


def test_the_edge_of_the_valid_range_is_inside():
    model = rise_model()
    readings = warm_up()[1]
    x = readings["T1"] - readings["T1"][0]
    edge = model.inputs[0].model_copy(update={"valid_min": x.min(), "valid_max": np.nextafter(x.max(), 0.0)})
    model = model.model_copy(update={"inputs": (edge, model.inputs[1])})
    assert "outside-valid-range" not in ids(apply_model(model, recording_of({"r": perfect_run()})))


@pytest.mark.parametrize(
    ("excess_k", "samples", "level"),
    [(0.4, 1, "info"), (0.6, 1, "warning"), (0.4, 20, "warning"), (30.0, 1, "warning")],
)
def test_noise_at_the_edge_of_the_range_is_only_noted(excess_k, samples, level):
    time_s, readings = warm_up()  # 200 samples; the range of T1 is 10 K wide
    readings["T1"][100 : 100 + samples] = 30.0 + excess_k
    application = apply_model(rise_model(), recording_of({"r": run_table(time_s, readings)}))
    assert [f.level for f in application.findings if f.id == "outside-valid-range"] == [level]


def test_share_is_of_time_not_of_samples():
    time_s = np.r_[np.arange(0.0, 100.0, 1.0), 1000.0, 2000.0]
    t1 = np.where(time_s < 1000.0, 20.0, 35.0)
    recording = recording_of({"r": run_table(time_s, {"T1": t1, "T3": np.full(len(time_s), 20.0)})})
    (finding,) = [f for f in apply_model(rise_model(), recording).findings if f.id == "outside-valid-range"]
    # from 1000 s to the end, and the last sample lasts the median step of 1 s
    assert finding.evidence["share_of_time"] == pytest.approx(1001.0 / 2001.0, rel=1e-12)


@pytest.mark.parametrize("code", [850.0, np.float64(np.float32(3276.7)), -9999.0])
def test_a_break_code_is_left_out_and_said(code):
    table = perfect_run()
    table.loc[table.index[120:], "T1"] = code
    application = apply_model(rise_model(), recording_of({"r": table}))
    (finding,) = of_kind(application, "break-code")
    assert finding.level == "error"
    assert finding.action == "leave-out-stretch"
    assert (finding.where.channel, finding.where.from_s) == ("T1", table.index[120])
    assert application.overall["Z"].n_samples == 120
    assert application.overall["Z"].max_um == 0.0
    assert application.predictions["Z"].isna().sum() == 80
    assert "no-prediction" in ids(application)


def test_a_speed_of_850_rpm_is_no_break_code():
    n = 60
    time_s = np.arange(n) * 60.0
    columns = {
        "T1": np.linspace(20.0, 25.0, n),
        "T амб": np.full(n, 22.0),
        "n": np.full(n, 850.0),
        "YP": np.full(n, 0.3),
    }
    roles = {"T амб": "ambient", "n": "spindle_speed", "YP": "position"}
    application = apply_model(rich_model(), recording_of({"r": run_table(time_s, columns)}, roles))
    assert not of_kind(application, "break-code")
    assert application.predictions[["Z", "Y lower"]].notna().all(axis=None)


def test_readings_beyond_the_limits_of_the_sensor():
    table = perfect_run()
    table.loc[table.index[50], "T3"] = 400.0
    model = with_inputs(reading_min=-40.0, reading_max=150.0)
    (finding,) = of_kind(apply_model(model, recording_of({"r": table})), "out-of-limits")
    assert finding.where.channel == "T3"
    assert finding.evidence["reading"] == 400.0


def test_missing_readings():
    few, many, dead = perfect_run(), perfect_run(), perfect_run()
    few.iloc[10:12, 0] = np.nan
    many.iloc[10:60, 0] = np.nan
    dead.iloc[:, 0] = np.nan
    application = apply_model(rise_model(), recording_of({"few": few, "many": many, "dead": dead}))
    assert [f.where.run for f in application.findings if f.id == "missing-readings"] == ["few"]
    assert [f.where.run for f in of_kind(application, "missing")] == ["many", "dead"]
    assert application.per_run["dead"]["Z"].rmse_um is None
    assert application.per_run["few"]["Z"].n_samples == 198
    assert application.overall["Z"].n_samples == 198 + 150


def test_without_displacement_there_are_predictions_only():
    time_s, readings = warm_up()
    application = apply_model(rise_model(), recording_of({"r": run_table(time_s, readings)}))
    assert ids(application) == ["no-displacement"]
    assert application.as_dict()["overall"] == {
        "Z": {"rmse_um": None, "max_um": None, "before_rmse_um": None, "before_max_um": None}
    }
    assert application.predictions["Z"].notna().all()


def test_a_run_without_displacement_among_others():
    bare = perfect_run()
    bare["Z"] = np.nan
    application = apply_model(rise_model(), recording_of({"a": perfect_run(2.0), "b": bare}))
    (finding,) = application.findings
    assert (finding.id, finding.where.run) == ("no-displacement", "b")
    assert application.overall["Z"] == application.per_run["a"]["Z"]


def test_a_model_that_makes_it_worse_is_named():
    table = perfect_run()
    table["Z"] *= -1.0
    application = apply_model(rise_model(), recording_of({"r": table}))
    assert "worse-than-nothing" in ids(application)


def test_a_missing_channel_is_refused_with_advice():
    time_s, readings = warm_up()
    with pytest.raises(RecordingError) as caught:
        apply_model(rise_model(), recording_of({"r": run_table(time_s, {"T1": readings["T1"]})}))
    assert "T3" in caught.value.found
    assert "[channels.T3]" in caught.value.advice


def test_a_channel_that_is_empty_in_every_run_is_refused():
    with pytest.raises(RecordingError, match=r"readings .*\bT1\b"):
        apply_model(rise_model(), recording_of({"r": perfect_run().assign(T1=np.nan)}))


@pytest.mark.parametrize("roles", [{"T1": "displacement"}, {"T3": "spindle_speed"}, {"Z": "temperature"}])
def test_a_wrong_role_is_refused(roles):
    with pytest.raises(UnitError, match="role"):
        apply_model(rise_model(), recording_of({"r": perfect_run()}, roles))


def test_an_ambient_sensor_passes_for_a_temperature():
    assert apply_model(rise_model(), recording_of({"r": perfect_run()}, {"T3": "ambient"})).overall["Z"].rmse_um == 0.0


def test_a_position_dependent_model_needs_the_position():
    time_s = np.arange(30) * 60.0
    columns = {"T1": np.linspace(20, 22, 30), "T амб": np.full(30, 21.0), "n": np.full(30, 100.0)}
    roles = {"T амб": "ambient", "n": "spindle_speed"}
    with pytest.raises(RecordingError, match="axis Y"):
        apply_model(rich_model(), recording_of({"r": run_table(time_s, columns)}, roles))
    position = np.linspace(-0.1, 0.6, 30)
    recording = recording_of({"r": run_table(time_s, columns | {"YP": position})}, roles | {"YP": "position"})
    predicted = apply_model(rich_model(), recording).predictions["Y lower"].to_numpy()
    assert np.array_equal(predicted, evaluate(rich_model(), time_s, columns, None, {"Y": position})["Y lower"])


@pytest.mark.parametrize(
    "start", [{"r9": {"T1": 20.0}}, {"r": {"T9": 20.0}}, {"r": {"T1": np.nan}}, {"r": {"T1": np.inf}}]
)
def test_start_values_that_fit_nothing_are_refused(start):
    with pytest.raises(OptionError):
        apply_model(rise_model(), recording_of({"r": perfect_run()}), start)


def test_predictions_on_disk_read_back_to_the_same_bits(tmp_path):
    recording = recording_of({"a": perfect_run(), "b": perfect_run()})
    application = apply_model(rise_model(), recording)
    write_predictions(application, tmp_path / "p.csv")
    assert (tmp_path / "p.csv").read_bytes().startswith(b"run,time_s,Z\na,0.0,")
    with (tmp_path / "p.csv").open(encoding="utf-8", newline="") as file:
        back = [(row["run"], float(row["time_s"]), float(row["Z"])) for row in csv.DictReader(file)]
    assert back == list(application.predictions.itertuples(index=False, name=None))


def test_missing_predictions_are_empty_cells(tmp_path):
    table = perfect_run()
    table.iloc[3, 0] = np.nan
    write_predictions(apply_model(rise_model(), recording_of({"a": table})), tmp_path / "p.csv")
    assert (tmp_path / "p.csv").read_text(encoding="utf-8").splitlines()[4] == "a,180.0,"


@pytest.mark.parametrize("name", ["=1+1", "+cmd", "-2", "@SUM(A1)", "\t=1", "\r=1", "=1\r\n=2"])
def test_names_are_never_formulas_in_a_spreadsheet(name, tmp_path):
    write_predictions(apply_model(rise_model(), recording_of({name: perfect_run()})), tmp_path / "p.csv")
    with (tmp_path / "p.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert {row[0] for row in rows[1:]} == {"'" + name.replace("\t", " ").replace("\r", " ").replace("\n", " ")}
    assert len(rows) == 201


def test_output_names_are_never_formulas_either(tmp_path):
    model = rise_model()
    model = model.model_copy(update={"outputs": (model.outputs[0].model_copy(update={"name": "=Z"}),)})
    time_s, readings = warm_up(5)
    write_predictions(apply_model(model, recording_of({"r": run_table(time_s, readings)})), tmp_path / "p.csv")
    assert (tmp_path / "p.csv").read_text(encoding="utf-8").startswith("run,time_s,'=Z\n")


def test_break_codes_come_from_the_model_file():
    model = rise_model(guard=Guard(break_codes=(77.0,)))
    table = perfect_run()
    table.iloc[-1, 0] = 77.0
    assert [f.evidence["reading"] for f in of_kind(apply_model(model, recording_of({"r": table})), "break-code")] == [
        77.0
    ]
