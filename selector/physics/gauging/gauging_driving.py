"""What would the gauge have shown in recorded runs, driven by their allowance or feed at its time stamps."""

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from selector.errors import InputError, OptionError
from selector.findings import Finding, Where
from selector.physics.channel_differences import as_recorded, clock_jitter
from selector.physics.checks import errors_name, require_within
from selector.physics.gauging.finding_table import FINDINGS
from selector.physics.gauging.gauging_model import (
    ALLOWANCE,
    FEED,
    GAUGE,
    MEASURED,
    STAGE,
    UM_PER_S,
    GaugingModel,
    GaugingSimulation,
    model_findings,
    recorded_channels,
    undecided_findings,
)
from selector.physics.gauging.model_file import MOST_ALLOWANCE_UM, finest_s
from selector.physics.gauging.transducer import Noise, Surface, wear_share
from selector.physics.simulation_kind import Progress, unheard
from selector.recording import Recording
from selector.types import Vector

MOST_POINTS = 20_000_000


def voltage_course(
    voltage_at: Callable[[Vector], Vector],
    filter_s: float,
    time_s: Vector,
    allowance_um: Vector,
    surface: Surface,
    finest_s: float,
    noise: Noise | None = None,
    random: np.random.Generator | None = None,
) -> Vector:
    """Smoothed voltage at the samples of an allowance that goes straight from one to the next [V].

    It begins as if the first allowance had stood for long. What the filter is fed goes straight between points of an
    even grid, which is the samples and others between them, at most `finest_s` [s] apart; grooves count by the part of
    the way around each of them that they take.

    `voltage_at` is the characteristic, `filter_s` T_Φ [s]; the surface is at angle 0 when it begins, `random` draws the
    noise.

    Raises InputError: the grid would have more than 20 million points.
    """
    span_s, intervals = float(time_s[-1] - time_s[0]), len(time_s) - 1
    finer = max(1, math.ceil(span_s / intervals / finest_s))
    if finer * intervals > MOST_POINTS:
        raise InputError(
            f"{span_s:.3g} s of which every {finest_s:.3g} s counts",
            expected=f"at most {MOST_POINTS} steps of the calculation",
            where="recorded course",
            advice="cut the recording to the parts that were ground",
        )
    grid_s = time_s[0] + span_s * np.arange(finer * intervals + 1) / (finer * intervals)
    allowance = np.interp(grid_s, time_s, allowance_um)
    step_s = span_s / (finer * intervals)
    turn = (grid_s - time_s[0]) * surface.workpiece_rpm / 60.0
    met = allowance + surface.runout_um * np.sin(2 * math.pi * turn)
    if noise is not None and random is not None and noise.sd_um > 0:
        # R(τ) = D·exp(−β·|τ|) at even times, exact
        drawn = random.standard_normal(len(grid_s)) * noise.sd_um
        drawn[1:] *= math.sqrt(-math.expm1(-2.0 * noise.rate_per_s * step_s))
        met += lfilter([1.0], [1.0, -math.exp(-noise.rate_per_s * step_s)], drawn)
    fed, began = voltage_at(met), float(voltage_at(allowance[:1])[0])
    if surface.grooves > 0:
        # which part of the way around each point, half a step to either side, lies in grooves
        half = 0.5 * (turn[1] - turn[0])
        edges = surface.grooves * np.append(turn - half, turn[-1] + half)
        passed = np.floor(edges) * surface.groove_share + np.minimum(np.mod(edges, 1.0), surface.groove_share)
        share, deep = np.diff(passed) / (2.0 * half * surface.grooves), voltage_at(met - surface.groove_depth_um)
        fed = fed + share * (deep - fed)
        began += surface.groove_share * (float(voltage_at(allowance[:1] - surface.groove_depth_um)[0]) - began)
    return np.interp(time_s, grid_s, _smoothed(fed, step_s / filter_s, began))


