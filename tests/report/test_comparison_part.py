"""What a page says of simulated beside recorded: the position first, the worst run, every number in the table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.physics.channel_differences import ChannelDifference
from selector.telling.account import Captioned, Drawing, Note
from selector.telling.simulated.result import MOST_DRAWN, comparison_section, comparison_sentences
from tests.report import drives
from tests.report.simulated import html

TIME_S = np.arange(4) * 0.5
ZERO = np.array([0.0, 200.0, 0.0, -200.0])


def difference(channel="qm", kind="position", unit="um", off=2.0, **more):
    told = {"run": "r1", "axis": "X"} | more
    return ChannelDifference(
        **told, channel=channel, kind=kind, unit=unit, time_s=TIME_S, recorded=ZERO,
        simulated=ZERO + off * np.array([1, 1, -1, 1.0]),
    )  # fmt: skip


def test_the_first_sentence_is_that_of_the_position():
    (first,) = comparison_sentences([difference("u", "output", "V", 0.5), difference()])
    assert first == (
        "Simulated and recorded position (qm) differ by 2.00 µm rms, at most by 2.00 µm after 0 s; that is 1.41 % of "
        "what was recorded, about its mean."
    )


def test_of_several_runs_and_axes_the_worst_is_named():
    ones = [difference(), difference(run="r2", off=3.0), difference("qy", axis="Y", run="r2")]
    assert "position (qm) of X in r2, the worst run, differ by 3.00 µm" in comparison_sentences(ones)[0]
    assert comparison_sentences([]) == []


def test_a_level_course_has_no_share():
    level = replace(difference(), recorded=np.zeros(4), simulated=np.ones(4))
    assert comparison_sentences([level])[0].endswith("after 0 s.")


def test_all_numbers_are_in_the_table_and_the_first_are_drawn():
    ones = [difference(f"c{k}", off=1.0 + k) for k in range(MOST_DRAWN + 2)]
    blocks = comparison_section(ones, drawn=True).blocks
    assert sum(isinstance(one, Drawing) for one in blocks) == MOST_DRAWN
    assert [one.text for one in blocks if isinstance(one, Note)] == ["2 more channels were compared and are not drawn."]
    (told,) = (one.table for one in blocks if isinstance(one, Captioned))
    assert [row[4] for row in told.rows][:2] == ["1.00", "2.00"]
    assert [row[2] for row in told.rows] == [one.channel for one in ones]
    # a screen has the numbers alone
    assert [type(one) for one in comparison_section(ones, drawn=False).blocks] == [Captioned]


@pytest.mark.parametrize("name", ["<b>q</b>", "</script><script>alert(1)</script>"])
def test_the_page_begins_with_it_and_no_name_is_markup(name):
    own = drives.page("state")
    content = html(replace(own, simulated=replace(own.simulated, differences=(difference(name),))))
    assert name not in content
    assert "those were measured, all else comes from a computer model" in content
    assert content.index("Simulated and recorded position") < content.index("is off its command")
    assert 'id="comparison"' in content
    assert 'id="comparison"' not in html(own)


def channel(channel="tool", run="r1", unit="um", off=2.0):
    return ChannelDifference(run, channel, unit, TIME_S, ZERO, ZERO + off * np.array([1, 1, -1, 1.0]))


def test_the_sentence_is_of_the_channel_that_is_worst_for_its_size():
    small = ChannelDifference("r1", "workpiece", "um", TIME_S, ZERO / 1000, ZERO / 1000 + np.array([1, 1, -1, 1.0]))
    (said,) = comparison_sentences([channel(), small])
    assert said.startswith("Simulated and recorded workpiece differ by 1.00 µm")
    assert comparison_sentences([channel()]) == [
        "Simulated and recorded tool differ by 2.00 µm rms, at most by 2.00 µm after 0 s; that is 1.41 % of what was "
        "recorded, about its mean."
    ]
    (said,) = comparison_sentences([channel(), channel(run="r2", off=3.0)])
    assert "tool in r2, the worst run, differ by 3.00 µm" in said


def test_a_level_channel_has_no_share():
    level = ChannelDifference("r1", "tool", "um", TIME_S, np.zeros(4), np.ones(4))
    assert comparison_sentences([level])[0].endswith("after 0 s.")


def test_all_numbers_of_channels_are_in_the_table():
    ones = [channel(f"c{k}", off=1.0 + k) for k in range(MOST_DRAWN + 2)]
    blocks = comparison_section(ones, drawn=True).blocks
    drawn = [one.figure for one in blocks if isinstance(one, Drawing)]
    assert len(drawn) == MOST_DRAWN
    (told,) = (one.table for one in blocks if isinstance(one, Captioned))
    assert [row[2] for row in told.rows][:2] == ["1.00", "2.00"]
    assert [row[1] for row in told.rows] == [one.channel for one in ones]
    # vibrations are micrometres, not a share of a millimetre
    assert drawn[0].layout.yaxis.title.text == "course [µm]"


def test_channels_that_do_not_differ_are_in_the_table_only():
    drawing, told = comparison_section([channel(off=0.0), channel("workpiece")], drawn=True).blocks
    assert isinstance(drawing, Drawing)
    assert len(told.table.rows) == 2
