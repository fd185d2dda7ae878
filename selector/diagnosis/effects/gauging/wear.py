"""`gauging.wear`: wheel or probe wear."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.effects.gauging.lag import infeed
from selector.diagnosis.shapes.signals import by_run, course, excited, no_gauging, part_by_part
from selector.types import Vector

_SATURATION = (0.15, 0.4)  #: Amount after which wear that settles is two thirds done, over the whole amount.


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    every = list(_amounts(comparison, response))
    yield from _wheel_and_probe(every)
    for words, sources, used in every:
        total = float(np.abs(used).max(initial=0.0))
        if total <= 0.0:
            continue
        relative = used / total
        laws = [
            (relative, words, "power", 1.0),
            (relative**2, f"the square of {words}", "power", 2.0),
            *(
                (1.0 - np.exp(-relative / share), f"{words}, settling", "settles", share * total)
                for share in _SATURATION
            ),
        ]
        for column, law, key, value in laws:
            shape = {"whole": Quantity(total, "1"), key: Quantity(value, "1")}
            yield Variant(column[:, None], (f"wear with {law}",), shape, sources=sources)


def _wheel_and_probe(every: list[tuple[str, tuple[str, ...], Vector]]) -> Iterator[Variant]:
    """A wheel that is dressed, and a probe that is not: wear since dressing and wear over all runs, together."""
    lasting = next(used for words, _, used in every if words.endswith("over all runs"))
    for words, sources, used in every:
        if "last came on" not in words:
            continue
        relative = used / max(float(used.max()), 1e-300)
        for share in (np.inf, *_SATURATION):
            wheel = relative if np.isinf(share) else 1.0 - np.exp(-relative / share)
            columns = np.column_stack([wheel, lasting / max(float(lasting.max()), 1e-300)])
            shape = {"whole": Quantity(float(used.max()), "1")}
            if np.isfinite(share):
                shape["settles"] = Quantity(float(share * used.max()), "1")
            yield Variant(columns, (f"wear with {words}", "wear over all runs"), shape, sources=sources)


def _amounts(comparison: Comparison, response: str) -> Iterator[tuple[str, tuple[str, ...], Vector]]:
    """(words, channels, course) of what wear may go with: parts, time, contact, stock removed, since dressing."""
    unit = "parts" if part_by_part(comparison, response) else "time"
    since_start = np.array(comparison.time_s)
    yield f"{unit} since the start of the run", (), since_start
    yield f"{unit} over all runs", (), _over_all_runs(comparison, since_start)
    steps = np.maximum(np.diff(comparison.time_s, prepend=comparison.time_s[:1]), 0.0)
    for name in comparison.with_role("state"):
        state = course(comparison, name)
        if not excited(state):
            continue
        low, high = float(state.min()), float(state.max())
        on = (state - low) / (high - low)
        contact = by_run(comparison, np.cumsum, on * steps)
        yield f"time of {name}", (name,), contact
        yield f"time of {name} over all runs", (name,), _over_all_runs(comparison, contact)
        since = _since_rise(comparison, on > 0.5)
        if since is not None:
            yield f"{unit} since {name} last came on", (name,), since
    for name, rate_um_per_s in infeed(comparison).items():
        removed = by_run(comparison, np.cumsum, np.abs(rate_um_per_s) * steps)
        yield f"stock removed by {name}", (name,), removed
        yield f"stock removed by {name} over all runs", (name,), _over_all_runs(comparison, removed)


def _over_all_runs(comparison: Comparison, used: Vector) -> Vector:
    """The same without starting anew in every run."""
    result, before = np.array(used), 0.0
    for _, rows in comparison.rows_of_runs():
        result[rows] += before
        before = float(result[rows][-1])
    return result


def _since_rise(comparison: Comparison, on: NDArray[np.bool_]) -> Vector | None:
    """Time since the state last came on, e.g. dressing; None if it comes on only once or never, or all the time."""
    result, rises = np.array(comparison.time_s), 0
    for _, rows in comparison.rows_of_runs():
        part, time = on[rows], comparison.time_s[rows]
        begins = np.flatnonzero(part[1:] & ~part[:-1]) + 1
        rises += len(begins)
        for k in begins:
            result[rows][k:] = time[k:] - time[k]
    return result if 2 <= rises <= len(on) // 4 else None


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    amount = fitted.coefficient()
    by = f"{'grows' if amount.value > 0.0 else 'shrinks'} by {abs(amount.value):.3g} {fitted.unit}"
    text = f"{fitted.response} {by} over the record, as {fitted.variant.names[0]}"
    return Reading(text, {"over_the_record": amount} | fitted.size)


EFFECT = Effect(**words_of("gauging.wear"), variants=_variants, testable=no_gauging, reading=_reading)
