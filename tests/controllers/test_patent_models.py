"""The four printed formulas of patent CN1868666, shipped as model files."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from selector.controllers.evaluator import formula_text, physical_coefficients
from selector.controllers.model_file import model_text, read_model
from selector.controllers.self_check import model_findings
from tests.controllers.stepwise import Evaluator

ROOT = Path(__file__).resolve().parents[2]
FILES = {
    "two": ROOT / "fixtures/models/patent-two-sensors.json",
    "three": ROOT / "fixtures/models/patent-three-sensors.json",
}


@pytest.mark.parametrize("count", FILES)
def test_files_are_what_the_generator_makes(count):
    spec = importlib.util.spec_from_file_location("patent_models", ROOT / "fixtures" / "make" / "patent_models.py")
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    assert FILES[count].read_text(encoding="utf-8") == model_text(maker.patent_model(count))


@pytest.mark.parametrize("count", FILES)
def test_files_pass_their_own_check(count):
    assert [finding.id for finding in model_findings(read_model(FILES[count]))] == ["test-vectors-agree"]


def test_two_sensor_formula_reads_as_printed():
    assert formula_text(read_model(FILES["two"])) == (
        "Z = −1.871 + 6.0476·ΔT1 + 2.6667·ΔT3\nY = 0.5703 + 4.7292·ΔT1 − 0.5908·ΔT3"
    )


def test_three_sensor_coefficients_are_as_printed():
    assert physical_coefficients(read_model(FILES["three"])) == {
        "Z": (
            1.0168,
            {(("T1", 1),): 11.5237, (("T3", 1),): 4.4909, (("T5", 1),): -3.6181, (("T1", 1), ("T3", 1)): -0.5527},
        ),
        "Y": (
            -0.1298,
            {
                (("T1", 1),): 11.7861,
                (("T3", 1),): 1.8778,
                (("T5", 1),): -10.4045,
                (("T1", 1), ("T3", 1)): -0.8547,
                (("T1", 1), ("T5", 1)): -0.1995,
                (("T3", 1), ("T5", 1)): 1.0439,
            },
        ),
    }


def test_value_at_a_warm_machine():
    start = {"T1": 20.0, "T3": 20.0}
    y = Evaluator(read_model(FILES["two"]), start).step(0.0, {"T1": 28.0, "T3": 26.0})
    # −1.871 + 6.0476·8 + 2.6667·6 and 0.5703 + 4.7292·8 − 0.5908·6, by hand; a few roundings of float64
    assert y["Z"] == pytest.approx(62.51, abs=1e-12)
    assert y["Y"] == pytest.approx(34.8591, abs=1e-12)
