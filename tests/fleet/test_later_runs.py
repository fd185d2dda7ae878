"""What came after what: by the clocks of the recordings, else by their names, and no recording twice."""

from selector.fleet.refitting import by_age, part_of
from selector.readers import read
from selector.study.inputs import sha256_of

HEAD = "time,T1 [degC],Z [um]"


def recording(folder, name, day):
    """A recording of this day in January 2026, or without a date."""
    path = folder / f"{name}.csv"
    stamps = [f"2026-01-{day:02} 06:0{minute}:00" if day else f"{60 * minute}" for minute in range(5)]
    lines = [
        f"{stamp},{20 + minute + 0.01 * (day or len(name))},{minute * minute}" for minute, stamp in enumerate(stamps)
    ]
    path.write_text("\n".join([HEAD, *lines]) + "\n", encoding="utf-8")
    return path


def test_by_the_clock_where_there_is_one(tmp_path):
    a, b, c = (recording(tmp_path, name, day) for name, day in (("a", 5), ("b", 9), ("c", 2)))
    recording(tmp_path, "copy_of_b", 9)
    reading = read([tmp_path])
    earlier, later = by_age(reading, {sha256_of(a)})
    assert list(earlier.values()) == [c, a]
    assert list(later.values()) == [b]
    assert part_of(reading, later.values()).recording.runs == ("b",)
    assert list(by_age(reading, set())[1].values()) == [c, a, b]


def test_by_name_where_one_has_no_clock(tmp_path):
    paths = [recording(tmp_path, name, None) for name in ("r2", "r10", "r100")]
    earlier, later = by_age(read([tmp_path]), {sha256_of(paths[1])})
    assert list(earlier.values()) == paths[:2]
    assert list(later.values()) == paths[2:]
