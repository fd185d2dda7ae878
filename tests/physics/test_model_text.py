"""What lacks in a model file is named all at once, and how to add it; what else is wrong is named too."""

from __future__ import annotations

import pytest

from selector.errors import ModelFileError
from selector.physics.drive.model_file import checked_model_file
from selector.physics.model_text import unknown_name
from selector.physics.thermal.model_file import parsed_model_file
from selector.physics.vibration.model_file import checked_model_file as checked_vibration
from selector.physics.vibration.model_file import parsed_model_file as parsed_vibration
from tests.physics.drive.test_model_file import RIGID, changed
from tests.physics.vibration.model_values import changed as changed_vibration


def refusal(*changes) -> ModelFileError:
    with pytest.raises(ModelFileError) as caught:
        checked_model_file(changed(RIGID, *changes))
    return caught.value


def test_a_section_that_lacks_is_told_with_its_brackets():
    said = refusal(("motion", ...))
    assert (said.found, said.where) == ("no section [motion]", "model file, key motion")
    assert said.advice == "add it; docs/reference/drive-model.md explains it"
    assert refusal(("axes", ...)).found == "no section [axes.NAME]"
    assert refusal(("axes.X.servo", ...)).found == "no section [axes.X.servo]"
    several = refusal(("motion", ...), ("axes", ...))
    assert several.found == "no section [motion], [axes.NAME]"
    with pytest.raises(ModelFileError, match=r"no section \[run\], \[conditions\], \[nodes.NAME\]"):
        parsed_model_file('[model]\nkind = "network"\nname = "x"\n')


def test_keys_that_lack_in_one_place_are_told_at_once():
    said = refusal(("motion.frequency_hz", ...), ("motion.amplitude_mm", ...))
    assert said.found == "no 'amplitude_mm', 'frequency_hz'"
    assert (said.where, said.expected) == ("model file, key motion", "all of these")
    one = refusal(("model.name", ...))
    assert (one.found, one.where, one.expected) == ("no 'name'", "model file, key model.name", "this key")
    assert one.advice.startswith("add it")


def test_a_kind_that_lacks_is_told_as_such():
    said = refusal(("motion.kind", ...))
    assert (said.found, said.where) == ("no 'kind'", "model file, key motion.kind")
    assert '"moves"' in said.expected


def test_what_else_is_wrong_is_named():
    said = refusal(("axes.X.foo", 1), ("run.bar", 2), ("motion.amplitude_mm", ...))
    assert said.found == "unknown key 'bar' (also wrong: unknown axes.X.foo, no motion.amplitude_mm)"
    many = refusal(*((f"run.k{number}", 1) for number in range(12)))
    assert many.found.endswith("unknown run.k8 and 3 more)")


def test_a_value_is_told_with_its_key():
    small = [("members.tool.mass_kg", 0.0), ("joints.1.stiffness_n_per_m", 0.0), ("run.period_s", "1 ms")]
    said = {}
    for key, value in small:
        with pytest.raises(ModelFileError) as caught:
            checked_vibration(changed_vibration((key, value)))
        said[key] = caught.value.found
    assert said["members.tool.mass_kg"] == "mass_kg = 0.0"
    assert said["joints.1.stiffness_n_per_m"] == "stiffness_n_per_m = 0.0"
    assert said["run.period_s"] == "period_s = '1 ms'"
    # refused by the dataclass, not by the schema
    assert refusal(("axes.X.mechanics.mass_kg", -3.0)).found == "mass_kg = -3"
    # what is a sentence already stays one
    assert refusal(("motion.axis", "Q")).found.startswith("no axis called 'Q'")


def test_where_there_are_none_it_is_said_how_to_add_one():
    found, expected, advice = unknown_name("shaft", "spindle", [], add="[shafts.spindle] with rpm = 1200, say")
    assert found == "no shaft called 'spindle'"
    assert "none" in expected
    assert "one of" not in expected
    assert "[shafts.spindle]" in advice
    assert unknown_name("shaft", "spindel", ["spindle", "motor"])[1] == "'spindle' perhaps; one of spindle, motor"


JOINT = '\nbetween = ["a", "ground"]\nstiffness_n_per_m = 1e8\n'


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (f"[joints]{JOINT}[joints] # second{JOINT}", "('joints',) twice (at line 7,"),
        (f"[[joints]]{JOINT}[joints]{JOINT}", "('joints',) twice (at line 7,"),
        (f"[joints]{JOINT}[[joints]]{JOINT}", "Cannot overwrite a value (at line 7,"),
        ("[run]\nseed = 1\nseed = 2\n", "Cannot overwrite a value (at line 6,"),
    ],
)
def test_what_stands_twice_is_told_with_its_line_and_with_double_brackets(text, found):
    with pytest.raises(ModelFileError) as caught:
        parsed_vibration(f'[model]\nkind = "vibration"\nname = "x"\n{text}')
    assert found in caught.value.found
    assert "double brackets" in caught.value.expected


@pytest.mark.parametrize(
    ("section", "value", "expected"),
    [
        ("joints", {"between": ["tool", "ground"], "stiffness_n_per_m": 1e8}, "[[joints]] before one of them"),
        ("cutting", [{"shaft": "spindle"}], "[cutting] before it"),
    ],
)
def test_a_single_section_with_the_wrong_brackets(section, value, expected):
    with pytest.raises(ModelFileError) as caught:
        checked_vibration(changed_vibration((section, value)))
    assert caught.value.expected == expected
