"""What custom macro B lacks of the guard and of the model, for the head of the program and for its findings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from selector.controllers.model_file import ModelFile
from selector.controllers.self_check import output_bound_um
from selector.findings import Finding


def on_fault(model: ModelFile) -> str:
    """What the macro does with a bad sensor."""
    guard = model.guard
    return guard.without_fallback if guard.on_fault == "fallback" else guard.on_fault


def left_out_of_macro(model: ModelFile, has_begun: int) -> Iterator[str]:
    """What the macro does not do, for its head and its finding."""
    guard = model.guard
    if any(item.rate_limit_per_min is not None for item in model.inputs):
        yield "a reading that jumps is not found"
    if guard.stuck_after_s is not None:
        yield "a sensor that stands still is not found"
    if len(model.inputs) > 1:
        yield "while one sensor is bad or has to recover, all wait"
    if guard.on_fault == "fallback":
        yield f"no fallback models, with a bad sensor it does {guard.without_fallback}"
    if guard.hold_at_most_s is not None and on_fault(model) == "hold":
        yield "it holds the last value for ever"
    if any(item.reference == "rise" for item in model.inputs):
        yield "a control that was off for less than 10 minutes is not noticed, the time counts as a call"
    if guard.restart == "new-start" or guard.new_start_after_s is not None:
        yield f"new start readings only with #{has_begun} = 0"
    for output in model.outputs:
        if output.position is not None:
            yield f"position-dependent part of {output.name}: the work offset is the same at every position"
    yield "it does not know whether the drives are on and the axis is referenced"


def findings_of_macro(model: ModelFile, left_out: Sequence[str]) -> Iterator[Finding]:
    """What is left out of the guard, and of the model."""
    yield Finding(
        "guard-reduced",
        "warning",
        f"Custom macro B has a smaller guard than the model file asks for: {'; '.join(left_out)}.",
        evidence={"left_out": list(left_out)},
        suggestion="let the program that feeds the temperatures watch the sensors, or run the whole model there",
    )
    for output in model.outputs:
        if output.position is not None:
            without = output.model_copy(update={"position": None})
            lost_um = output_bound_um(model, output) - output_bound_um(model, without)
            yield Finding(
                "position-part-left-out",
                "warning",
                f"{output.name}: the external work offset cannot follow the position; up to {lost_um:.3g} µm at the "
                "far end of the axis are not corrected.",
                evidence={"output": output.name, "lost_um": lost_um},
                suggestion="use the offset near the reference position only, or a control with a slope of its own",
            )
