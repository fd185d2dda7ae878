"""False alarms on clean recordings, and planted faults that are found, on a few seeds each.

`benchmarks/quality_rates.py` measures the same on many seeds. The limits here are below those rates by what so few
seeds scatter.
"""

from __future__ import annotations

from functools import cache

import pytest

from benchmarks import quality_rates
from benchmarks.quality_rates import detections, false_alarms
from tests.quality.faults import KINDS

# of up to 14 recordings. Over 200 seeds: 1 for those that must be 1 here, 0.7 for drift, 0.6 for swapped, else 0.81
# to 0.99.
LEAST = {
    "code temperature": 1.0,
    "code displacement": 1.0,
    "duplicate": 1.0,
    "one channel in K": 1.0,
    "missing values": 1.0,
    "drift": 0.4,
    "swapped": 0.3,
}


@pytest.fixture(autouse=True, scope="module")
def drawn_once():
    """All faults are planted in the same recordings, which nothing changes: drawing them is a third of the work."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(quality_rates, "clean_recording", cache(quality_rates.clean_recording))
        yield


def test_clean_recordings_lose_nothing():
    hit, _, places = false_alarms(range(500, 530))
    assert hit <= 1, places  # 0.7 % are measured: at that rate two of 30 have a chance of 2 %


@pytest.mark.parametrize("kind", KINDS)
def test_planted_faults_are_found(kind):
    found, _, tried, beside, missed = detections(kind, range(700, 714))
    assert tried >= 3, "too few recordings in which this fault can be planted"
    assert found >= LEAST.get(kind, 0.65) * tried, f"missed with seeds {missed}"
    assert beside <= 1
