"""Fewer filters and steps for what is only tried to advise settings of a gauge, which takes most of its summary."""

from __future__ import annotations

import pytest

from selector.physics.gauging import gauging_summary


def shorten_trials(patch: pytest.MonkeyPatch) -> None:
    """Half the filters, a tenth of the steps of each trial; sizes of the process itself stay as many as they are."""
    patch.setattr(gauging_summary, "_FILTERS", 6)
    patch.setattr(gauging_summary, "_TRIAL", (1_000_000, 200))
    patch.setattr(gauging_summary, "_FEW", (300_000, 50))
