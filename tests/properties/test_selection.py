"""Whatever the recording and the options: a selection that can be written as JSON, or an error that says what to do."""

from __future__ import annotations

import json

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError
from selector.selection import Options, select
from tests.models.runs import recording


def at_rest(values, _rng):
    return np.full_like(values, values[0])


def missing(values, _rng):
    return np.full_like(values, np.nan)


def patchy(values, rng):
    return np.where(rng.random(len(values)) < 0.3, np.nan, values)


def coarse(values, _rng):
    return np.round(values)


def one_spike(values, _rng):
    out = np.zeros_like(values)
    out[len(out) // 2] = 1.0
    return out


def infinite(values, _rng):
    out = values.copy()
    out[-1] = np.inf
    return out


def huge(values, _rng):
    return np.where(np.abs(values) < 1e100, 1e200, 1.0) * values


DAMAGE = (at_rest, missing, patchy, coarse, one_spike, infinite, huge)


@st.composite
def damaged_recordings(draw):
    """Runs of any length; some channels of some runs are broken, some sensors copy or mirror others."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    lengths = draw(st.lists(st.integers(1, 40), min_size=1, max_size=5))
    n_sensors = draw(st.integers(1, 5))
    damage = draw(
        st.lists(
            st.tuples(
                st.integers(0, len(lengths) - 1),
                st.sampled_from([*(f"T{j}" for j in range(n_sensors)), "Z"]),
                st.sampled_from(DAMAGE),
            ),
            max_size=3,
        )
    )
    copies = draw(st.sampled_from([None, 1.0, 1.8, -1.0]))
    runs = {}
    for r, n in enumerate(lengths):
        values = {f"T{j}": rng.normal(size=n).cumsum() for j in range(n_sensors)}
        values["Z"] = 3 * values["T0"] + rng.normal(0, 0.1, n)
        if copies is not None and n_sensors > 1:
            values["T1"] = copies * values["T0"] + 32.0
        for run, name, broken in damage:
            if run == r:
                values[name] = broken(values[name], rng)
        runs[f"r{r}"] = (np.arange(float(n)), values)
    return recording(runs)


any_options = st.fixed_dictionaries(
    {},
    optional={
        "degree": st.integers(1, 3),
        "interactions": st.booleans(),
        "memory": st.booleans(),
        "ridge": st.booleans(),
        "rounds": st.integers(1, 3),
        "max_sensors": st.integers(1, 6),
        "level": st.sampled_from([None, 0.0, 0.9, 1.0]),
        "tolerance": st.sampled_from([None, 0.0, 0.01]),
        "reference": st.sampled_from(["rise", "absolute"]),
        "absolute_similarity": st.booleans(),
        "grouping": st.sampled_from(["closure", "closure", "cmeans"]),
        "must": st.sampled_from([(), ("T0",)]),
        "conditions": st.sampled_from([{}, {"r0": "winter"}]),
    },
)


@settings(max_examples=30)
@given(damaged_recordings(), any_options)
def test_a_selection_or_an_error_that_says_what_to_do(source, options):
    try:
        found = select(source, Options(**options))
    except InputError as error:
        refused = error
    else:
        refused = None
    if refused is not None:
        assert refused.found
        assert refused.advice
        return
    document = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    assert set(document["chosen"]["sensors"]) <= set(document["sensors"])
    assert len(found.chosen) <= found.options.max_sensors
    assert set(found.options.must) <= set(found.chosen)
    for model in found.models.values():
        assert np.isfinite(model.coefficients).all()
