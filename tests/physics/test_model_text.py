"""What lacks in a model file is named all at once, and how to add it; what else is wrong is named too."""

from __future__ import annotations

import pytest

from selector.errors import ModelFileError
from selector.physics.drive.model_file import checked_model_file
from selector.physics.thermal.model_file import parsed_model_file
from tests.physics.drive.test_model_file import RIGID, changed


def refusal(*changes) -> ModelFileError:
    with pytest.raises(ModelFileError) as caught:
        checked_model_file(changed(RIGID, *changes))
    return caught.value


def test_a_section_that_lacks_is_told_with_its_kinds():
    said = refusal(("motion", ...))
    assert (said.found, said.where) == ("no section [motion]", "model file, key motion")
    assert said.advice.startswith('add a section [motion] with kind = "sine", "moves", "column" or "circle"')
    assert refusal(("axes", ...)).advice.startswith("add a section [axes.NAME]")
    assert refusal(("axes.X.servo", ...)).advice.startswith("add a section [axes.X.servo]")
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
