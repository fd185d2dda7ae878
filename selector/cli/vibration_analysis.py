"""How are the numbers of a simulated vibration told: the `vibration` object of the JSON, and tables on the screen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from selector.cli import showing
from selector.physics.vibration.vibration_summary import RELATIVE

if TYPE_CHECKING:
    from rich.console import Console

    from selector.physics.vibration.chain_error import Agreement, ChainAccuracy
    from selector.physics.vibration.modes import StructureModes
    from selector.physics.vibration.periodic_error import PeriodicError
    from selector.physics.vibration.vibration_model import VibrationModel
    from selector.physics.vibration.vibration_summary import VibrationSummary

_MOST_ROWS = 10
_LEAST_DB = 0.01
"""Difference below which nothing is told of it."""

_LEAST_UM = 1e-3
"""Below it a number is told with a power of ten."""

_FINALS = ("tool", "workpiece", RELATIVE)
_HEADS = ["tool", "workpiece", "tool − workpiece"]


def vibration_object(model: VibrationModel, summary: VibrationSummary) -> dict[str, Any]:
    """`vibration` of `selector.simulation/1`."""
    return {
        "method": model.file.run.method,
        "shaft_rpm": dict(summary.shaft_rpm),
        "split_hz": summary.split_hz,
        "modes": _modes(summary.modes),
        "lines": [
            {
                "frequency_hz": one.frequency_hz,
                "source": one.source,
                "shaft": one.shaft,
                "order": one.order,
                "force_n": one.force_n,
                "motion_um": dict(one.motion_um),
                "coupled_um": dict(one.coupled_um),
                "chains_um": dict(one.chains_um),
            }
            for one in summary.lines
        ],
        "amplitudes": {
            final: {
                "expected_um": one.expected_um if one.realisations else None,
                "mean_abs_um": one.mean_abs_um if one.realisations else None,
                "rms_um": one.rms_um,
                "largest_um": one.largest_um if one.realisations else None,
                "realisations": one.realisations,
                "sections": one.sections,
            }
            for final, one in summary.amplitudes.items()
        },
        "periodic_errors": [_error(one) for one in summary.errors],
        "heights": {
            kind: {
                "kinematic_um": one.kinematic_um,
                "rms_um": one.rms_um,
                "published_um": one.published_um,
                "frequencies": one.lines,
            }
            for kind, one in summary.heights.items()
        },
        "chains": [_accuracy(one) for one in summary.accuracy],
    }


def show_analysis(console: Console, model: VibrationModel, summary: VibrationSummary) -> None:
    """Modes, largest lines, expected amplitudes, heights by kind, and where the chains are off, as tables."""
    _show_modes(console, summary.modes)
    _show_lines(console, summary)
    rows = [
        (
            head,
            _number(one.expected_um if one.realisations else None),
            _number(one.rms_um),
            _number(one.largest_um if one.realisations else None),
        )
        for final, head in zip(_FINALS, _HEADS, strict=True)
        for one in [summary.amplitudes[final]]
    ]
    counts = summary.amplitudes[RELATIVE]
    over = f" over {counts.realisations} realisations of the phases" if counts.realisations else ""
    columns = ["motion", "expected amplitude", "rms", "largest amplitude"]
    console.print(showing.table(f"Motion, µm{over}", columns, rows, numeric=columns[1:]))
    if summary.errors:
        _show_errors(console, summary)
    if summary.accuracy:
        _show_chains(console, summary.accuracy)


def _show_modes(console: Console, modes: StructureModes) -> None:
    rows = [
        (
            float(modes.frequency_hz[k]),
            _number(2.0 * math.pi * float(modes.loss_factor[k])),
            ", ".join(_moving_most(modes, k)),
        )
        for k in range(min(_MOST_ROWS, len(modes.frequency_hz)))
    ]
    more = f", the lowest {_MOST_ROWS} of {len(modes.frequency_hz)}" if len(modes.frequency_hz) > _MOST_ROWS else ""
    columns = ["Hz", "psi", "moving most"]
    console.print(showing.table(f"Modes{more}", columns, rows, numeric=columns[:2]))


def _show_lines(console: Console, summary: VibrationSummary) -> None:
    ranked = sorted(summary.lines, key=lambda one: -one.motion_um[RELATIVE])[:_MOST_ROWS]
    has_chains = any(one.chains_um[RELATIVE] is not None for one in summary.lines)
    rows = [
        (
            one.source,
            one.frequency_hz,
            None if one.order is None else f"{one.order:.4g} × {one.shaft}",
            _number(one.force_n),
            *(_number(one.coupled_um[final]) for final in _FINALS),
            *([_number(one.chains_um[RELATIVE])] if has_chains else []),
        )
        for one in ranked
    ]
    heads = [*_HEADS, *(["by chains"] if has_chains else [])]
    columns = ["source", "Hz", "order", "N", *heads]
    title = "Largest lines, amplitudes in µm" if len(summary.lines) > _MOST_ROWS else "Lines, amplitudes in µm"
    numeric = ["Hz", "N", *heads]
    console.print(showing.table(title, columns, rows, numeric=numeric))


def _show_errors(console: Console, summary: VibrationSummary) -> None:
    kinds = [(one.kind, one.lines, _number(one.kinematic_um), _number(one.rms_um)) for one in summary.heights.values()]
    heads = ["kind", "frequencies", "copied motion", "W by the force"]
    console.print(showing.table("Heights by kind, µm", heads, kinds, numeric=heads[1:]))
    ranked = sorted(summary.errors, key=lambda one: -one.kinematic_um)[:_MOST_ROWS]
    rows = [
        (
            one.kind,
            ", ".join(one.sources),
            one.frequency_hz,
            _number(one.wavelength_mm),
            one.direction,
            _number(one.waves_per_revolution),
            _number(one.kinematic_um),
            _number(one.published_um),
        )
        for one in ranked
    ]
    columns = ["kind", "source", "Hz", "wavelength mm", "along", "waves per turn", "copied µm", "W µm"]
    numeric = ["Hz", "wavelength mm", "waves per turn", "copied µm", "W µm"]
    console.print(showing.table("Periodic errors, highest first", columns, rows, numeric=numeric))


def _show_chains(console: Console, accuracy: Sequence[ChainAccuracy]) -> None:
    worst = sorted(accuracy, key=lambda one: (one.published.share_within, -one.published.rms_db))[:_MOST_ROWS]
    rows = [
        (
            one.chain,
            one.source,
            one.final,
            f"{100 * one.published.share_within:.0f} %",
            _decibel(one.published),
            _number(one.published.largest_at_hz),
            _decibel(one.one_way),
            _decibel(one.cut_out),
        )
        for one in worst
    ]
    columns = ["chain", "source", "final", "within 10 %", "rms dB", "most at Hz", "one way dB", "cut out dB"]
    which = f", the {_MOST_ROWS} worst of {len(accuracy)}" if len(accuracy) > _MOST_ROWS else ""
    spans = [one.frequency_hz[[0, -1]] for one in accuracy]
    span = f"{min(one[0] for one in spans):.3g} to {max(one[1] for one in spans):.4g} Hz"
    title = f"Chains against the coupled structure, {span}{which}"
    console.print(showing.table(title, columns, rows, numeric=columns[3:]))


def _modes(modes: StructureModes) -> list[dict[str, Any]]:
    found = []
    for k, frequency in enumerate(modes.frequency_hz.tolist()):
        shape: list[complex] = modes.shapes[:, k].tolist()
        largest = max(shape, key=abs)
        found.append(
            {
                "frequency_hz": frequency,
                "loss_factor": float(modes.loss_factor[k]),
                "shape": {
                    name: [(part / largest).real, (part / largest).imag]
                    for name, part in zip(modes.members, shape, strict=True)
                },
            }
        )
    return found


def _moving_most(modes: StructureModes, k: int, most: int = 3) -> list[str]:
    """Members that move at least half as far as the one that moves most in a mode."""
    sizes = dict(zip(modes.members, (abs(part) for part in modes.shapes[:, k].tolist()), strict=True))
    ranked = sorted(sizes, key=lambda name: -sizes[name])
    return [name for name in ranked[:most] if sizes[name] >= 0.5 * sizes[ranked[0]]]


def _decibel(one: Agreement) -> str:
    return "0" if one.rms_db < _LEAST_DB else _number(one.rms_db)


def _number(value: float | None) -> str:
    """Three significant digits; a dash for what is not known."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0 or _LEAST_UM <= abs(value) < 1000:
        return f"{value:.3g}"
    digits, _, exponent = f"{value:.2e}".partition("e")
    return f"{value:.0f}" if 1000 <= abs(value) < 1e7 else f"{digits}e{int(exponent)}"