def _smoothed(fed: Vector, share: float, began: float) -> Vector:
    """The filter on an input that goes straight over steps of so many of its time constants; exact."""
    keep = math.exp(-share)
    late = 1.0 + math.expm1(-share) / share if share > 1e-5 else 0.5 * share
    early = 1.0 - keep - late
    pushed = early * fed[:-1] + late * fed[1:]
    rest, _ = lfilter([1.0], [1.0, -keep], pushed, zi=[keep * began])
    return np.concatenate([[began], rest])


#: Share of what the gauge can show that its ends are taken for: beyond its reach it says nothing of the allowance.
_REACH = 0.02
_FINER = 4


def fallen_um(model: GaugingModel, time_s: Vector, feed_mm_per_min: Vector) -> Vector:
    """What is ground off under a recorded feed, held from sample to sample, as wheel and springs of the file follow it.

    Shape of `time_s` [µm].
    """
    grinding = model.values.grinding
    feed = np.maximum(feed_mm_per_min, 0.0) * UM_PER_S
    rate = feed / (1.0 + wear_share(grinding))
    steps, lag_s = np.diff(time_s), grinding.lag_s
    if lag_s == 0:
        return np.concatenate([[0.0], np.cumsum(rate[:-1] * steps)])
    removal, fallen = 0.0, np.zeros(len(time_s))
    for k, (step_s, wanted) in enumerate(zip(steps.tolist(), rate[:-1].tolist(), strict=True)):
        left = np.exp(-step_s / lag_s)
        fallen[k + 1] = fallen[k] + wanted * step_s + (removal - wanted) * lag_s * (1.0 - left)
        removal = wanted + (removal - wanted) * left
    return fallen


def start_um(model: GaugingModel, time_s: Vector, fallen: Vector, shown_um: Vector | None) -> float | None:
    """The allowance at the start that a recorded gauge says, `shown_um` being what it measured [µm].

    While it first is within its reach, for a time T_Φ or a turn: what it measured, and what was ground off until then
    as its filter has it. None: nothing was recorded of it, or never within its reach.
    """
    if shown_um is None:
        return None
    known, curve = np.isfinite(shown_um), model.characteristic
    if curve is not None:
        least, most = curve.monotone_um
        room = _REACH * (most - least)
        known &= (shown_um > least + room) & (shown_um < most - room)
    if not known.any():
        return None
    made = model.values
    # grooves that are deeper than the gauge reaches have no mean in µm
    surface = made.surface if curve is None else Surface()
    behind = voltage_course(lambda um: um, made.filter_s, time_s, -fallen, surface, finest_s(made) / _FINER)
    turn_s = 60.0 / surface.workpiece_rpm if surface.workpiece_rpm > 0 else 0.0
    first_s = float(time_s[np.argmax(known)])
    early = known & (time_s <= first_s + max(made.filter_s, turn_s))
    return float(np.mean(shown_um[early] - behind[early]))


_GAP = 1.5

_PER_NOISE = 0.25  #: Longest step of the calculation with noise, in 1/β.
_MOST_MM_PER_MIN = 1e6


