"""Which numbers of a gauging model file has no gauge and no grinding machine: slips of units."""

from __future__ import annotations

from collections.abc import Mapping

from selector.physics.model_plausibility import UsualRange

_SECONDS = {"ms": 1e-3, "µs": 1e-6}
_GAP = UsualRange(2e-5, 1e-2, {"mm": 1e-3, "µm": 1e-6})
_SIZE = {"mm": 1e3, "nm": 1e-3, "m": 1e6}

USUAL: Mapping[str, UsualRange] = {
    "electromagnet.voltage_v": UsualRange(0.5, 500.0, {"kV": 1e3, "mV": 1e-3}),
    "electromagnet.frequency_hz": UsualRange(5.0, 5e3, {"kHz": 1e3, "1/min": 1 / 60}),
    "electromagnet.resistance_ohm": UsualRange(0.5, 1e5, {"kΩ": 1e3, "mΩ": 1e-3}),
    "electromagnet.inductance_h": UsualRange(1e-5, 50.0, {"mH": 1e-3, "µH": 1e-6}),
    "electromagnet.gap_m": _GAP,
    "probe.mass_kg": UsualRange(1e-4, 1.0, {"g": 1e-3}),
    "probe.stiffness_n_per_m": UsualRange(20.0, 1e7, {"N/mm": 1e3, "N/µm": 1e6}),
    "generator.gap_m": _GAP,
    "generator.turns": UsualRange(5.0, 1e5, {}),
    "generator.flux_wb": UsualRange(1e-8, 1e-2, {"mWb": 1e-3, "µWb": 1e-6}),
    "generator.time_constant_s": UsualRange(0.0, 1.0, _SECONDS),
    "smoothing.time_constant_s": UsualRange(1e-3, 5.0, _SECONDS),
    "linear.time_constant_s": UsualRange(1e-3, 5.0, _SECONDS),
    "linear.gain_v_per_um": UsualRange(2e-4, 2.0, {"mV/µm": 1e-3, "V/mm": 1e-3, "V/nm": 1e3, "V/m": 1e-6}),
    "transducer.rest_gap_m": UsualRange(0.0, 3e-3, {"µm": 1e-6, "mm": 1e-3}),
    "relay.delay_s": UsualRange(0.0, 0.5, _SECONDS),
    "relay.noise_v": UsualRange(0.0, 1.0, {"mV": 1e-3}),
    "relay.noise_hold_s": UsualRange(1e-5, 1.0, _SECONDS),
    "grinding.allowance_um": UsualRange(3.0, 3e3, _SIZE),
    "grinding.lag_s": UsualRange(0.0, 20.0, _SECONDS),
    "grinding.wheel_wear": UsualRange(0.0, 0.95, {"%": 0.01}),
    "stages.feed_um_per_s": UsualRange(0.3, 300.0, {"mm/min": 1e3 / 60, "µm/min": 1 / 60, "mm/s": 1e3, "m/s": 1e6}),
    "stages.until_um": UsualRange(0.0, 1e3, _SIZE),
    "surface.workpiece_rpm": UsualRange(2.0, 5e3, {"1/s": 60.0}),
    "surface.groove_depth_um": UsualRange(0.0, 3e4, {"nm": 1e-3}),
    "surface.runout_um": UsualRange(0.0, 200.0, {"nm": 1e-3}),
    "noise.sd_um": UsualRange(0.0, 20.0, {"nm": 1e-3}),
    "noise.rate_per_s": UsualRange(0.05, 1e5, {"1/ms": 1e3}),
    "tolerance.lower_um": UsualRange(0.05, 500.0, _SIZE),
    "tolerance.upper_um": UsualRange(0.05, 500.0, _SIZE),
}
"""Section and key of the file → what is usual."""
