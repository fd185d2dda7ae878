"""What a page says of simulated beside recorded: the position first, the worst run, every number in the table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.physics.drive.comparison import Difference
from selector.report.comparison_part import MOST_DRAWN, comparison_part, comparison_sentences
from selector.report.drive_report import drive_html
from selector.report.page import Pictures
from tests.report import drives

TIME_S = np.arange(4) * 0.5
ZERO = np.array([0.0, 200.0, 0.0, -200.0])


def difference(channel="qm", kind="position", unit="um", off=2.0, **more):
    told = {"run": "r1", "axis": "X"} | more
    return Difference(
        **told, channel=channel, kind=kind, unit=unit, time_s=TIME_S, recorded=ZERO,
        simulated=ZERO + off * np.array([1, 1, -1, 1.0]),
    )  # fmt: skip


def test_the_first_sentence_is_that_of_the_position():
    first, second = comparison_sentences([difference("u", "output", "V", 0.5), difference()])
    assert first == (
        "Simulated and recorded position (qm) differ by 2.00 µm rms, at most by 2.00 µm after 0 s; that is 1.41 % of "
        "what was recorded, about its mean."
    )
    assert second == "Of the same run, rms of simulated minus recorded: output of the control (u) 0.500 V."


def test_of_several_runs_and_axes_the_worst_is_named():
    ones = [difference(), difference(run="r2", off=3.0), difference("qy", axis="Y", run="r2")]
    assert "position (qm) of X in r2, the worst run, differ by 3.00 µm" in comparison_sentences(ones)[0]
    assert comparison_sentences([]) == []


def test_a_level_course_has_no_share():
    level = replace(difference(), recorded=np.zeros(4), simulated=np.ones(4))
    assert comparison_sentences([level])[0].endswith("after 0 s.")


def test_all_numbers_are_in_the_table_and_the_first_are_drawn():
    ones = [difference(f"c{k}", off=1.0 + k) for k in range(MOST_DRAWN + 2)]
    part = comparison_part(Pictures(), ones)
    assert len(part["pictures"]) == MOST_DRAWN
    assert part["more"] == 2
    assert [row[4] for row in part["table"].rows][:2] == ["1.00", "2.00"]
    assert [row[2] for row in part["table"].rows] == [one.channel for one in ones]


@pytest.mark.parametrize("name", ["<b>q</b>", "</script><script>alert(1)</script>"])
def test_the_page_begins_with_it_and_no_name_is_markup(name):
    shown = replace(drives.page("state"), differences=(difference(name),))
    html = drive_html(shown)
    assert name not in html
    assert "those were measured, all else comes from a computer model" in html
    assert html.index("Simulated and recorded position") < html.index("is off its command")
    assert 'id="comparison"' in html
    assert 'id="comparison"' not in drive_html(drives.page("state"))
