"""Numbers in findings have the digits that somebody has measured."""

from __future__ import annotations

import pytest

from selector.quality.survey import reading
from selector.recording import Channel


@pytest.mark.parametrize(
    ("value", "shown"),
    [(-6.91111, "−6.91 °C"), (850.0, "850 °C"), (-9999.0, "−9999 °C"), (21.25, "21.25 °C"), (-0.001, "0 °C")],
)
def test_a_temperature_is_told_to_a_hundredth(value, shown):
    assert reading(value, Channel("T", "temperature", "degC")) == shown
    assert reading(12.3456, Channel("Z", "displacement", "um")) == "12.3456 µm"
