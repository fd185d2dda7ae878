"""A model file can be checked against itself."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from selector.controllers import self_check
from selector.controllers.evaluator import evaluate, output_bound_um
from selector.controllers.model_file import (
    Fallback,
    Guard,
    Input,
    ModelFile,
    Output,
    OutputLimits,
    Term,
    Validation,
    model_text,
    read_model,
    write_model,
)
from selector.controllers.self_check import model_findings
from selector.errors import ModelFileError
from tests.controllers.model_builders import rich_model, rise_model


def with_vectors(model: ModelFile) -> ModelFile:
    return self_check.sealed(model)


def ids(findings) -> list[str]:
    return [finding.id for finding in findings]


@pytest.mark.parametrize("model", [rise_model(), rich_model()])
def test_a_sound_file_passes(model, tmp_path):
    write_model(with_vectors(model), tmp_path / "m.json")
    findings = model_findings(read_model(tmp_path / "m.json"))
    assert ids(findings) == ["test-vectors-agree"]
    assert findings[0].evidence["max_abs_difference_um"] == 0.0


def test_vectors_are_made_the_same_way_every_time_and_round_trip(tmp_path):
    one = with_vectors(rich_model())
    assert one == with_vectors(rich_model())
    assert ModelFile.model_validate(json.loads(model_text(one))) == one


def test_vectors_cover_start_corners_and_ramp():
    vectors = {one.name: one for one in self_check.check_vectors(rise_model())}
    assert list(vectors) == ["start", "corners", "ramp"]
    assert vectors["start"].start_readings is None
    corners = {(a, b) for a, b in zip(*vectors["corners"].readings.values(), strict=True)}
    assert corners == {(20.0, 19.0), (20.0, 28.0), (30.0, 19.0), (30.0, 28.0)}
    assert len(set(np.diff(vectors["ramp"].time_s))) > 10


def test_ramp_sees_the_memory():
    """A program that forgets the memory, or takes a fixed step for it, must fail the vectors."""
    model = with_vectors(rich_model())
    forgetful = model.model_copy(
        update={"states": tuple(state.model_copy(update={"tau_s": 1e-9}) for state in model.states)}
    )
    assert "test-vector-mismatch" in ids(model_findings(forgetful))


def test_many_inputs_have_linearly_many_corners():
    inputs = [Input(name=f"T{i}", valid_min=0, valid_max=1) for i in range(37)]
    terms = [Term(powers={item.name: 1}, coefficient=1.0) for item in inputs]
    model = ModelFile(name="37", inputs=inputs, outputs=[Output(name="Z", intercept=0, terms=terms)])
    corners = self_check.check_vectors(model)[1]
    assert len(corners.time_s) == 3 + 2 * 37
    assert max(corners.expected["Z"]) == 37.0
    assert min(corners.expected["Z"]) == 0.0


@pytest.mark.parametrize("factor", [1.0 + 1e-6, -1.0, 2.0, 0.0])
@pytest.mark.parametrize("term", [0, 1, 2])
def test_a_changed_coefficient_is_found(factor, term, tmp_path):
    document = json.loads(model_text(with_vectors(rise_model())))
    del document["digest"]
    document["outputs"][0]["terms"][term]["coefficient"] *= factor
    (tmp_path / "m.json").write_text(json.dumps(document), encoding="utf-8")
    wrong = [
        finding for finding in model_findings(read_model(tmp_path / "m.json")) if finding.id == "test-vector-mismatch"
    ]
    assert wrong
    assert all(finding.level == "error" for finding in wrong)
    assert "Z" in wrong[0].statement


def test_rounding_in_another_order_is_not_a_mismatch():
    model = with_vectors(rich_model())
    nudged = tuple(
        vector.model_copy(
            update={
                "expected": {
                    name: tuple(math.nextafter(value, math.inf) for value in series)
                    for name, series in vector.expected.items()
                }
            }
        )
        for vector in model.test_vectors
    )
    findings = model_findings(model.model_copy(update={"test_vectors": nudged}))
    assert ids(findings) == ["test-vectors-agree"]
    assert findings[0].evidence["max_abs_difference_um"] > 0.0


def test_a_file_without_vectors_is_warned_about():
    assert ids(model_findings(rise_model())) == ["no-test-vectors"]


def test_overflow_inside_the_valid_range_is_an_error():
    model = rise_model(
        outputs=(Output(name="Z", intercept=0, terms=(Term(powers={"T1": 3, "T3": 3}, coefficient=1e308),)),)
    )
    errors = [finding for finding in model_findings(model) if finding.level == "error"]
    assert ids(errors) == ["output-not-finite"]
    assert output_bound_um(model, model.outputs[0]) == math.inf


def test_overflow_of_a_fallback_is_an_error_and_no_defect(tmp_path, capsys):
    from selector.cli import exit_status

    document = json.loads(model_text(self_check.sealed(hostile_with(lambda of: of))))
    document["fallbacks"][0]["outputs"][0]["terms"][0]["coefficient"] = 1e308
    document["fallbacks"][0]["inputs"][0]["scale"] = 1e-320
    (tmp_path / "m.json").write_text(json.dumps(document), encoding="utf-8")
    before = (tmp_path / "m.json").read_bytes()
    assert exit_status(["model", "check", str(tmp_path / "m.json"), "--accept"]) == 2
    assert "of a fallback can overflow" in capsys.readouterr().err
    assert (tmp_path / "m.json").read_bytes() == before


def test_the_largest_clamp_has_a_sign_test_that_is_a_number():
    guard = Guard(limits=(OutputLimits(output="Z", clamp_um=1e308),))
    (signs,) = [one for one in self_check.sealed(rise_model(guard=guard)).guard_vectors if one.test_um]
    assert 0.0 < max(signs.test_um["Z"]) < math.inf


def test_bound_holds_and_is_reached():
    model = rich_model()
    rng = np.random.default_rng(0)
    n = 4000
    readings = {
        item.name: rng.choice([item.valid_min, item.valid_max], n) + (20.0 if item.reference == "rise" else 0.0)
        for item in model.inputs
    }
    positions = {"Y": rng.choice([-0.1, 0.6], n)}
    y = evaluate(model, np.arange(n) * 60.0, readings, {"T1": 20.0}, positions)
    for output in model.outputs:
        assert np.max(np.abs(y[output.name])) <= output_bound_um(model, output)
    one = rise_model(outputs=(Output(name="Z", intercept=-1.0, terms=(Term(powers={"T1": 1}, coefficient=2.0),)),))
    # z1 runs from −2 to 3
    assert output_bound_um(one, one.outputs[0]) == 7.0


def test_ranges_are_looked_at():
    inputs = (
        Input(name="T1", centre=24.0, valid_min=0.0, valid_max=10.0),
        Input(name="T2", valid_min=0.0, valid_max=0.0),
        Input(name="T3", reference="absolute", centre=900.0, valid_min=800.0, valid_max=1000.0),
        Input(name="T4", valid_min=0.0, valid_max=1.0),
    )
    terms = tuple(Term(powers={name: 1}, coefficient=1.0) for name in ("T1", "T2", "T3"))
    model = with_vectors(rise_model(inputs=inputs, outputs=(Output(name="Z", intercept=0, terms=terms),)))
    found = {
        (finding.id, finding.evidence["input"]) for finding in model_findings(model) if "input" in finding.evidence
    }
    assert found == {("valid-range-empty", "T2"), ("break-code-in-valid-range", "T3")}


def test_settings_of_the_guard_that_are_hardly_meant_are_told():
    odd = Guard(
        limits=(OutputLimits(output="Z", clamp_um=10.0, slew_um_per_s=1e-300, dead_band_um=10.0),),
        break_codes=(850.0, 20.0),
    )
    told = {finding.id for finding in model_findings(with_vectors(rise_model(guard=odd))) if finding.level == "warning"}
    assert told == {"break-code-in-valid-range", "slew-too-slow", "dead-band-too-wide"}
    usual = Guard(limits=(OutputLimits(output="Z", clamp_um=50.0, slew_um_per_s=0.01, dead_band_um=0.5),))
    told = model_findings(with_vectors(rise_model(guard=usual)))
    assert [one.id for one in told if one.level == "warning"] == []


def test_the_smallest_slew_limit_is_tested_and_told():
    # 50 µm at 5e-324 µm/s are more steps than a float can count
    guard = Guard(limits=(OutputLimits(output="Z", clamp_um=50.0, slew_um_per_s=5e-324),))
    model = self_check.sealed(rise_model(guard=guard))
    assert "slew-too-slow" in {finding.id for finding in model_findings(model)}
    (signs,) = [one for one in model.guard_vectors if one.test_um]
    assert max(map(abs, signs.expected["Z"])) < 1e-300


def test_a_break_code_that_the_limits_of_readings_exclude_is_no_temperature():
    item = Input(name="T1", valid_min=-1.0, valid_max=8.0, reading_min=5.0, reading_max=60.0)
    for code, is_told in ((65.0, False), (55.0, True), (0.0, False)):
        model = rise_model(inputs=(item,), outputs=(Output(name="Z", intercept=1.0),), guard=Guard(break_codes=(code,)))
        told = [one.evidence["break_code"] for one in model_findings(model) if one.id == "break-code-in-valid-range"]
        assert told == [code] * is_told


def test_a_file_that_breaks_the_schema_is_refused(tmp_path):
    (tmp_path / "m.json").write_text('{"schema": "selector.model/1"}', encoding="utf-8")
    with pytest.raises(ModelFileError, match=r"\$\.name"):
        model_findings(read_model(tmp_path / "m.json"))


def test_a_fallback_that_contradicts_the_model_is_told():
    model = hostile_with(lambda of: -of)
    found = {finding.id: finding for finding in model_findings(model)}
    assert found["fallback-contradicts"].evidence["without"] in (["T1"], ["T2"])


def hostile_with(change):
    """A model of two sensors that move alike, whose fallback has its coefficients changed."""
    inputs = rise_model().inputs
    output = Output(name="Z", intercept=0.0, terms=tuple(Term(powers={i.name: 1}, coefficient=3.0) for i in inputs))
    alone = Output(name="Z", intercept=0.0, terms=(Term(powers={"T1": 1}, coefficient=change(6.0)),))
    fallback = Fallback(without=("T3",), inputs=inputs[:1], outputs=(alone,))
    other = Fallback(without=("T1",), inputs=inputs[1:], outputs=(
        alone.model_copy(update={"terms": (Term(powers={"T3": 1}, coefficient=change(6.0)),)}),
    ))  # fmt: skip
    guard = Guard(on_fault="fallback", limits=(OutputLimits(output="Z", clamp_um=40.0),))
    return self_check.sealed(rise_model(outputs=(output,), fallbacks=(fallback, other), guard=guard))


def test_a_fallback_that_agrees_is_not_told():
    assert "fallback-contradicts" not in ids(model_findings(hostile_with(lambda of: of)))


@pytest.mark.parametrize(
    ("changes", "level"),
    [({"reading_min": 130.0}, "error"), ({"reading_min": 20.0, "reading_max": 21.0}, "error"),
     ({"rate_limit_per_min": 0.001}, "warning")],
)  # fmt: skip
def test_limits_that_no_reading_can_meet_are_told(changes, level):
    first, second = rise_model().inputs
    found = [
        f
        for f in model_findings(rise_model(inputs=(first.model_copy(update=changes), second)))
        if f.id == "limits-never-met"
    ]
    assert [f.level for f in found] == [level]


@pytest.mark.parametrize(
    ("key", "never", "usual"), [("recover_after_s", 864000.0, 3600.0), ("stuck_after_s", 1e-9, 3600.0)]
)
def test_a_guard_that_never_believes_a_sensor_is_told(key, never, usual):
    found = [
        [f for f in model_findings(rise_model(guard=Guard(**{key: value}))) if f.id == "limits-never-met"]
        for value in (never, usual)
    ]
    assert [[(f.level, f.evidence) for f in of] for of in found] == [[("warning", {key: never})], []]


def test_a_dead_band_as_wide_as_the_clamp_never_moves_the_axis():
    for dead_band_um, moves in ((10.0, False), (1.0, True)):
        limits = OutputLimits(output="Z", clamp_um=10.0, dead_band_um=dead_band_um)
        model = self_check.sealed(rise_model(guard=Guard(limits=(limits,))))
        assert ("dead-band-too-wide" in ids(model_findings(model))) is not moves
        courses = [one.expected["Z"] for one in model.guard_vectors if not one.test_um]
        assert any(map(any, courses)) is moves


def test_a_clamp_that_cuts_two_thirds_is_told():
    limits = (OutputLimits(output="Z", clamp_um=1.0),)
    model = self_check.sealed(rise_model(guard=Guard(limits=limits)))
    (finding,) = [f for f in model_findings(model) if f.id == "clamp-reached"]
    assert finding.evidence["lost_max_um"] > 0.66 * finding.evidence["largest_um"]
    assert 0.0 < finding.evidence["share_of_samples"] <= 1.0


def test_a_changed_guard_is_found_and_can_be_accepted(tmp_path, capsys):
    from selector.cli import exit_status

    path = tmp_path / "m.json"
    document = json.loads(model_text(self_check.sealed(hostile_with(lambda of: of))))
    document["guard"]["break_codes"] = []
    path.write_text(json.dumps(document), encoding="utf-8")
    assert exit_status(["model", "check", str(path)]) == 2
    document.pop("digest")
    path.write_text(json.dumps(document), encoding="utf-8")
    assert "guard-vector-mismatch" in ids(model_findings(read_model(path)))
    assert exit_status(["model", "check", str(path), "--accept"]) == 0
    assert ids(model_findings(read_model(path))) == ["test-vectors-agree"]
    # coefficients are never accepted
    document["outputs"][0]["terms"][0]["coefficient"] *= 2.0
    path.write_text(json.dumps(document), encoding="utf-8")
    assert exit_status(["model", "check", str(path), "--accept"]) == 2


@pytest.mark.parametrize(
    ("left_um", "without_um", "is_told"), [(7.0, 6.25, True), (6.0, 6.25, False), (7.0, None, False)]
)
def test_a_model_that_its_proof_speaks_against_says_so_wherever_it_goes(left_um, without_um, is_told):
    proof = Validation(heldout_rmse_um=left_um, heldout_baseline_um=without_um)
    model = with_vectors(rise_model(validation={"Z": proof}))
    told = [one for one in model_findings(model) if one.id == "proof-against-it"]
    assert [(one.level, one.where.channel, one.evidence) for one in told] == is_told * [
        ("warning", "Z", {"heldout_rmse_um": left_um, "without_um": without_um})
    ]