def driven_runs(
    model: GaugingModel, recording: Recording, *, seed: int | None = None, progress: Progress = unheard
) -> GaugingSimulation:
    """What the gauge shows of every run of a recording: voltage, size, and which stage it would be in.

    The recorded allowance, or size counted from the nominal one, drives it; `recorded_channels` finds
    it. Where only the feed was recorded, the allowance begins at what the recorded gauge says, else at the mean one of
    the file, and falls as the file says of wheel and lag. The surface begins at angle 0. The stage is what the model's
    relay would have commanded, without its noise; nothing follows from it. Without a `seed` there is no noise.

    Raises InputError: the recording cannot drive this model: nothing that drives it, values that no workpiece has.
    """
    found = recorded_channels(model.file, recording)
    drives = "allowance" if "allowance" in found else "feed"
    if drives not in found:
        raise _nothing_drives(model, recording)
    out = {"allowance": ALLOWANCE, "gauge": GAUGE, "measured": MEASURED, "stage": STAGE}
    out |= {"feed": FEED} if drives == "feed" else {}
    sources = np.random.SeedSequence(seed).spawn(len(recording.runs)) if seed is not None else ()
    tables: dict[str, pd.DataFrame] = {}
    findings = list(model_findings(model))
    for number, run in enumerate(recording.runs):
        progress(number, len(recording.runs), run)
        with errors_name(f"run {run}, channel {found[drives]}"):
            time_s = recording.time_s(run)
            values, said = _complete(recording, run, found[drives])
            allowance = values
            if drives == "feed":
                allowance, begun = _by_feed(model, recording, run, found, values)
                said.append(begun)
            random = np.random.default_rng(sources[number]) if sources else None
            voltage = _shown_v(model, time_s, allowance, random)
        findings += said
        # the relay compares the peaks of the ripple, those on a whole surface
        compared = voltage if model.crest is None else voltage + model.crest.crest_at(allowance, model.values.filter_s)
        passed = np.searchsorted(model.setup.thresholds_v, np.maximum.accumulate(compared), side="right")
        columns = {
            "allowance": allowance,
            "gauge": voltage,
            "measured": model.measured_um(voltage),
            "stage": np.where(passed < len(model.setup.thresholds_v), passed + 1.0, 0.0),
            "feed": values,
        }
        tables[run] = pd.DataFrame(
            {channel.name: columns[kind] for kind, channel in out.items()}, index=pd.Index(time_s, name="time_s")
        )
    findings += undecided_findings(recording, found)
    if not {"gauge", "measured"} & set(found):
        findings.append(
            FINDINGS.finding(
                "output-not-recorded",
                "Nothing that the gauge shows was recorded, so nothing can be compared.",
                evidence={"channels": list(recording.names)},
                suggestion="name its channels under [recorded]: gauge for the voltage, measured for the size",
                level="warning",
            )
        )
    about: dict[str, dict[str, float]] = {run: {} for run in recording.runs}
    simulated = Recording.from_runs(tables, tuple(out.values()), model.provenance(seed, about))
    names = {channel.name: found[kind] for kind, channel in out.items() if kind in found}
    names |= {STAGE.name: STAGE.name} if STAGE.name in recording.names else {}
    simulated = as_recorded(simulated, recording, names)
    return GaugingSimulation(simulated, {}, None, None, tuple(findings), (found[drives],), found)


def _shown_v(model: GaugingModel, time_s: Vector, allowance_um: Vector, random: np.random.Generator | None) -> Vector:
    made, curve, linear = model.values, model.characteristic, model.values.linear

    def voltage_at(seen_um: Vector) -> Vector:
        if curve is not None:
            return curve.voltage_at(seen_um)
        return linear.bias_v + linear.gain_v_per_um * seen_um if linear is not None else seen_um

    finest = finest_s(made) / _FINER
    if random is not None and made.noise.sd_um > 0:
        finest = min(finest, _PER_NOISE / made.noise.rate_per_s)
    return voltage_course(voltage_at, made.filter_s, time_s, allowance_um, made.surface, finest, made.noise, random)


