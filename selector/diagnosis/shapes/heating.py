"""Which recorded channels heat, cool or surround the machine, and how the simulation itself heats."""

import re
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from scipy.ndimage import uniform_filter1d

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import (
    by_movement,
    by_run,
    course,
    excited,
    lagged,
    no_flow,
    rate,
    rise,
    time_constants,
)
from selector.number_text import span_text
from selector.recording import Channel
from selector.types import Matrix, Vector

SHORTEST_S = 600.0  #: Runs shorter than this show no heat: the fastest parts of machines take minutes.
_WARMED = ("displacement", "temperature")
_HALL = r"\bhall\b|\broom\b|ambient|\bair\b|environment|raum|umgebung|luft|цех|воздух|окруж|环境|室温|车间"
_COOLANT = r"cool|chill|emulsion|\bkss\b|flood|\bjets?\b|kühl|охлажд|сож|冷却|切削液"
_SOURCE = (
    r"hyd|\btank|feed|axis|servo|motor|gear|drive|\bfan\b|compress|lamp|light|chip|convey|clamp|door|cabinet|electr|"
    r"supply|\bbed\b|heat(er|ing|ed)|nozzle|heiz|getriebe|antrieb|гидро|двигат|привод|бак|液压|电机|油箱"
)
_HALF = 0.5
_SQUARED = ("current", "force", "voltage", "acceleration")
_MOVING = ("feed_rate", "velocity")
_SWITCHED = ("state", "flow")
_SENSED = ("temperature", "ambient")


@dataclass(frozen=True)
class Sources:
    """Names of the channels that move, by what they do to the machine's heat; what moves most stands first."""

    spindle: str | None  #: The spindle speed
    hall: tuple[str, ...]  #: Temperatures of the surroundings
    machine: tuple[str, ...]  #: Temperatures of the machine, without the response itself
    #: coolant_switches and coolant_temperatures: State or flow of the coolant; its temperature
    coolant_switches: tuple[str, ...]
    coolant_temperatures: tuple[str, ...]
    is_coolant_said: bool  #: Whether a name or place tells of coolant; else the switch may be of any other device
    other_heat: tuple[str, ...]  #: Channels of other heat: feeds, currents, states of other devices


@lru_cache(maxsize=16)
def sources(comparison: Comparison, response: str) -> Sources:
    """What heats, cools or surrounds the machine of this comparison, as far as it was recorded and moves."""
    # the steps of what is switched or set are no resolution
    grain = {c.name: comparison.resolution.get(c.name, 0.0) * (c.role in _SENSED) for c in comparison.channels}
    known = {c.name: c for c in comparison.channels if c.name != response}
    moving = [known[n] for n in by_movement(comparison, known) if excited(course(comparison, n), grain[n])]
    warm = [channel for channel in moving if channel.role == "temperature"]
    switched = [channel for channel in moving if channel.role in _SWITCHED and channel.name not in comparison.responses]
    coolant = [channel for channel in switched if _says(channel, _COOLANT)]
    unsaid = [channel for channel in switched if not _says(channel, _SOURCE)] if not coolant else []
    # of one switch nobody says what it is: it may be coolant, or another source if the simulation does not follow it
    cold = coolant or [channel for channel in unsaid[:1] if _is_simulated(comparison, response, channel.name)]
    hall = [c for c in moving if c.role == "ambient"] + [c for c in warm if _says(c, _HALL)]
    fluid = [channel for channel in warm if _says(channel, _COOLANT) and channel not in hall]
    driven = [c for c in moving if c.role in (*_MOVING, *_SQUARED, "position") or (c in switched and c not in cold)]
    others = [c for c in driven if c.name not in comparison.responses]
    commands = [c for c in moving if c.role == "position_command" and c.axis not in {o.axis for o in others}]
    return Sources(
        spindle=next((channel.name for channel in moving if channel.role == "spindle_speed"), None),
        hall=_named(hall),
        machine=_named([channel for channel in warm if channel not in hall and channel not in fluid]),
        coolant_switches=_named(coolant or unsaid[:1]),
        coolant_temperatures=_named(fluid),
        is_coolant_said=bool(coolant),
        other_heat=_named(others + commands),
    )


