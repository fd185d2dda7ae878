"""A part that is ground under a gauge, beside a model of the gauge that lacks the springs of the machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from proving_ground.open_model.machine import RUNS, Concealed, Courses, Machine, effect
from selector.recording import Channel

_PERIOD_S = 0.02
_ROWS = 700
_FINER = 20
_UM_PER_S = 1000.0 / 60.0
_SIZES = {"gauging.lag": 0.3, "hidden.touched": 1.0}


def gauged(generator: np.random.Generator, *, ids: Sequence[str] = ()) -> Machine:
    """A gauge whose model lacks these effects; what is ground off follows the recorded feed."""
    draw = generator.uniform
    gain, bias, filter_s = -draw(0.01, 0.02), draw(1.5, 2.5), draw(0.08, 0.2)
    begin = 80.0
    touched = [np.sort(generator.integers(30, _ROWS, 8)) for _ in RUNS]
    by = [generator.standard_normal(9) for _ in RUNS]

    def read(told: Courses, sizes: Sequence[float]) -> Courses:
        size = dict(zip(ids, sizes, strict=True))
        h = _PERIOD_S / _FINER
        lag, removal, allowance = size.get("gauging.lag", 0.0), 0.0, begin
        number = round(1e4 * float(told["feed"].sum())) % len(RUNS)
        shown = np.empty(len(told["feed"]))
        # two filters in a row, the second one quick: what is called a time constant is their sum
        first = second = allowance
        for row, feed in enumerate(told["feed"] * _UM_PER_S):
            shown[row] = second
            for _ in range(_FINER):
                removal = feed if lag < h else removal + h / lag * (feed - removal)
                allowance -= h * removal
                first += h / (0.97 * filter_s) * (allowance - first)
                second += h / max(0.03 * filter_s, 2 * h) * (first - second)
        offset = by[number][np.searchsorted(touched[number], np.arange(len(shown)))]
        return {"gauge": bias + gain * (shown + size.get("hidden.touched", 0.0) * offset)}

    def programmed() -> Courses:
        steps = np.repeat(draw(0.0, 0.6, 7), _ROWS // 7)
        ramps = np.convolve(np.r_[np.zeros(5), steps], np.ones(5) / 5, mode="full")[5 : 5 + _ROWS]
        return {"feed": np.round(ramps, 4)}

    plain = {
        "model": {"kind": "gauging", "name": "a gauge as a line"},
        "linear": {"gain_v_per_um": gain, "bias_v": bias, "time_constant_s": filter_s},
        "grinding": {"allowance_um": begin, "stages": [{"feed_um_per_s": 4.0, "until_um": 0.0}]},
    }
    inputs = (Channel("feed", "feed_rate", "mm/min", place="wheel head"),)
    responses = {Channel("gauge", "voltage", "V", place="amplifier"): abs(gain) * draw(0.1, 0.3)}
    first = tuple(_SIZES[id_] for id_ in ids)
    programmes = {run: programmed() for run in RUNS}
    return Machine("gauging", plain, _PERIOD_S, inputs, responses, programmes, read, first)


def _lacking(name: str, *ids: str, kind: Any = "single", **rest: Any) -> Concealed:
    effects = tuple(effect(id_, "gauge") for id_ in ids)
    verdicts = rest.pop("verdicts", ("missing-physics",))
    return Concealed(f"{name}/gauged", kind, verdicts, partial(gauged, ids=ids), effects, **rest)


_OUTSIDE: Mapping[str, Any] = {"kind": "out-of-catalogue", "verdicts": ("unexplained",), "larger": 2.0}
SCENARIOS = tuple(
    one.scenario
    for one in (
        _lacking("clean", kind="clean", verdicts=("nothing-missing", "miscalibrated")),
        _lacking("wrong parameters", kind="miscalibrated", verdicts=("miscalibrated",)),
        _lacking("gauging.lag", "gauging.lag"),
        _lacking("hidden: zero touched", "hidden.touched", tolerated=("data.step",), **_OUTSIDE),
    )
)
