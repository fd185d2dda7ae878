"""Ball-bar files in the forms in which they are exported: one trace whatever the form, and what is refused says why."""

from __future__ import annotations

import numpy as np
import pytest

from selector.errors import InputError
from selector.readers.ball_bar_file import CircleOptions, read_circles
from tests.physics.drive.planted_circles import PlantedCircles

N = 720
ANGLE = np.arange(N) * 360.0 / N


def oval(angle_deg, way):
    """Deviation [µm] that differs between the directions."""
    return 8.0 * np.cos(2 * np.radians(angle_deg)) + way * 3.0 * np.sin(np.radians(angle_deg))


def table(header, rows, mark=","):
    return "\n".join([*header, *(mark.join(map(str, row)) for row in rows)]) + "\n"


def circles(tmp_path, text, **asked):
    path = tmp_path / "test.csv"
    path.write_text(text, encoding="utf-8")
    return read_circles([path], CircleOptions(**asked))


WAYS = ((1, "ccw", ANGLE), (-1, "cw", -ANGLE))
LONG = [(f"{a:.3f}", word, 1000, f"{oval(a, way):.4f}") for way, word, angle in WAYS for a in angle]
FORMS = {
    "one under the other": table(["angle_deg,direction,feed_mm_per_min,deviation_um"], LONG),
    "side by side": table(["angle [deg],ccw [um],cw [um]"], [(a, oval(a, 1), oval(a, -1)) for a in ANGLE]),
    "radians and mm": table(
        ["Theta (rad);Run CCW (mm);Run CW (mm)"],
        [(f"{np.radians(a)};{oval(a, 1) / 1e3};{oval(a, -1) / 1e3}".replace(".", ","),) for a in ANGLE],
    ),
    "length of the bar": table(
        ["Radius: 100 mm", "Feed rate: 1 m/min", "angle\tdirection\tlength_mm"],
        [(a, way, 100.0 + oval(a, way) / 1e3) for way, _, angle in WAYS for a in angle],
        "\t",
    ),
    "there and back": table(["angle_deg,dev_um"], [(a, oval(a, 1)) for a in np.arange(0.0, 360.2, 0.5)])
    + "".join(f"{a},{oval(a, -1)}\n" for a in np.arange(359.5, -0.2, -0.5)),
    "with overshoot": table(
        ["angle_deg,direction,dev_um"],
        [(a, word, oval(a, way)) for way, word, _ in WAYS for a in way * np.arange(-60.0, 420.5, 0.5)],
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_same_circles(tmp_path, form):
    read, findings = circles(tmp_path, FORMS[form], radius_m=0.1, feed_mm_per_min=1000.0)
    assert [one.id for one in findings] == ["ball-bar-axes-assumed"]
    assert not circles(tmp_path, FORMS[form], radius_m=0.1, feed_mm_per_min=1000.0, axes=("X", "Y"))[1]
    assert [one.trace.direction for one in read] == [1, -1]
    assert [one.is_reversed for one in read] == [False, form in ("side by side", "radians and mm")]
    for one in read:
        expected = oval(np.degrees(one.trace.angle_rad), one.trace.direction)
        # printed to 0.1 nm
        np.testing.assert_allclose(one.trace.deviation_um, expected, atol=2e-3)


def test_lines_above_the_table_say_radius_feed_direction_and_axes(tmp_path):
    head = ["Radius: 150 mm", "Feed = 2000 mm/min", "Direction: clockwise", "Plane: ZX", "angle_deg,deviation_um"]
    (one,), _ = circles(tmp_path, table(head, [(-a, oval(a, -1)) for a in ANGLE]))
    trace = one.trace
    assert (trace.radius_m, trace.feed_mm_per_min, trace.direction, trace.axes) == (0.15, 2000.0, -1, ("Z", "X"))


def test_two_positions_over_time_are_a_circle(tmp_path):
    time_s, omega = np.arange(0.0, 13.0, 0.01), 0.5
    x, y = 100.0 * np.cos(omega * time_s), 100.004 * np.sin(omega * time_s)
    text = table(["time_s,X [mm],Y [mm]"], zip(time_s, x, y, strict=True))
    (one,), _ = circles(tmp_path, text, radius_m=0.1)
    assert one.trace.direction == 1
    assert one.trace.feed_mm_per_min == pytest.approx(omega * 0.1 * 60e3, rel=1e-3)
    # the 4 µm of Y, at 90°; its centre is between the farthest samples, which lack up to 100 mm·(0.005 / 2)²/2 = 0.3 µm
    assert one.trace.deviation_um.max() == pytest.approx(4.0, abs=0.3)


def test_times_tell_the_feed(tmp_path):
    rows = [(0.02 * k, a, oval(a, 1)) for k, a in enumerate(ANGLE)]
    (one,), _ = circles(tmp_path, table(["time_s,angle_deg,deviation_um"], rows), radius_m=0.1)
    assert one.trace.feed_mm_per_min == pytest.approx(2 * np.pi * 100.0 / (0.02 * N) * 60.0, rel=1e-6)


def test_a_missing_unit_is_told(tmp_path):
    _, findings = circles(
        tmp_path,
        table(["angle,deviation"], [(a, oval(a, 1)) for a in ANGLE]),
        radius_m=0.1,
        feed_mm_per_min=1000.0,
        axes=("Z", "X"),
    )
    assert [(one.id, one.where.channel) for one in findings] == [("ball-bar-unit-assumed", "deviation")]


def test_samples_that_are_no_numbers_are_left_out_and_told(tmp_path):
    rows = [(a, oval(a, 1), oval(a, -1)) for a in ANGLE]
    rows[10], rows[20], rows[30] = (rows[10][0], "NaN", 1.0), ("inf", 1.0, 1.0), (rows[30][0], "", rows[30][2])
    # the second direction was recorded for a shorter time
    rows[-3:] = [(a, ccw, "") for a, ccw, _ in rows[-3:]]
    text = table(["angle_deg,ccw_um,cw_um"], rows)
    read, findings = circles(tmp_path, text, radius_m=0.1, feed_mm_per_min=1000.0, axes=("X", "Y"))
    assert len(read) == 2
    told = {one.where.channel: one.evidence["rows"] for one in findings if one.id == "ball-bar-samples-left-out"}
    assert told == {"ccw_um": [11, 21, 31], "cw_um": [21]}


def test_a_planted_test_is_read_as_it_was_written(tmp_path):
    read, _ = read_circles([PlantedCircles(3).write(tmp_path / "test.txt")])
    assert [(one.trace.direction, one.trace.feed_mm_per_min) for one in read] == [
        (1, 1000.0),
        (-1, 1000.0),
        (1, 3000.0),
        (-1, 3000.0),
    ]


@pytest.mark.parametrize(
    ("text", "asked", "named"),
    [
        (FORMS["one under the other"], {}, "no radius"),
        (table(["angle_deg,deviation_um"], [(a, 1.0) for a in ANGLE]), {"radius_m": 0.1}, "no feed"),
        (
            table(["angle_deg,direction,deviation_um"], [(a, "ccw", 1.0) for a in (*ANGLE, *-ANGLE)]),
            {"radius_m": 0.1, "feed_mm_per_min": 1e3},
            "runs back by",
        ),
        (table(["angle_deg,deviation_um"], [(1.0, 2.0)]), {"radius_m": 0.1, "feed_mm_per_min": 1e3}, "1 samples"),
        (table(["angle_deg,T1"], [(a, 1.0) for a in ANGLE]), {"radius_m": 0.1}, "angle_deg, T1"),
        # whole numbers below lines of words: read as one column with decimal commas, which is not both at once
        (
            "Radius: 100 mm\nFeed: 1000 mm/min\nangle_deg,deviation_um\n" + "".join(f"{a},0\n" for a in range(360)),
            {"radius_m": 0.1},
            "the columns",
        ),
        (table(["deviation_um,T1"], [(a, 1.0) for a in ANGLE]), {"radius_m": 0.1}, "angle of the bar"),
        (
            table(["angle_deg,deviation_um"], [(a, 1.0) for a in ANGLE[:600]]),
            {"radius_m": 0.1, "feed_mm_per_min": 1e3},
            "300° counter-clockwise",
        ),
        (
            table(["angle_deg,direction,deviation_um"], [(a, "up", 1.0) for a in ANGLE]),
            {"radius_m": 0.1, "feed_mm_per_min": 1e3},
            "direction 'up'",
        ),
        (
            table(["angle_deg,deviation_um"], [(a, f"at{a}") for a in ANGLE]),
            {"radius_m": 0.1, "feed_mm_per_min": 1e3},
            "no numbers in 'deviation_um'",
        ),
    ],
)
def test_what_is_no_circle_is_refused_with_its_place(tmp_path, text, asked, named):
    with pytest.raises(InputError) as refused:
        circles(tmp_path, text, **asked)
    assert named in str(refused.value)
    assert "test.csv" in refused.value.where
    assert refused.value.advice
