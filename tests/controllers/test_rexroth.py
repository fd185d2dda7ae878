"""IndraDrive: the worked example of the manual, models that are straight lines in one temperature, and refusals."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from selector.controllers import Guard, Input, ModelFile, Output, OutputLimits, PositionPart, State, Term
from selector.controllers.model_file import read_model
from selector.controllers.replay.parts import Rows, reference_answers
from selector.controllers.replay.structured_text_executed import drive_answers
from selector.controllers.writers.exported import ExportRefusedError
from selector.controllers.writers.rexroth import FILE, LARGEST_LOSS_UM, drive_parameters, rexroth_export
from selector.errors import InputError
from tests.controllers import hostile
from tests.controllers.golden_text import golden, without_version
from tests.controllers.stepwise import Evaluator

ROOT = Path(__file__).resolve().parents[2]


def screw(*, reference="absolute", own=(4.4, 2.2), slope=(22.0, 11.0), name="screw nut", scale=2.0, **output):
    """Zero at 23 °C: the screw grows by 11 µm/(m·K), the bearing by 2.2 µm/K (z = (T − 25)/scale)."""
    centre = 25.0 if reference == "absolute" else 2.0
    own_part = {"intercept": own[0], "terms": (Term(powers={name: 1}, coefficient=own[1] * scale),)}
    part = PositionPart(axis="X", reference_m=0.05883, valid_min_m=0.0, valid_max_m=0.6, intercept=slope[0],
                        terms=(Term(powers={name: 1}, coefficient=slope[1] * scale),))  # fmt: skip
    low, high = (15.0, 50.0) if reference == "absolute" else (-2.0, 25.0)
    return ModelFile(
        name=name,
        inputs=(
            Input(name=name, reference=reference, valid_min=low, valid_max=high, centre=centre, scale=scale),
            Input(name="unused", valid_min=0.0, valid_max=1.0),
        ),
        outputs=(Output(**({"name": "X", "axis": "X", "position": part} | own_part | output)),),
    )


def test_parameters_of_a_screw():
    model = screw()
    found = drive_parameters(model, model.outputs[0])
    assert found.source == "screw nut"
    assert found.shift_k == pytest.approx(23.0, abs=1e-12)
    assert found.um_per_k == pytest.approx(2.2, abs=1e-12)
    assert found.um_per_m_k == pytest.approx(11.0, abs=1e-12)
    assert found.zero_m == 0.05883
    assert found.loss_um < 1e-9


@pytest.mark.parametrize(
    "model",
    [screw(), screw(reference="rise"), screw(own=(4.45, 2.2)), screw(position=None), screw(own=(0.0, 0.0), scale=0.7)],
)
def test_what_the_drive_computes_is_the_displacement_within_the_loss(model):
    output = model.outputs[0]
    found = drive_parameters(model, output)
    assert found.loss_um <= LARGEST_LOSS_UM
    start = 21.3
    largest = 0.0
    for temperature, position_m in [(t, x) for t in (20.0, 31.7, 45.0) for x in (0.0, 0.05883, 0.6)]:
        readings, at = {"screw nut": temperature, "unused": 0.0}, {"X": position_m}
        expected = Evaluator(model, {"screw nut": start}).step(0.0, readings, at)["X"]
        rise_k = temperature - found.shift_k - (start if model.inputs[0].reference == "rise" else 0.0)
        drive = found.um_per_k * rise_k + found.um_per_m_k * rise_k * (position_m - found.zero_m)
        largest = max(largest, abs(drive - expected))
    assert largest <= found.loss_um + 1e-9
    if found.loss_um > 1e-9:
        assert largest > 0.5 * found.loss_um


@pytest.mark.parametrize(
    ("model", "reason"),
    [
        (read_model(ROOT / "fixtures/models/patent-two-sensors.json"), "T1, T3"),
        (hostile.model(), "T1, T2, n"),
        (screw(own=(5.0, 2.2)), "at its reference"),
        (screw(terms=(Term(powers={"screw nut": 2}, coefficient=0.1),)), "powers of screw nut"),
        (screw(terms=(), position=None), "nothing"),
        (screw(terms=(Term(powers={"screw nut": 1}, coefficient=0.0),), position=None), "not depend"),
        (screw(axis="Z"), "position of X"),
    ],
)
def test_what_the_drive_cannot_take_is_refused_with_advice(model, reason):
    with pytest.raises(ExportRefusedError, match=reason) as caught:
        rexroth_export(model)
    assert isinstance(caught.value, InputError)
    assert "one sensor" in caught.value.advice


def test_memory_and_speeds_are_refused():
    model = screw(position=None)
    late = State(name="late", source="screw nut", tau_s=100.0)
    with_memory = model.outputs[0].model_copy(update={"terms": (Term(powers={"late": 1}, coefficient=1.0),)})
    with pytest.raises(ExportRefusedError, match="late"):
        rexroth_export(model.model_copy(update={"states": (late,), "outputs": (with_memory,)}))
    speed = Input(name="n", role="spindle_speed", unit="rpm", reference="absolute", valid_min=0.0, valid_max=9.0)
    with_speed = model.outputs[0].model_copy(update={"terms": (Term(powers={"n": 1}, coefficient=1.0),)})
    with pytest.raises(ExportRefusedError, match="rpm"):
        rexroth_export(model.model_copy(update={"inputs": (speed,), "outputs": (with_speed,)}))


def test_printed_values_come_back():
    text = rexroth_export(screw()).files[FILE]
    numbers = {
        key: float(re.search(rf"^{key} .*?(-?[\d.]+(?:e-?\d+)?) (?:degC|um|mm)", text, re.M)[1])
        for key in ("P-0-0402", "P-0-0406", "P-0-0407", "x0")
    }
    assert numbers == {"P-0-0402": 23.0, "P-0-0406": 11.0, "P-0-0407": 2.2, "x0": 58.83}


def test_missing_guard_and_moving_reference_are_said():
    assert [finding.id for finding in rexroth_export(screw()).findings] == ["guard-missing"]
    exported = rexroth_export(screw(reference="rise"))
    assert [finding.id for finding in exported.findings] == ["guard-missing", "reference-is-start-reading"]
    assert "start reading of screw nut + 0.0000 K" in exported.files[FILE]


def test_golden_file():
    assert without_version(rexroth_export(screw()).files[FILE]) == golden(f"rexroth/{FILE}")


@pytest.mark.parametrize("name", [")", "*/", '"; P-0-0402 1', "温度 µ", "P-0-0407  99", ";"])
def test_names_stay_in_their_remarks(name):
    text = rexroth_export(screw(name=name)).files[FILE]
    assert text.isascii()
    values = [line for line in text.splitlines() if line and not line.startswith(";")]
    assert [line.split()[0] for line in values] == ["P-0-0402", "P-0-0406", "P-0-0407", "x0"]


@pytest.mark.parametrize("reference", ["absolute", "rise"])
def test_the_printed_parameters_give_the_correction_of_the_guard(reference):
    limits = OutputLimits(output="X", clamp_um=1e4, slew_um_per_s=1e5, slope_clamp_um_per_m=1e4)
    model = screw(reference=reference).model_copy(update={"guard": Guard(limits=(limits,), recover_after_s=0.0)})
    n = 200
    yes, no = np.ones(n, dtype=bool), np.zeros(n, dtype=bool)
    temperature = 23.0 + 8.0 * (1.0 - np.exp(-np.arange(n) / 60.0))
    readings = np.column_stack([temperature, np.full(n, 0.5)])
    rows = Rows(np.full(n, 10.0), readings, np.linspace(0.0, 0.6, n)[:, None], yes, yes, no, np.zeros(n))
    found, expected = drive_answers(model, rows), reference_answers(model, rows)
    assert np.abs(expected.correction_um).max() > 10.0
    # six printed digits of 11 µm/(m·K), over 0.6 m and 10 K
    assert np.abs(found.correction_um - expected.correction_um).max() < 0.01
