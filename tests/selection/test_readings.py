"""Readings of a selection: few, the same every time, and never without an extreme."""

from __future__ import annotations

import numpy as np

from selector.models.design import Rows
from selector.selection.fitting import DIGITS, MOST_JUDGED, MOST_RUNS, READING_POINTS, Part, kept_readings

N_RUNS, N = 45, 900


def rows(seed: int = 0) -> tuple[Rows, list[Part]]:
    """Many runs of smooth courses with spikes, each run left out in turn; the last one goes where no other was."""
    rng = np.random.default_rng(seed)
    course = np.cumsum(rng.normal(0, 0.1, (N_RUNS * N, 4)), axis=0) % 7.0
    course[rng.integers(0, N_RUNS * N, 8), rng.integers(0, 4, 8)] = rng.choice([-50.0, 50.0], 8) + rng.normal(0, 1, 8)
    course[-N:, :3] += 400.0
    names = tuple(f"r{k}" for k in range(N_RUNS))
    made = Rows(
        names, np.repeat(np.arange(N_RUNS), N), np.tile(np.arange(N) * 10.0, N_RUNS), course[:, :3], course[:, 3:]
    )
    return made, [Part(name, (name,)) for name in names]


def test_they_are_few_and_hold_every_extreme():
    made, parts = rows()
    kept = kept_readings(made, parts)
    assert len(kept) == MOST_RUNS
    assert [one.run for one in kept] == sorted((one.run for one in kept), key=made.runs.index)
    for one in kept:
        mine = made.run == made.runs.index(one.run)
        assert one.n_samples == N
        assert len(one.time_s) <= READING_POINTS + 2 * 4
        assert (np.diff(one.time_s) > 0).all()
        for shown, whole in ((one.variables, made.variables[mine]), (one.displacement_um, made.responses[mine])):
            for end in (np.min, np.max):
                assert (end(shown, axis=0) == np.round(end(whole, axis=0), DIGITS)).all()
    for shown, whole in (("variables", made.variables), ("displacement_um", made.responses)):
        everything = np.concatenate([getattr(one, shown) for one in kept])
        assert (everything.min(axis=0) == np.round(whole.min(axis=0), DIGITS)).all()
        assert (everything.max(axis=0) == np.round(whole.max(axis=0), DIGITS)).all()


def test_they_are_the_same_every_time():
    first, again = (kept_readings(*rows(1)) for _ in range(2))
    names = ("a", "b", "c"), ("Z",)
    assert [str(one.as_dict(*names)) for one in first] == [str(one.as_dict(*names)) for one in again]


def test_the_distance_is_that_to_all_that_was_not_left_out_together():
    made, parts = rows()
    kept = {one.run: one.beyond_others for one in kept_readings(made, parts)}
    judged = np.concatenate([np.isfinite(beyond) for beyond in kept.values()])
    assert 0 < judged.sum() <= MOST_JUDGED
    last = kept.pop(made.runs[-1])
    assert (last[np.isfinite(last)] > 1.0).all()
    others = np.concatenate(list(kept.values()))
    assert np.nanmedian(others) == 0.0


def test_a_short_run_is_kept_whole_and_alone_it_has_nothing_to_be_compared_with():
    made, _ = rows()
    short = made.only(np.arange(len(made.run)) < 50)
    (one,) = kept_readings(short, [Part("r0", ("r0",))])
    assert len(one.time_s) == one.n_samples == 50
    assert np.isnan(one.beyond_others).all()
