"""Which filters and thresholds are worth comparing, and what sizes do they give when parts are ground with them.

Every setting is a model file that could be run: its time constant and all its thresholds are round numbers, and its
mean and spread are those of parts ground with just these. Of a number a part has the same noise, feed
and start in all settings, so that filters compare by few parts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from selector.errors import InputError
from selector.physics.gauging.model_file import checked_model_file
from selector.physics.model_text import plain_values

if TYPE_CHECKING:
    from selector.physics.gauging.gauging_model import GaugingModel
    from selector.physics.gauging.grinding.gauged_grinding import FinishedSizes

PRESENT, CENTRED, BEST_FILTER, BEST_CENTRED = "present", "centred", "best-filter", "best-filter-centred"

_NEAR = 0.4  #: Share of the standard error of a mean to which it is centred.
_FINE_UM = 1e-3
_MOST_RUNS = 7
_STEEP = 4.0  #: By how much the change of size with the voltage may differ from the gain of the gauge.
_FILTER_DIGITS = 2
#: Filters that are looked at: up to this share of the last stage, which has to be long against its filter, or so many
#: times the present one.
_FILTERS, _SHARE_OF_STAGE, _DECADES, _ROUND_PRESENT = 12, 0.3, 2.5, 3.0
_MISSED = 0.01  #: Share of the parts that may miss a threshold more than do now.


@dataclass(frozen=True)
class Setting:
    """A filter and thresholds, and what sizes parts have that are ground with them, by Monte Carlo."""

    name: str  #: ``"present"``, ``"centred"``, ``"best-filter"`` or ``"best-filter-centred"``
    time_constant_s: float  #: T_Φ [s]
    thresholds_v: tuple[float, ...]  #: Of all stages, as they go into a model file [V]
    parts: int  #: That were ground
    #: bias_um and bias_error_um: Mean size minus the wanted one; its standard error [µm]
    bias_um: float
    bias_error_um: float
    sd_um: float  #: Standard deviation of the sizes [µm]
    #: Whether T_Φ is the longest or shortest that was looked at, so that a better one may lie beyond
    at_limit: bool = False

    @property
    def threshold_v(self) -> float:
        """Voltage of the last command [V]."""
        return self.thresholds_v[-1]

    @property
    def rms_um(self) -> float:
        """√(bias² + variance) [µm]."""
        return math.hypot(self.bias_um, self.sd_um)


def volts_text(setting: Setting) -> str:
    """What to write into the model file, all thresholds of it."""
    return f"thresholds.volts = [{', '.join(f'{volts:.10g}' for volts in setting.thresholds_v)}]"


def off_text(setting: Setting) -> str:
    """How far the mean is off, with its standard error [µm]."""
    if not setting.bias_error_um > 0:
        return f"{setting.bias_um:.2g}"
    decimals = max(0, 1 - math.floor(math.log10(setting.bias_error_um)))
    off = f"{setting.bias_um:.{decimals}f}"
    return f"{off.removeprefix('-') if float(off) == 0 else off} ± {setting.bias_error_um:.{decimals}f}"


def limit_text(setting: Setting) -> str:
    """That a filter is at the end of those that were looked at, to stand behind its time; empty if it is not."""
    return " (the end of what was looked at, as a stage has to be long against its filter)" if setting.at_limit else ""


#: Parts ground as a model says, all with the same noise, feeds and starts; few of them if so said.
Sizes = Callable[["GaugingModel", bool], "FinishedSizes"]


def gauging_settings(
    model: GaugingModel, present: FinishedSizes, sizes_of: Sizes
) -> tuple[tuple[Setting, ...], tuple[Setting, ...]]:
    """Filters with thresholds of eq. 23, T_Φ increasing, by few parts; and the settings that are worth comparing.

    These are: as it is; its last threshold moved until the mean is as wanted; the best filter, by eq. 23 and centred.
    What no file may say is left out, such as thresholds that do not rise or that the gauge does not show, and settings
    with which more parts miss a threshold.
    """
    bench = _Bench(model, present, sizes_of)
    now = model.setup.thresholds_v
    found = [_setting(PRESENT, model, present), _centred(CENTRED, bench, model, now, now[-1], present)]
    looked = [bench.looked_at(at_s) for at_s in _filters_s(model)]
    filters = tuple(one for one in looked if one is not None)
    for name, error in ((BEST_FILTER, "rms_um"), (BEST_CENTRED, "sd_um")):
        best = min(filters, key=attrgetter(error), default=None)
        other = None if best is None else bench.with_filter(best.time_constant_s)
        if best is None or other is None:
            continue
        at_limit = best in (filters[0], filters[-1])
        if name == BEST_FILTER:
            found.append(bench.setting(name, other, best.thresholds_v, at_limit=at_limit))
        else:
            first_v = best.threshold_v - model.setup.gauge.gain_v_per_um * best.bias_um
            found.append(_centred(name, bench, other, best.thresholds_v, first_v, at_limit=at_limit))
    return filters, tuple(one for one in found if one is not None)


def _filters_s(model: GaugingModel) -> list[float]:
    """Round time constants on an even logarithmic scale, around the present one."""
    setup = model.setup
    ends = [setup.grinding.allowance_um, *(stage.until_um for stage in setup.grinding.stages)]
    lasts_s = (ends[-2] - ends[-1]) / setup.rates_um_per_s[-1]
    present = setup.gauge.time_constant_s
    high = max(_SHARE_OF_STAGE * lasts_s, _ROUND_PRESENT * present)
    low = min(high * 10.0**-_DECADES, present / _ROUND_PRESENT)
    return sorted({_rounded(float(one), _FILTER_DIGITS) for one in np.geomspace(low, high, _FILTERS)})


class _Bench:
    """Grinds parts with other thresholds and filters."""

    def __init__(self, model: GaugingModel, present: FinishedSizes, sizes_of: Sizes) -> None:
        self._model, self._present, self._sizes_of = model, present, sizes_of
        fine_um = max(_NEAR * present.mean_error_um, _FINE_UM)
        # the digit of a voltage that moves a size by less than that
        self._decimals = math.ceil(-math.log10(0.5 * fine_um * abs(model.setup.gauge.gain_v_per_um)))

    def rounded(self, volts: Sequence[float]) -> tuple[float, ...]:
        return tuple(round(one, self._decimals) for one in volts)

    def with_filter(self, time_constant_s: float) -> GaugingModel | None:
        """The model with another T_Φ and thresholds of eq. 23; None if no file may say so."""
        plain = _unbound(self._model)
        gauge = plain["transducer"]["smoothing"] if "transducer" in plain else plain["linear"]
        gauge["time_constant_s"] = time_constant_s
        plain.pop("thresholds", None)
        return _made(plain)

    def looked_at(self, time_constant_s: float) -> Setting | None:
        """What this filter gives with thresholds of eq. 23, by few parts."""
        made = self.with_filter(time_constant_s)
        if made is None:
            return None
        return self.setting(BEST_FILTER, made, self.rounded(made.advised_thresholds_v), few=True)

    def setting(
        self,
        name: str,
        model: GaugingModel,
        volts: tuple[float, ...],
        *,
        at_limit: bool = False,
        few: bool = False,
    ) -> Setting | None:
        """What these thresholds give; None if no file may say them, or if more parts miss one than do now."""
        made = _made(_unbound(model) | {"thresholds": {"volts": list(volts)}})
        if made is None:
            return None
        sizes = self._sizes_of(made, few)
        if _missed(sizes) > _missed(self._present) + _MISSED:
            return None
        return _setting(name, made, sizes, at_limit=at_limit)


def _centred(
    name: str,
    bench: _Bench,
    model: GaugingModel,
    volts: Sequence[float],
    first_v: float,
    known: FinishedSizes | None = None,
    *,
    at_limit: bool = False,
) -> Setting | None:
    """The setting whose last threshold makes the mean as wanted; found by the secant, beginning at `first_v`.

    `known` are the sizes with `first_v`.
    """
    gain = model.setup.gauge.gain_v_per_um
    tried: list[tuple[float, float]] = []
    next_v = first_v
    if known is not None:
        off_um = known.mean_um - model.setup.wanted_um
        tried, next_v = [(first_v, off_um)], first_v - gain * off_um
    best: Setting | None = None
    for _ in range(_MOST_RUNS):
        one = bench.setting(name, model, bench.rounded((*volts[:-1], next_v)), at_limit=at_limit)
        if one is None:
            break
        if best is None or abs(one.bias_um) < abs(best.bias_um):
            best = one
        if abs(one.bias_um) <= max(_NEAR * one.bias_error_um, _FINE_UM):
            break
        tried.append((one.threshold_v, one.bias_um))
        next_v = _next_v(tried, gain)
        if bench.rounded((next_v,))[0] in [volt for volt, _ in tried]:
            break
    return best


def _next_v(tried: Sequence[tuple[float, float]], gain: float) -> float:
    """Where the line through the two nearest trials is 0; within the nearest ones on both sides."""
    near = sorted(tried, key=lambda one: abs(one[1]))
    (volts, off_um), slope = near[0], 1.0 / gain
    if len(near) > 1 and near[1][0] != volts:
        between = (near[1][1] - off_um) / (near[1][0] - volts)
        if 1.0 / _STEEP < between * gain < _STEEP:
            slope = between
    guess = volts - off_um / slope
    for (low, left), (high, right) in pairwise(sorted(tried)):
        if left * right < 0 and not low < guess < high:
            return 0.5 * (low + high)
    return guess


def _setting(name: str, model: GaugingModel, sizes: FinishedSizes, *, at_limit: bool = False) -> Setting:
    setup = model.setup
    return Setting(
        name,
        setup.gauge.time_constant_s,
        setup.thresholds_v,
        len(sizes.finished_um),
        sizes.mean_um - setup.wanted_um,
        sizes.mean_error_um,
        sizes.sd_um,
        at_limit,
    )


def _missed(sizes: FinishedSizes) -> float:
    """Share of the parts that no threshold stopped, or that a stage had nothing to do with."""
    return float(np.mean(~sizes.tripped | sizes.at_once))


def _unbound(model: GaugingModel) -> dict[str, Any]:
    """The file as plain values without what would forbid other settings; tables may be changed."""
    plain = {key: value for key, value in plain_values(model.file).items() if key != "bounds"}
    for section in ("linear", "transducer"):
        if section in plain:
            plain[section] = {
                key: dict(value) if isinstance(value, dict) else value for key, value in plain[section].items()
            }
    return plain


def _made(plain: dict[str, Any]) -> GaugingModel | None:
    from selector.physics.gauging.gauging_model import gauging_model

    try:
        return gauging_model(checked_model_file(plain))
    except InputError:
        return None


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")
