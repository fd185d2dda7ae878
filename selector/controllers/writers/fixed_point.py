"""C99 in whole numbers, for processors and PLC ladders without floating point: the model with a smaller guard.

Readings come in counts (1/1000 °C), times in ms, corrections go out in nm. The model is that of
`fixed_point_numbers`, whose bound of the difference to the float64 model is printed at the head of the files.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from selector.controllers.model_file import ModelFile
from selector.controllers.program.text_of_program import plain
from selector.controllers.writers.fixed_point_numbers import FRACTION_BITS, Fixed, counts_of, fixed
from selector.controllers.writers.fixed_point_sensor import NAME
from selector.controllers.writers.fixed_point_source import Source
from selector.controllers.writers.heading import heading
from selector.findings import Finding


def fixed_point_files(model: ModelFile, *, is_sign_verified: bool) -> dict[str, str]:
    """``thermal_correction_i.h`` and ``.c``.

    Raises
    ------
    ExportRefusedError
        Something does not fit into 32 or 64 bits; the message says what.
    """
    source = Source(model)
    head = [f" * {line}" for line in [*heading(model, is_sign_verified=is_sign_verified), *_about(model, source.fixed)]]
    return {
        f"{NAME}.h": "\n".join(["/*", *head, " */", *source.header()]) + "\n",
        f"{NAME}.c": "\n".join(["/*", *head, " */", *source.body()]) + "\n",
    }


def fixed_point_bound_um(model: ModelFile, *, is_counted: bool = False) -> dict[str, float]:
    """Per output, what the correction can differ at most from the float64 model [µm], inside the valid ranges.

    The rounding of readings to counts is part of it, unless `is_counted`: readings are whole counts already. The
    guard's dead band and slew limit are not: they act on either result.
    """
    errors = fixed(model).errors_nm
    # rounded upwards, so that the float is a bound, too
    return {
        name: math.nextafter(float((e.arithmetic if is_counted else e.whole) / 1000), math.inf)
        for name, e in errors.items()
    }


def fixed_point_findings(model: ModelFile) -> tuple[Finding, ...]:
    """The bound per output, and what of the guard the fixed-point program does not have."""
    counted = fixed_point_bound_um(model, is_counted=True)
    found = [
        Finding(
            "fixed-point-bound",
            "info",
            f"{name}: the fixed-point program differs from the model by at most {bound:.2g} µm inside the valid "
            f"ranges, {counted[name]:.2g} µm of it by its own arithmetic.",
            evidence={"output": name, "bound_um": bound, "arithmetic_bound_um": counted[name]},
        )
        for name, bound in fixed_point_bound_um(model).items()
    ]
    left_out = list(_left_out(model))
    if left_out:
        found.append(
            Finding(
                "guard-reduced",
                "warning",
                f"The fixed-point program has a smaller guard than the model file asks for: {'; '.join(left_out)}.",
                evidence={"left_out": left_out},
                suggestion="use the double- or single-precision program where the processor has floating point",
            )
        )
    return tuple(found)


def _left_out(model: ModelFile) -> Iterator[str]:
    guard = model.guard
    if model.fallbacks and guard.on_fault == "fallback":
        yield f"no fallback models, with a bad sensor it does '{guard.without_fallback}'"
    if guard.stuck_after_s is not None:
        yield "a sensor that stands still is not found"


def _about(model: ModelFile, numbers: Fixed) -> Iterator[str]:
    yield "Whole numbers only. Times in ms, corrections in nm, slopes in nm/m, positions in um."
    for counted in numbers.inputs.values():
        item = counted.item
        yield plain(f"{item.name}: {counts_of(counted)}, valid {counted.low} ... {counted.high} counts")
    for (source, tau_s), tau_ms in numbers.taus_ms.items():
        yield plain(f"memory of {source} over {tau_s:g} s: {tau_ms} ms, resolution 2^-{FRACTION_BITS} counts")
    for name, bound in fixed_point_bound_um(model).items():
        own = fixed_point_bound_um(model, is_counted=True)[name]
        yield plain(f"Largest difference to the float64 model inside the valid ranges: {name} {_above(bound)} um,")
        yield f"  {_above(own)} um of it for readings that are whole counts."
    yield "No intermediate value passes 63 bits; proven for all readings when this file was written."
    for line in _left_out(model):
        yield plain(f"Left out: {line}.")


def _above(bound_um: float) -> str:
    return f"{math.ceil(bound_um * 1e5) / 1e5:.5f}"