def _error(one: PeriodicError) -> dict[str, Any]:
    return {
        "frequency_hz": one.frequency_hz,
        "sources": list(one.sources),
        "kind": one.kind,
        "direction": one.direction,
        "wavelength_mm": one.wavelength_mm,
        "waves_per_revolution": one.waves_per_revolution,
        "advance": one.advance,
        "axial_wavelength_mm": one.axial_wavelength_mm,
        "amplitude_um": dict(one.amplitude_um),
        "force_n": dict(one.force_n),
        "height_um": dict(one.height_um),
        "published_um": one.published_um,
        "kinematic_um": one.kinematic_um,
        "realisations": one.realisations,
    }


def _accuracy(one: ChainAccuracy) -> dict[str, Any]:
    return {
        "chain": one.chain,
        "source": one.source,
        "final": one.final,
        "from_hz": float(one.frequency_hz[0]),
        "to_hz": float(one.frequency_hz[-1]),
        "published": _agreement(one.published),
        "one_way": _agreement(one.one_way),
        "cut_out": _agreement(one.cut_out),
    }


def _agreement(one: Agreement) -> dict[str, Any]:
    return {
        "share_within": one.share_within,
        "rms_db": one.rms_db,
        "largest_error": one.largest_error,
        "largest_at_hz": one.largest_at_hz,
        "bands_hz": [list(band) for band in one.bands_hz],
    }
