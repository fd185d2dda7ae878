from __future__ import annotations

from dataclasses import fields

import pytest

from selector.physics.drive.file.model_schema import limits_of_key
from selector.physics.drive.parts.catalogue import thc6350_servo, thc6350_x_axis
from selector.physics.drive.parts.stiffness import three_mass_mechanics


def test_a_machine_lies_far_within():
    parts = thc6350_x_axis()
    values = [three_mass_mechanics(parts), thc6350_servo(), *(getattr(parts, field.name) for field in fields(parts))]
    for value in values:
        for field in fields(value):
            number = getattr(value, field.name)
            if isinstance(number, float | int) and not isinstance(number, bool) and number != 0:
                least, most = limits_of_key(field.name)
                assert least <= abs(number) < most, field.name


@pytest.mark.parametrize(
    ("key", "limits"),
    [("lead_m", (1e-6, 10.0)), ("backlash_m", (0.0, 1e4)), ("axial_stiffness_n_per_m", (1e-3, 1e13))],
)
def test_by_name_and_by_unit(key, limits):
    assert limits_of_key(key) == limits
