"""Fewer steps for what is only tried: settings of a gauge are advised by trials, which take most of its summary."""

from __future__ import annotations

import pytest

from selector.physics.gauging import gauging_summary


def shorten_trials(patch: pytest.MonkeyPatch) -> None:
    """Trials have a tenth of their steps; sizes of the process itself stay as many as they are."""
    patch.setattr(gauging_summary, "_TRIAL", (1_000_000, 200))
    patch.setattr(gauging_summary, "_FEW", (300_000, 50))
