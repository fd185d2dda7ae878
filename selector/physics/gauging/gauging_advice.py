"""Which filters and thresholds are worth comparing, and what sizes do they give when parts are ground with them.

Every setting is a model file that could be run: its time constant and all its thresholds are round numbers, and its
mean and spread are those of parts ground with just these. Of a number a part has the same noise, feed
and start in all settings, so that filters compare by few parts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from selector.errors import InputError
from selector.physics.gauging.model_file import checked_model_file
from selector.physics.model_text import plain_values

if TYPE_CHECKING:
    from selector.physics.gauging.gauging_model import GaugingModel
    from selector.physics.gauging.grinding.gauged_grinding import FinishedSizes

PRESENT, UNCORRECTED, CENTRED, BEST_CENTRED = "present", "uncorrected", "centred", "best-filter-centred"

_NEAR = 0.4  #: Share of the standard error of a mean to which it is centred.
_FINE_UM = 1e-3
_MOST_STEPS = 4
_FILTER_DIGITS = 2
#: Filters that are looked at: up to this share of the last stage, which has to be long against its filter, or so many
#: times the present one.
_FILTERS, _SHARE_OF_STAGE, _DECADES, _ROUND_PRESENT = 12, 0.3, 2.5, 3.0
_MISSED = 0.01  #: Share of the parts that may miss a threshold more than do now.


@dataclass(frozen=True)
class Setting:
    """A filter and thresholds, and what sizes parts have that are ground with them, by Monte Carlo."""

    name: str  #: ``"present"``, ``"uncorrected"``, ``"centred"`` or ``"best-filter-centred"``
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


#: Parts ground as a model says, all with the same noise, feeds and starts; few of them if so said.
Sizes = Callable[["GaugingModel", bool], "FinishedSizes"]


def gauging_settings(
    model: GaugingModel, present: FinishedSizes, sizes_of: Sizes
) -> tuple[tuple[Setting, ...], tuple[Setting, ...]]:
    """Filters with thresholds of eq. 23, T_Φ increasing, by few parts; and the settings that are worth comparing.

    These are: as it is; without its correction by measured parts; its last threshold moved until the mean is as wanted;
    and the filter that spreads least, so centred. What no file may say is left out, such as thresholds that do not rise
    or that the gauge does not show, and settings with which more parts miss a threshold.
    """
    bench = _Bench(model, present, sizes_of)
    now = _setting(PRESENT, model, present)
    looked = [bench.looked_at(at_s) for at_s in _filters_s(model)]
    filters = tuple(one for one in looked if one is not None)
    best, steady = min(filters, key=lambda one: one.sd_um, default=None), None
    if best is not None and (other := bench.with_filter(best.time_constant_s)) is not None:
        steady = bench.centred(BEST_CENTRED, other, best, at_limit=best in (filters[0], filters[-1]))
    # where thresholds follow the parts, these are centred already
    centred = bench.centred(CENTRED, model, now) if model.values.correction is None else None
    settings = (now, bench.uncorrected(), centred, steady)
    return filters, tuple(one for one in settings if one is not None)


def _filters_s(model: GaugingModel) -> list[float]:
    """Round time constants on an even logarithmic scale, around the present one."""
    setup = model.setup
    ends = [setup.grinding.allowance_um, *(stage.until_um for stage in setup.grinding.stages)]
    lasts_s = (ends[-2] - ends[-1]) / setup.rates_um_per_s[-1]
    present = setup.gauge.time_constant_s
    high = max(_SHARE_OF_STAGE * lasts_s, _ROUND_PRESENT * present)
    low = min(high * 10.0**-_DECADES, present / _ROUND_PRESENT)
    return sorted({float(f"{one:.{_FILTER_DIGITS}g}") for one in np.geomspace(low, high, _FILTERS)})


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

    def uncorrected(self) -> Setting | None:
        """What these thresholds give where they stay, None if they do."""
        plain = _unbound(self._model)
        if plain.pop("correction", None) is None or (made := _made(plain)) is None:
            return None
        return _setting(UNCORRECTED, made, self._sizes_of(made, False))

    def looked_at(self, time_constant_s: float) -> Setting | None:
        """What this filter gives with thresholds of eq. 23, by few parts."""
        made = self.with_filter(time_constant_s)
        if made is None:
            return None
        return self.setting("", made, self.rounded(made.advised_thresholds_v), few=True)

    def setting(
        self, name: str, model: GaugingModel, volts: tuple[float, ...], *, at_limit: bool = False, few: bool = False
    ) -> Setting | None:
        """What these thresholds give; None if no file may say them, or if more parts miss one than do now."""
        made = _made(_unbound(model) | {"thresholds": {"volts": list(volts)}})
        if made is None:
            return None
        sizes = self._sizes_of(made, few)
        if _missed(sizes) > _missed(self._present) + _MISSED:
            return None
        return _setting(name, made, sizes, at_limit=at_limit)

    def centred(self, name: str, model: GaugingModel, begin: Setting, *, at_limit: bool = False) -> Setting | None:
        """The setting whose last threshold makes the mean as wanted; searched by the secant from what is known.

        That of `begin` where thresholds follow the parts.
        """
        slope, best = 1.0 / model.setup.gauge.gain_v_per_um, None
        last, volts, most = begin, begin.threshold_v - begin.bias_um / slope, _MOST_STEPS
        if model.values.correction is not None:
            volts, most = begin.threshold_v, 1
        for number in range(most):
            one = self.setting(name, model, self.rounded((*begin.thresholds_v[:-1], volts)), at_limit=at_limit)
            if one is None:
                break
            if best is None or abs(one.bias_um) < abs(best.bias_um):
                best = one
            if abs(one.bias_um) <= max(_NEAR * one.bias_error_um, _FINE_UM):
                break
            # of what was known before the first the parts may be others
            if number > 0 and one.threshold_v != last.threshold_v and one.bias_um != last.bias_um:
                slope = (one.bias_um - last.bias_um) / (one.threshold_v - last.threshold_v)
            last, volts = one, one.threshold_v - one.bias_um / slope
        return best


def _setting(name: str, model: GaugingModel, sizes: FinishedSizes, *, at_limit: bool = False) -> Setting:
    setup = model.setup
    found = len(sizes.finished_um), sizes.mean_um - setup.wanted_um, sizes.mean_error_um, sizes.sd_um
    return Setting(name, setup.gauge.time_constant_s, setup.thresholds_v, *found, at_limit)


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
