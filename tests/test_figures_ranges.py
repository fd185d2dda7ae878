"""Error against the number of sensors: what a point of the curve carries."""

from __future__ import annotations

import numpy as np

from selector.figures.proof import SetError, set_error_changes, set_errors_picture
from selector.figures.style import changed
from selector.number_text import number_text


def test_a_point_of_a_curve_carries_its_set():
    everywhere = [SetError(("<T1>",), 3.0), SetError(("<T1>", "T4"), 1.0)]
    drawn = changed(
        set_errors_picture(300), set_error_changes("Z", everywhere, everywhere[:1], everywhere[1], 9.0, target_um=2.0)
    )
    assert [list(sensors) for sensors in drawn.data[1].customdata] == [["<T1>"], ["<T1>", "T4"]]
    assert drawn.data[1].text[1] == "&lt;T1&gt; and T4"
    assert (drawn.data[3].x[0], drawn.data[3].y[0]) == (2, 1.0)
    assert drawn.layout.yaxis.title.text == "error of Z, rms [µm]"
    assert drawn.data[4].y == (2.0, 2.0)
    low, high = drawn.layout.yaxis.range
    assert low < np.log10(1.0) < np.log10(9.0) < high
    assert number_text(9.0) == "9.00"
