"""What is odd about gauging before a part is ground."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from selector.findings import Finding
from selector.physics.gauging.parameter_bounds import unit_of_key
from selector.physics.gauging.plausibility import USUAL
from selector.physics.model_plausibility import unlikely_numbers
from selector.physics.model_text import plain_values

if TYPE_CHECKING:
    from selector.physics.gauging.gauging_model import GaugingModel


def model_findings(model: GaugingModel) -> tuple[Finding, ...]:
    """Unlikely numbers."""
    return tuple(_found(model))


def _found(model: GaugingModel) -> Iterator[Finding]:
    yield from unlikely_numbers(plain_values(model.file), USUAL, unit_of_key)
