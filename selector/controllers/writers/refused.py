"""What a writer says when a control cannot take a model."""

from __future__ import annotations

from selector.errors import InputError


class ExportRefusedError(InputError):
    """A control cannot take a model; another target can, or another model."""