def says_other_source(channel: Channel) -> bool:
    """Whether the name or place speaks of a device that heats and is no spindle."""
    return _says(channel, _SOURCE)


def lacking(comparison: Comparison, response: str) -> str | None:
    """Why no thermal effect can be tested in this response; None if it can."""
    role = comparison.channel(response).role
    if role not in _WARMED:
        return f"heat shows in displacements and temperatures, and {response} is a channel of role {role}"
    if role == "displacement" and comparison.longest_s < SHORTEST_S:
        return f"the longest run takes {span_text(comparison.longest_s)}, heat needs {span_text(SHORTEST_S)} or more"
    is_level = role == "displacement" and no_flow(comparison, response) is None
    if is_level and not sources(comparison, response).is_coolant_said:
        return f"{response} is the level of a store that something flows into, and nothing that warms was recorded"
    if len(comparison.time_s) < 20 * len(comparison.runs):
        return "fewer than 20 samples a run"
    return None


def speed_power(comparison: Comparison, name: str, exponent: float) -> Vector:
    """(n / n_max)^p of a channel of speed, shape (n_rows,)."""
    speed = np.abs(course(comparison, name))
    return np.asarray((speed / max(float(speed.max()), 1e-300)) ** exponent)


def top_speed_rpm(comparison: Comparison, name: str) -> float:
    """Highest recorded spindle speed [rpm]: the one that `speed_power` counts from."""
    return float(np.abs(course(comparison, name)).max())


def switched_on(comparison: Comparison, name: str) -> Vector:
    """State or flow as a part of its largest value, 0 to 1."""
    values = np.abs(course(comparison, name))
    return np.asarray(values / max(float(values.max()), 1e-300))


def heats(comparison: Comparison, name: str) -> tuple[tuple[str, Vector], ...]:
    """Heat flows that a channel may stand for, each with words and as a part of its largest value."""
    role = comparison.channel(name).role
    values = course(comparison, name)
    if role in ("position", "position_command"):
        values = rate(comparison, values)
    values = np.abs(values)
    part = values / max(float(values.max()), 1e-300)
    if role in _SWITCHED:
        return ((name, part),)
    word = f"|d {name}/dt|" if role.startswith("position") else f"|{name}|"
    return ((word, part), (f"{name}²" if role in _SQUARED else f"{word}²", part**2))


def temperature_rise(comparison: Comparison, name: str) -> Vector:
    """What a recorded temperature has risen since the start of its run [K]."""
    return rise(comparison, course(comparison, name))


def simulated_rise(comparison: Comparison, response: str) -> Vector:
    """What the simulated course has risen since the start of its run [unit of the response], without holes."""
    return rise(comparison, comparison.simulated_course(response), over_samples=1)


def shown_unit(unit: str) -> str:
    """The unit of a response as people write it; differences of temperatures are in K."""
    return {"um": "µm", "degC": "K"}.get(unit, unit)


def _is_simulated(comparison: Comparison, response: str, name: str) -> bool:
    """Whether the simulated course follows a channel, beside the warm-up of a machine that is switched on for good."""
    target, part = simulated_rise(comparison, response), switched_on(comparison, name)
    rows, taus = _every(comparison), (0.0, *time_constants(comparison, _OTHER_LAGS))
    on, lags = (
        np.column_stack([lagged(comparison, of, float(tau_s)) for tau_s in taus])[rows]
        for of in (np.ones(len(part)), part)
    )
    left = [np.var(target[rows] - of @ _ridge(of, target[rows])) for of in (on, np.hstack([on, lags]))]
    return bool(left[1] < _HALF * left[0])


def _says(channel: Channel, words: str) -> bool:
    text = f"{channel.name} {channel.place or ''}".lower().replace("_", " ")
    return re.search(words, text) is not None


def _named(channels: list[Channel]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(channel.name for channel in channels))


def cooled(comparison: Comparison, source: Vector, gate: Vector, tau_s: float, extra_per_s: float) -> Vector:
    """Solution of x' = (s − x)/τ − r·g·x, source s, gate g, from 0 in every run; r = `extra_per_s` [1/s].

    Source and gate count as their means between two samples. With r = 0 it is a lag of first order.
    """
    courses = (*(np.ascontiguousarray(of, dtype=np.float64) for of in (source, gate)), comparison.time_s)
    return by_run(comparison, lambda s, g, time: _cooled(s, g, time, tau_s, extra_per_s), *courses)


