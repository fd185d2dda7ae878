"""A gauge identified from recorded parts, the truth being integrated by SciPy, not by the model that is fitted."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from selector.diagnosis.open_model.refitting import refitted
from selector.diagnosis.open_model.runnable import OwnModel
from selector.physics.gauging.model_file import checked_model_file
from selector.recording import Channel, Recording

TRUE = {"linear.gain_v_per_um": -0.0172, "linear.bias_v": 2.31, "linear.time_constant_s": 0.16, "grinding.lag_s": 0.5}
NOISE_V = 0.002
#: Feeds of three parts [µm/s], each for 4 s, and where they begin [µm].
PARTS = {"part 1": ((12.0, 4.0, 8.0), 95.0), "part 2": ((15.0, 3.0, 0.0), 80.0), "part 3": ((9.0, 14.0, 2.0), 102.0)}


def recorded(*, with_allowance: bool) -> Recording:
    """Feed, allowance if so said, and a noisy voltage, 50 times a second."""
    gain, bias, filter_s, lag_s = TRUE.values()
    random, tables = np.random.default_rng(7), {}
    for run, (feeds, begins) in PARTS.items():
        # what is recorded of the feed holds from sample to sample; a part begins with a wheel that has not cut yet
        y, courses = np.array([begins, 0.0, bias + gain * begins]), []
        for feed in feeds:
            piece = solve_ivp(
                lambda t, y, a=feed: [-y[1], (a - y[1]) / lag_s, (bias + gain * y[0] - y[2]) / filter_s],
                (0.0, 4.0), y, "DOP853", np.linspace(0.0, 4.0, 201), rtol=1e-10, atol=1e-12,
            )  # fmt: skip
            courses.append(np.vstack([piece.y[:, :-1], np.full(200, feed * 0.06)]))
            y = piece.y[:, -1]
        allowance, _, voltage, feed = np.hstack(courses)
        table = {"feed": feed, "gauge": voltage + NOISE_V * random.standard_normal(len(voltage))}
        table |= {"allowance": allowance} if with_allowance else {}
        tables[run] = pd.DataFrame(table, index=pd.Index(np.arange(len(feed)) * 0.02, name="time_s"))
    channels = [Channel("feed", "feed_rate", "mm/min"), Channel("gauge", "voltage", "V")]
    channels += [Channel("allowance", "size", "um")] if with_allowance else []
    return Recording.from_runs(tables, tuple(channels), {})


def identified(recording: Recording, **bounds: list[float]):
    """What a fit makes of a nameplate that is off by 13 to 60 %; `bounds` by the last part of the name."""
    names = {name.rpartition(".")[2]: name for name in TRUE}
    file = checked_model_file({
        "model": {"kind": "gauging", "name": "nameplate"},
        "linear": {"gain_v_per_um": -0.015, "bias_v": bounds.pop("known_bias_v", 2.0), "time_constant_s": 0.1},
        "grinding": {"allowance_um": 90.0, "lag_s": 0.4, "stages": [{"feed_um_per_s": 12.0, "until_um": 0.0}]},
        "bounds": {names[key]: limits for key, limits in bounds.items()},
    })  # fmt: skip
    return refitted(OwnModel("gauging", file, recording), recording, responses=["gauge"])


def test_filter_gain_and_bias_come_from_a_recorded_allowance():
    found = identified(
        recorded(with_allowance=True),
        gain_v_per_um=[-0.03, -0.005], bias_v=[1.0, 4.0], time_constant_s=[0.02, 0.5],
    )  # fmt: skip
    for name, off in (
        # 1200 samples of 2 mV, over 80 µm: 1e-6 V/µm and 0.1 mV; rates of 0.2 V/s for most of 24 s: 0.4 ms
        ("linear.gain_v_per_um", 1e-5), ("linear.bias_v", 1e-3), ("linear.time_constant_s", 2e-3),
    ):  # fmt: skip
        assert found.values[name] == pytest.approx(TRUE[name], abs=off)
        low, high = found.quantities[name].low, found.quantities[name].high
        # 95 % intervals; twice as wide is 4 standard deviations
        assert low - (high - low) / 2 < TRUE[name] < high + (high - low) / 2
        assert high - low < 8 * off


def test_filter_gain_and_springs_come_from_the_feed_where_no_allowance_was_recorded():
    found = identified(
        recorded(with_allowance=False),
        known_bias_v=2.31, gain_v_per_um=[-0.03, -0.005], time_constant_s=[0.02, 0.3], lag_s=[0.3, 2.0],
    )  # fmt: skip
    assert found.values["linear.gain_v_per_um"] == pytest.approx(TRUE["linear.gain_v_per_um"], rel=5e-3)
    for name in ("linear.time_constant_s", "grinding.lag_s"):
        assert found.values[name] == pytest.approx(TRUE[name], rel=0.1)
    # two lags in a row: their sum is known far better than either
    assert found.values["linear.time_constant_s"] + found.values["grinding.lag_s"] == pytest.approx(0.66, rel=0.01)