def _complete(recording: Recording, run: str, channel: str) -> tuple[Vector, list[Finding]]:
    """Values at all samples, straight over what is missing, and what is to be said of clock and gaps."""
    time_s, values = recording.time_s(run), np.asarray(recording.values(run, [channel])[:, 0], dtype=np.float64)
    of = recording.channel(channel)
    require_within(values, time_s, MOST_ALLOWANCE_UM if of.unit == ALLOWANCE.unit else _MOST_MM_PER_MIN, of.unit)
    seen = np.isfinite(values)
    if np.count_nonzero(seen) < 2:
        raise InputError(
            f"{np.count_nonzero(seen)} values",
            expected="at least two",
            where="recorded course",
            advice="leave this run out, or give the channel its values",
        )
    found = list(_clock(run, channel, time_s))
    if not seen.all():
        missing = np.flatnonzero(~seen)
        found.append(
            FINDINGS.finding(
                "recorded-gap",
                f"{len(missing)} of {len(seen)} values of {channel} are missing in {run}, the first at "
                f"{time_s[missing[0]] - time_s[0]:.6g} s: it was taken to go straight, and beyond its ends to stay.",
                Where(channel=channel, run=run),
                {"missing": len(missing), "of": len(seen)},
                "do not trust what the gauge shows there, or cut the run to the stretch that is complete",
            )
        )
        values = np.interp(time_s, time_s[seen], values[seen])
    return values, found


def _clock(run: str, channel: str, time_s: Vector) -> Iterator[Finding]:
    steps = np.diff(time_s)
    period_s = float(np.median(steps))
    gaps = np.flatnonzero(steps > _GAP * period_s)
    where = Where(channel=channel, run=run)
    if len(gaps):
        longest = int(gaps[np.argmax(steps[gaps])])
        yield FINDINGS.finding(
            "recorded-gap",
            f"The clock of {run} has {len(gaps)} gaps, the longest of {steps[longest]:.4g} s at "
            f"{time_s[longest] - time_s[0]:.6g} s, where others are {period_s:.4g} s: {channel} was taken to go "
            "straight over them.",
            where,
            {"gaps": len(gaps), "longest_s": float(steps[longest]), "period_s": period_s},
            "do not trust what the gauge shows after them for some times T_Φ",
        )
        return
    stray = float(np.abs(time_s - np.linspace(time_s[0], time_s[-1], len(time_s))).max() / period_s)
    yield from clock_jitter(stray, f"{channel} was taken at its own times, straight between them", where)


def _by_feed(
    model: GaugingModel, recording: Recording, run: str, found: Mapping[str, str], feed: Vector
) -> tuple[Vector, Finding]:
    """The allowance under a recorded feed, from where the recorded gauge says that it began, else the file."""
    time_s, of_file_um = recording.time_s(run), model.values.grinding.allowance_um
    channel = found.get("gauge", found.get("measured"))
    shown: Vector | None = None
    if channel is not None:
        shown = recording.values(run, [channel])[:, 0]
        shown = model.measured_um(shown) if "gauge" in found else shown
    fallen = fallen_um(model, time_s, feed)
    begins_um = start_um(model, time_s, fallen, shown)
    if begins_um is None:
        return of_file_um - fallen, FINDINGS.finding(
            "start-from-file",
            f"Of {run} the feed was recorded, and neither the allowance nor what the gauge showed within its reach: "
            f"the allowance begins at {of_file_um:.4g} µm, the mean of the model file.",
            Where(run=run),
            {"begins_um": of_file_um},
        )
    return begins_um - fallen, FINDINGS.finding(
        "start-from-gauge",
        f"Of {run} the feed was recorded and no allowance: it begins at {begins_um:.4g} µm, as {channel} says at "
        f"first (the mean of the model file is {of_file_um:.4g} µm).",
        Where(channel=channel, run=run),
        {"begins_um": begins_um, "of_file_um": of_file_um},
    )


def _nothing_drives(model: GaugingModel, recording: Recording) -> OptionError:
    here = ", ".join(f"{channel.name} ({channel.role}, {channel.unit})" for channel in recording.channels[:12])
    lengths = [channel.name for channel in recording.channels if channel.unit == ALLOWANCE.unit]
    name = lengths[0] if lengths else "NAME OF ITS COLUMN"
    return OptionError(
        f"nothing that drives the gauge: {here}",
        expected="a channel with the allowance, counted from the nominal size, or one with the feed",
        where=f"model {model.name!r}",
        advice=f'say which in the model file, whatever role it has: allowance = "{name}" under [recorded]; or feed = '
        '"…" there',
    )
