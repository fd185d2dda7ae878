"""Which responses froze beyond doubt: their noise is gone for longer than chance allows, whatever the residual says."""

from __future__ import annotations

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data.places import duration
from selector.diagnosis.effects.data.stuck import frozen_stretches
from selector.diagnosis.shapes.input_faults import InputFault
from selector.diagnosis.shapes.signals import filled


def frozen_responses(comparison: Comparison) -> tuple[InputFault, ...]:
    """Frozen stretches of responses, fitted and held-out runs; equal readings prove them, so no test is needed."""
    faults = []
    for name in comparison.responses:
        expected = filled(comparison, comparison.simulated[name])
        for run, first, last in frozen_stretches(comparison, name, surely=True):
            here = np.zeros(len(expected), dtype=bool)
            here[first : last + 1] = True
            from_s, to_s = float(comparison.time_s[first]), float(comparison.time_s[last])
            reading = float(comparison.recorded[name][first])
            faults.append(
                InputFault(
                    id="data.stuck",
                    channel=name,
                    run=run,
                    from_s=from_s,
                    to_s=to_s,
                    statement=f"{name} in run {run} stands at {reading:.6g} for {duration(to_s - from_s)} from "
                    f"{duration(from_s)} on: {last - first + 1} equal samples, though it is never silent elsewhere.",
                    sure=True,
                    evidence={"samples": last - first + 1, "value": reading},
                    course=np.where(here, reading - expected, 0.0),
                )
            )
    return tuple(faults)
