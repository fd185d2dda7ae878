"""Which numbers of a gauging model file cannot be beside its others, most of them slips of units."""

from __future__ import annotations

from collections.abc import Iterator

from selector.physics.gauging.gauged_grinding import MOST_FEED_SD
from selector.physics.gauging.model_length import grinding_s
from selector.physics.gauging.model_parts import FileParts, file_parts
from selector.physics.gauging.model_schema import GaugingFile
from selector.physics.model_text import Contradiction

_SHORT = 0.5
_OF_FEED = "give it as a share of the feed, 0.05 for 5 %"


def slow_times(parts: FileParts) -> dict[str, float]:
    """Key of the file → time by which gauge or machine are late [s]."""
    gauge, relay = ("linear", "relay") if parts.transducer is None else ("transducer.smoothing", "transducer.relay")
    return {
        f"{gauge}.time_constant_s": parts.filter_s,
        f"{relay}.delay_s": parts.relay.delay_s,
        "grinding.lag_s": parts.grinding.lag_s,
    }


def early_slips(file: GaugingFile) -> Iterator[Contradiction]:
    """Slips that what the sections describe would refuse in words that lead nowhere."""
    grinding = file.grinding
    allowance_um, spread = float(grinding.allowance_um), float(grinding.feed_sd)  # type: ignore[attr-defined]
    stages = grinding.stages  # type: ignore[attr-defined]
    first_um = max((float(stage.until_um) for stage in stages), default=0.0)
    if 0 < allowance_um <= first_um < 1e3 * allowance_um:
        yield (
            ("grinding", "allowance_um"),
            f"allowance_um = {allowance_um:g}, and a stage ends at {first_um:g} µm",
            f"a start above {first_um:g} µm",
            f"write allowance_um = {1e3 * allowance_um:g} if {allowance_um:g} mm was meant, or sort the stages",
        )
    if spread > MOST_FEED_SD:
        meant = 0.01 * spread
        advice = f"write feed_sd = {meant:g}: {spread:g} % is {meant:g}" if meant <= MOST_FEED_SD else _OF_FEED
        expected = f"a share up to {MOST_FEED_SD:g}: with more some parts would not be fed at all"
        yield ("grinding", "feed_sd"), f"feed_sd = {spread:g}", expected, advice


def late_slips(file: GaugingFile) -> Iterator[Contradiction]:
    """Times that are longer than the grinding, and thresholds of a line that no part comes near."""
    parts = file_parts(file)
    yield from _of_times(parts)
    yield from _of_volts(file, parts)


def _of_times(parts: FileParts) -> Iterator[Contradiction]:
    lasts_s = grinding_s(parts, parts.grinding.allowance_um)
    for key, time_s in slow_times(parts).items():
        if time_s > lasts_s:
            name, meant = key.rsplit(".", 1)[-1], 1e-3 * time_s
            advice = (
                f"write {name} = {meant:g} if {time_s:g} ms was meant"
                if meant < _SHORT * lasts_s
                else "shorten it, or correct feeds and allowances"
            )
            yield (
                tuple(key.split(".")),
                f"{name} = {time_s:g} s, and the feeds take {lasts_s:.3g} s for the whole allowance",
                "a time that is short against the grinding, at most as long as it",
                advice,
            )


def _of_volts(file: GaugingFile, parts: FileParts) -> Iterator[Contradiction]:
    gauge, grinding, surface = parts.linear, parts.grinding, parts.surface
    if file.thresholds is None or gauge is None:
        return
    wanted_um, start_um = grinding.stages[-1].until_um, grinding.allowance_um
    # as far below the wanted size as the start is above it, and what grooves and run-out take off the reading
    least_um = 2.0 * wanted_um - start_um - surface.groove_depth_um - surface.runout_um
    low_v, high_v = (gauge.bias_v + gauge.gain_v_per_um * end for end in (start_um, least_um))
    for number, volts in enumerate(file.thresholds.volts):
        if low_v <= volts <= high_v:
            continue
        reached_um = (volts - gauge.bias_v) / gauge.gain_v_per_um
        advice = (
            f"write {1e-3 * volts:g} if {volts:g} mV was meant"
            if low_v <= 1e-3 * volts <= high_v
            else "correct it or bias_v, or leave [thresholds] out: they are then calculated (eq. 23)"
        )
        yield (
            ("thresholds", "volts", number),
            f"{volts:g} V, which the gauge shows at {reached_um:.6g} µm",
            f"{low_v:.5g} V, shown where grinding begins at {start_um:g} µm, to {high_v:.5g} V, far below the wanted "
            f"{wanted_um:g} µm",
            advice,
        )
