"""What a page says of simulated beside recorded channels: the worst first, every number in the table."""

from __future__ import annotations

import numpy as np

from selector.physics.channel_differences import ChannelDifference
from selector.report.channels_part import MOST_DRAWN, channels_part, difference_sentence
from selector.report.page import Pictures

TIME_S = np.arange(4) * 0.5
ZERO = np.array([0.0, 200.0, 0.0, -200.0])


def difference(channel="tool", run="r1", unit="um", off=2.0):
    return ChannelDifference(run, channel, unit, TIME_S, ZERO, ZERO + off * np.array([1, 1, -1, 1.0]))


def test_the_sentence_is_of_the_channel_that_is_worst_for_its_size():
    small = ChannelDifference("r1", "workpiece", "um", TIME_S, ZERO / 1000, ZERO / 1000 + np.array([1, 1, -1, 1.0]))
    assert difference_sentence([difference(), small]).startswith("Simulated and recorded workpiece differ by 1.00 µm")
    assert difference_sentence([difference()]) == (
        "Simulated and recorded tool differ by 2.00 µm rms, at most by 2.00 µm after 0 s; that is 1.41 % of what was "
        "recorded, about its mean."
    )
    said = difference_sentence([difference(), difference(run="r2", off=3.0)])
    assert "tool in r2, the worst run, differ by 3.00 µm" in said
    assert difference_sentence([]) == ""


def test_a_level_course_has_no_share():
    level = ChannelDifference("r1", "tool", "um", TIME_S, np.zeros(4), np.ones(4))
    assert difference_sentence([level]).endswith("after 0 s.")


def test_all_numbers_are_in_the_table_and_the_first_are_drawn():
    ones = [difference(f"c{k}", off=1.0 + k) for k in range(MOST_DRAWN + 2)]
    part = channels_part(Pictures(), ones)
    assert len(part["pictures"]) == MOST_DRAWN
    assert part["more"] == 2
    assert [row[2] for row in part["table"].rows][:2] == ["1.00", "2.00"]
    assert [row[1] for row in part["table"].rows] == [one.channel for one in ones]
    # vibrations are micrometres, not a share of a millimetre
    assert '"course [µm]"' in str(part["pictures"][0].json)


def test_channels_that_do_not_differ_are_in_the_table_only():
    part = channels_part(Pictures(), [difference(off=0.0), difference("workpiece")])
    assert len(part["pictures"]) == 1
    assert part["more"] == 0
    assert len(part["table"].rows) == 2