@njit(cache=True, nogil=True)
def _cooled(source, gate, time_s, tau_s, extra_per_s):  # type: ignore[no-untyped-def]
    x = np.empty(len(source))
    x[0] = 0.0
    for k in range(1, len(source)):
        step_s = time_s[k] - time_s[k - 1]
        rate = 1.0 / tau_s + extra_per_s * 0.5 * (gate[k] + gate[k - 1])
        steady = 0.5 * (source[k] + source[k - 1]) / (tau_s * rate)
        x[k] = steady + (x[k - 1] - steady) * np.exp(-rate * step_s)
    return x


EXPONENTS = (0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
_RIDGE = 1e-6
_MOST_ROWS = 1500
_OWN_LAGS = 10
_OTHER_LAGS = 4
_CALM_S = 1800.0
_WARM_START_K = 1.0
_FIRST, _FAR = 5, 0.1  #: Samples of a run that tell its start; part of the spread.
EARLIER = "what was left of earlier heat"  #: Name of the column of `warm_starts` that falls.
_MOST_SENSORS = 8
_LEFT_BY_SENSORS = 0.01


@dataclass(frozen=True, eq=False)
class SpindleLaw:
    """A simulated course as Σ w_j · lag of (n / n_max)^p with time constant τ_j, found by ridge regression."""

    channel: str  #: The channel of the speed
    exponent: float  #: p
    tau_s: Vector  #: (n_lags,): Time constants tried [s]; 0 = follows at once
    weights: Vector  #: (n_lags,): w_j [unit of the response]
    share: float  #: Part of the simulated course that only the speed explains, 0 to 1

    def course(self, comparison: Comparison, source: Vector) -> Vector:
        """What the simulation would make of another source, in place of (n / n_max)^p."""
        result = np.zeros(len(source))
        for tau_s, weight in zip(self.tau_s, self.weights, strict=True):
            result += weight * lagged(comparison, source, float(tau_s))
        return result

    def cooled_course(
        self, comparison: Comparison, source: Vector, gate: Vector, extra_per_s: float | None, share: float
    ) -> Vector:
        """The same when every mode loses heat faster while the `gate` (0 to 1) is open.

        By `extra_per_s` [1/s] in every mode alike, or if that is None by the part `share` of its own rate.
        """
        result = np.zeros(len(source))
        for tau_s, weight in zip(self.tau_s.tolist(), self.weights, strict=True):
            extra = share / max(tau_s, 1e-300) if extra_per_s is None else extra_per_s
            result += weight * (cooled(comparison, source, gate, tau_s, extra) if tau_s > 0.0 else source)
        return result

    @property
    def typical_s(self) -> float:
        """The time constant about which the weights lie: their mean logarithm [s]."""
        slow = self.tau_s > 0.0
        size = np.abs(self.weights[slow])
        return float(np.exp(np.sum(size * np.log(self.tau_s[slow])) / max(float(size.sum()), 1e-300)))


@lru_cache(maxsize=32)
def spindle_law(comparison: Comparison, response: str) -> SpindleLaw | None:
    """The law of speed in the simulated course of this response; None without a speed, or if it knows none."""
    name = sources(comparison, response).spindle
    target = simulated_rise(comparison, response)
    if name is None or float(np.std(target)) <= 0.0:
        return None
    others, warmth, rows = _surroundings(comparison, response), warm_starts(comparison, response), _every(comparison)
    if np.any(warmth):
        # what has risen since a warm start is less than what was there, and what is left of that falls
        left = [warmth * np.exp(-comparison.time_s / tau_s) for tau_s in time_constants(comparison, _OTHER_LAGS)]
        others = np.column_stack([others, warmth, *left])
    without = float(np.mean((target[rows] - others[rows] @ _ridge(others[rows], target[rows])) ** 2))
    tau_s = np.concatenate([[0.0], time_constants(comparison, _OWN_LAGS)])
    tried = {p: _fit(comparison, name, p, tau_s, others, target) for p in EXPONENTS}
    best = _between({p: misfit for p, (misfit, _) in tried.items()})
    misfit, weights = _fit(comparison, name, best, tau_s, others, target)
    if without <= 0.0 or misfit > 0.5 * without:
        return None
    return SpindleLaw(name, best, tau_s, weights, 1.0 - misfit / without)


@lru_cache(maxsize=32)
def follows_sensors(comparison: Comparison, response: str) -> bool:
    """Whether the simulated course is a function of recorded temperatures at the same instant: a regression on them.

    Its steps from sample to sample then follow the sensors' noise and resolution, which no physical course does.
    """
    known = sources(comparison, response)
    names = [*known.machine, *known.hall, *known.coolant_temperatures][:_MOST_SENSORS]
    if not names:
        return False
    rises = [temperature_rise(comparison, name) for name in names]
    products = [a * b for k, a in enumerate(rises) for b in rises[k:]]
    within = np.diff(comparison.run_index) == 0
    steps = np.diff(np.column_stack([*rises, *products]), axis=0)[within]
    target = np.diff(simulated_rise(comparison, response))[within]
    if len(target) < 4 * steps.shape[1]:
        return False
    left = target - steps @ np.linalg.lstsq(steps, target, rcond=None)[0]
    return bool(np.sum(left**2) < _LEFT_BY_SENSORS * np.sum(target**2))


@dataclass(frozen=True, eq=False)
class RiseParts:
    """A recorded temperature's rise [K], without the steps of its resolution."""

    #: Without what hall, coolant and other sources explain; what follows the speed, or with no speed recorded the
    #: simulated course, stays in it
    of_spindle: Vector
    calm: Vector  #: What the recorded sources explain as it is, the rest as its mean over half an hour
    unaccounted: Vector  #: What neither the spindle nor hall nor coolant explains, calm
    unaccounted_share: float  #: Its share of variance


@lru_cache(maxsize=64)
def rise_parts(comparison: Comparison, response: str, name: str) -> RiseParts:
    """What a recorded temperature's rise since the start of its run is made of."""
    values = temperature_rise(comparison, name)
    spindle = _spindle_columns(comparison, response)
    others = np.column_stack([_surroundings(comparison, response), *_cooled_by_coolant(comparison, response)])
    rows = _every(comparison)
    coefficients = _ridge(np.column_stack([spindle, others])[rows], values[rows])
    by_spindle = spindle @ coefficients[: spindle.shape[1]]
    by_others = others @ coefficients[spindle.shape[1] :]
    free = values - by_spindle - by_others
    samples = max(3, round(_CALM_S / comparison.period_s) | 1)
    calm = by_run(comparison, lambda part: uniform_filter1d(part, samples, mode="nearest"), free)
    variance = float(np.var(values))
    share = float(np.var(calm)) / variance if variance > 0.0 else 0.0
    return RiseParts(by_spindle + calm, by_spindle + calm + by_others, calm, share)


@lru_cache(maxsize=32)
def _spindle_columns(comparison: Comparison, response: str) -> Matrix:
    """Lags of two powers of the speed, convection with it; with no speed, lags of the simulated courses."""
    name = sources(comparison, response).spindle
    taus = time_constants(comparison, 6)
    if name is None:
        courses = [simulated_rise(comparison, other) for other in comparison.responses]
        return np.column_stack([lagged(comparison, c, float(t)) for c in courses for t in (0.0, *taus)])
    linear = speed_power(comparison, name, 1.0)
    columns = [lagged(comparison, speed_power(comparison, name, p), float(t)) for p in (1.0, 2.0) for t in taus]
    columns += [lagged(comparison, linear * lagged(comparison, linear, float(t)), float(t)) for t in taus[1::2]]
    return np.column_stack(columns)


def _cooled_by_coolant(comparison: Comparison, response: str) -> list[Vector]:
    """What coolant takes of the warmth that the spindle brings: lags of its product with lags of the speed."""
    known = sources(comparison, response)
    warm = (
        simulated_rise(comparison, response) if known.spindle is None else speed_power(comparison, known.spindle, 1.0)
    )
    return [
        lagged(comparison, switched_on(comparison, name) * lagged(comparison, warm, float(tau_s)), float(tau_s))
        for name in known.coolant_switches
        for tau_s in time_constants(comparison, 6)[1::2]
    ]


@lru_cache(maxsize=32)
def warm_starts(comparison: Comparison, response: str) -> Vector:
    """How much farther apart the machine's sensors were at the start of a run than at the calmest start [K], (n_rows,).

    0 in all rows where no run began with them apart by more than a kelvin.
    """
    names, result = sources(comparison, response).machine, np.zeros(len(comparison.time_s))
    if len(names) < 2:
        return result
    for _, rows in comparison.rows_of_runs():
        first = [comparison.recorded[name][rows][:5] for name in names]
        seen = [float(np.nanmedian(part)) for part in first if np.isfinite(part).any()]
        result[rows] = np.ptp(seen) if len(seen) == len(names) else np.nan
    apart = np.nan_to_num(result - np.nanmin(result)) if np.isfinite(result).any() else 0.0 * result
    return apart if apart.max() > _WARM_START_K else np.zeros(len(apart))


@lru_cache(maxsize=32)
def off_starts(comparison: Comparison, response: str) -> Vector:
    """How much farther a temperature was from its simulated course at the start of its run than mostly [K], (n_rows,).

    0 in all rows where that is little beside how far it moves, and of displacements, which count from there.
    """
    difference = comparison.difference(response) - np.nanmedian(comparison.difference(response))

    def first(part: Vector) -> Vector:
        seen = part[:_FIRST][np.isfinite(part[:_FIRST])]
        return np.full(len(part), float(np.median(seen)) if len(seen) else 0.0)

    off = by_run(comparison, first, difference)
    is_far = float(np.abs(off).max()) > _FAR * float(np.nanstd(comparison.recorded[response]))
    return off if is_far and comparison.channel(response).role == "temperature" else np.zeros(len(off))


@lru_cache(maxsize=32)
def _surroundings(comparison: Comparison, response: str) -> Matrix:
    """Lags of the hall, the coolant and other sources, and a constant: what else a course may follow."""
    known = sources(comparison, response)
    taus = (0.0, *time_constants(comparison, _OTHER_LAGS))
    courses = [temperature_rise(comparison, name) for name in (*known.hall, *known.coolant_temperatures)]
    courses += [switched_on(comparison, name) for name in known.coolant_switches]
    courses += [heats(comparison, name)[0][1] for name in known.other_heat[:6]]
    columns = [lagged(comparison, values, float(tau_s)) for values in courses for tau_s in taus]
    return np.column_stack([np.ones(len(comparison.time_s)), *columns])


def _fit(
    comparison: Comparison, name: str, exponent: float, tau_s: Vector, others: Matrix, target: Vector
) -> tuple[float, Vector]:
    source = speed_power(comparison, name, exponent)
    rows = _every(comparison)
    own = np.column_stack([lagged(comparison, source, float(tau))[rows] for tau in tau_s])
    design = np.column_stack([own, others[rows]])
    coefficients = _ridge(design, target[rows])
    misfit = float(np.mean((target[rows] - design @ coefficients) ** 2))
    return misfit, coefficients[: len(tau_s)]


def _ridge(design: Matrix, target: Vector) -> Vector:
    """Coefficients drawn to 0 a little: lags of near time constants are nearly the same course."""
    size = np.sqrt(np.mean(design**2, axis=0))
    size[size <= 0.0] = 1.0
    unit = design / size
    gram = unit.T @ unit
    gram[np.diag_indices_from(gram)] += _RIDGE * len(target)
    return np.asarray(np.linalg.solve(gram, unit.T @ target) / size)


def _every(comparison: Comparison) -> slice:
    return slice(None, None, max(1, len(comparison.time_s) // _MOST_ROWS))


def _between(misfits: dict[float, float]) -> float:
    """The exponent of least misfit, by a parabola through the logarithms of the best and its neighbours."""
    powers = sorted(misfits)
    k = min(range(len(powers)), key=lambda j: misfits[powers[j]])
    if not 0 < k < len(powers) - 1:
        return powers[k]
    x = np.array(powers[k - 1 : k + 2])
    y = np.sqrt([misfits[p] for p in x])
    a, b, _ = np.polyfit(x - x[1], y, 2)
    return float(np.clip(x[1] - b / (2.0 * a), x[0], x[2])) if a > 0.0 else powers[k]
