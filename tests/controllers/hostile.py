"""Models with everything that a guard can have, and rows that no sane control would send."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from selector.controllers import Fallback, Guard, Input, ModelFile, Output, OutputLimits, PositionPart, State, Term
from selector.controllers.closed_values import Adaptation, OutputAdaptation
from selector.controllers.replay.parts import Rows

BAD = np.array([np.nan, np.inf, -np.inf, 850.0, -9999.0, 1e300, -1e300, 1e10, 99.0, -60.0, 5e-324])


def _inputs(names: str = "123") -> tuple[Input, ...]:
    every = {
        "1": Input(name="T1", valid_min=-2.0, valid_max=12.0, centre=4.0, scale=3.0, rate_limit_per_min=4.0),
        "2": Input(name="T2", reference="absolute", valid_min=10.0, valid_max=45.0, centre=25.0, scale=7.0,
                   reading_min=-20.0, reading_max=90.0),
        "3": Input(name="n", role="spindle_speed", unit="rpm", reference="absolute", valid_min=0.0, valid_max=6000.0,
                   scale=1000.0),
    }  # fmt: skip
    return tuple(every[k] for k in names)


def _outputs(names: str, *, has_slope: bool) -> tuple[Output, ...]:
    known = {"1": "T1", "2": "T2", "3": "n"}
    first = [Term(powers={known[k]: 1}, coefficient=1.7 - 0.9 * int(k)) for k in names]
    second = [*first, Term(powers={known[names[0]]: 2, known[names[-1]]: 1}, coefficient=0.31)]
    if "1" in names:
        second.append(Term(powers={"T1 late": 3}, coefficient=-0.07))
    part = None
    if has_slope:
        part = PositionPart(
            axis="Z", reference_m=0.1, valid_min_m=-0.2, valid_max_m=0.5, intercept=1.5, terms=tuple(first[:1])
        )
    return (
        Output(name="Z", axis="Z", intercept=-1.9, terms=tuple(second), position=part),
        Output(name="Y", axis="Y", intercept=0.3, terms=tuple(first)),
    )


def model(*, on_fault: str = "fallback", has_slope: bool = True, **guard: object) -> ModelFile:
    """Three sensors, one of them a speed, a memory, two outputs, two fallbacks."""
    late = State(name="T1 late", source="T1", tau_s=900.0, centre=2.0, scale=3.0)
    later = State(name="T1 late", source="T1", tau_s=4000.0, centre=2.0, scale=3.0)
    decided: dict[str, object] = {
        "limits": (
            OutputLimits(output="Z", clamp_um=20.0, slew_um_per_s=0.7, dead_band_um=0.2, slope_clamp_um_per_m=25.0),
            OutputLimits(output="Y", clamp_um=8.0),
        ),
        "on_fault": on_fault,
        "hold_at_most_s": 300.0,
        "without_fallback": "hold",
        "stuck_after_s": 400.0,
        "new_start_after_s": 500.0,
        **guard,
    }
    return ModelFile(
        name="everything",
        inputs=_inputs(),
        states=(late,),
        outputs=_outputs("123", has_slope=has_slope),
        guard=Guard.model_validate(decided),
        fallbacks=(
            Fallback(without=("T2",), inputs=_inputs("13"), states=(late, later.model_copy(update={"name": "later"})),
                     outputs=_outputs("13", has_slope=has_slope)),
            Fallback(without=("T1",), inputs=_inputs("23"), outputs=_outputs("23", has_slope=has_slope)),
        ),
    )  # fmt: skip


def rows(n: int, seed: int, n_axes: int = 1) -> Rows:
    """Readings that wander, stand still, jump and break off, in calls of any rhythm."""
    rng = np.random.default_rng(seed)
    dt_s = rng.choice([0.0, 0.001, 0.3, 1.0, 7.0, 60.0, 900.0, np.nan, np.inf, -5.0], n,
                      p=[0.02, 0.05, 0.1, 0.5, 0.2, 0.1, 0.01, 0.01, 0.005, 0.005])  # fmt: skip
    readings = np.column_stack(
        [level + np.cumsum(rng.normal(0.0, step, n)) for level, step in ((22.0, 0.02), (26.0, 0.03), (3000.0, 20.0))]
    )
    # resolution, a sensor that stands still, one that jumps, and whole stretches without a reading
    readings[:, 0] = np.round(readings[:, 0] * 16.0) / 16.0
    for column in range(3):
        at = 0
        while at < n:
            length = int(rng.geometric(1.0 / 300.0))
            stretch = slice(at, at + length)
            kind = rng.choice(["good", "bad", "mixed", "still", "jump", "far"], p=[0.6, 0.1, 0.1, 0.08, 0.06, 0.06])
            if kind == "bad":
                readings[stretch, column] = rng.choice(BAD)
            elif kind == "mixed":
                hit = rng.random(len(readings[stretch])) < 0.3
                readings[stretch, column][hit] = rng.choice(BAD, int(hit.sum()))
            elif kind == "still":
                readings[stretch, column] = readings[at, column]
            elif kind == "jump":
                readings[at:, column] += rng.normal(0.0, 8.0)
            elif kind == "far":
                readings[stretch, column] *= rng.choice([-1.0, 3.0, 100.0])
            at += length
    positions = rng.choice([0.1, 0.0, 0.5, -3.0, np.nan, np.inf, 1e12], (n, n_axes))
    return Rows(
        dt_s, readings, positions, rng.random(n) > 0.02, rng.random(n) > 0.05,
        rng.random(n) < 0.002, rng.choice([0.0, 60.0, 3600.0, np.nan, -1.0, np.inf], n), _tests(rng, n),
    )  # fmt: skip


def _tests(rng: np.random.Generator, n: int) -> np.ndarray:
    """Of two outputs: mostly nothing, stretches of sign tests, and what no person would command."""
    test_um = np.zeros((n, 2))
    for start in np.flatnonzero(rng.random(n) < 0.004):
        test_um[start : start + rng.integers(1, 40), rng.integers(2)] = rng.choice([10.0, -10.0, 1e-9, 5.0, 1e8])
    strange = rng.random((n, 2)) < 0.002
    test_um[strange] = rng.choice([np.nan, np.inf, -np.inf, 1e300, -1e12, 5e-324, -0.0], int(strange.sum()))
    return test_um


def adapted(of: ModelFile, *, with_gain: bool = True) -> ModelFile:
    """The model with touch-offs: Z, a rise now, with offset and gain if `with_gain`; Y with an offset."""
    gain = {"gain_per_s": 1e-7, "gain_start": 0.01, "gain_limit": 0.3} if with_gain else {}
    common = {"offset_um2_per_s": 1e-3, "offset_start_um2": 4.0, "noise_um2": 0.3, "offset_limit_um": 15.0}
    block = Adaptation(outputs=(OutputAdaptation(output="Y", **common), OutputAdaptation(output="Z", **common, **gain)))
    outputs = tuple(o.model_copy(update={"reference": "rise"}) if o.name == "Z" else o for o in of.outputs)
    return of.model_copy(update={"adaptation": block, "outputs": outputs})


def touched(of: Rows, seed: int) -> Rows:
    """The rows with touch-offs of two outputs, one in ten of them false or no number at all."""
    rng, n = np.random.default_rng(seed), len(of)
    shown = rng.normal(0.0, 3.0, (n, 2)) + np.cumsum(rng.normal(0.0, 0.05, (n, 2)), axis=0)
    false = rng.random((n, 2)) < 0.1
    shown[false] = rng.choice([50.0, -50.0, np.nan, np.inf, 1e300, -1e9, 5e-324, 1e9], int(false.sum()))
    return replace(of, is_touch_valid=rng.random(n) < 0.05, touch_um=shown)
