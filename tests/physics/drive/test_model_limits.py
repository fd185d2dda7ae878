from __future__ import annotations

from dataclasses import fields
from typing import Annotated, get_args, get_origin, get_type_hints

import pytest

from selector.physics.drive.parts.axis import Servo, ThreeMassMechanics, Transmission
from selector.physics.drive.parts.catalogue import thc6350_servo, thc6350_x_axis
from selector.physics.drive.parts.stiffness import three_mass_mechanics
from selector.physics.model_fields import Limits, Usual


def said(kind: type, name: str, what: type):
    """What is said of a field of a dataclass, also where it may be none."""
    hint = get_type_hints(kind, include_extras=True)[name]
    inside = hint if get_origin(hint) is Annotated else next(iter(get_args(hint)), hint)
    return next((one for one in getattr(inside, "__metadata__", ()) if isinstance(one, what)), None)


def test_a_machine_lies_far_within():
    parts = thc6350_x_axis()
    values = [three_mass_mechanics(parts), thc6350_servo(), *(getattr(parts, field.name) for field in fields(parts))]
    for value in values:
        for field in fields(value):
            number = getattr(value, field.name)
            if isinstance(number, float | int) and not isinstance(number, bool) and number != 0:
                limits = said(type(value), field.name, Limits) or Limits(0.0, 1e15)
                # a share of 1 is the whole
                assert limits.least <= abs(number) < limits.most or number == limits.most == 1.0, field.name
                usual = said(type(value), field.name, Usual) or Usual(0.0, 1e15)
                assert usual.low <= abs(number) <= usual.high, field.name


@pytest.mark.parametrize(
    ("kind", "key", "limits"),
    [
        (ThreeMassMechanics, "lead_m", Limits(1e-6, 10.0)),
        (ThreeMassMechanics, "axial_stiffness_n_per_m", Limits(1e-3, 1e13)),
        (Transmission, "backlash_m", Limits(0.0, 1e4)),
        (Servo, "command_limit", Limits(1e-9, 1e9)),
    ],
)
def test_limits_stand_at_the_field(kind, key, limits):
    assert said(kind, key, Limits) == limits
