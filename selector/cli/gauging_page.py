"""What stands on the page of simulated gauging: parts in time, the chain's last strokes, numbers and their origin."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from selector.cli.parameter_origin import facts_of, parameters_with_origin
from selector.physics.gauging.gauging_channels import ALLOWANCE, GAUGE, MEASURED
from selector.physics.gauging.size_distribution import size_distribution
from selector.report.gauging_report import MOST_RUNS, GaugingPage, PartOnPage

if TYPE_CHECKING:
    from selector.findings import Finding
    from selector.physics.channel_differences import ChannelDifference
    from selector.physics.gauging.gauging_model import GaugingModel, GaugingSimulation
    from selector.physics.gauging.gauging_summary import GaugingSummary
    from selector.recording import Recording


def page_of(
    model: GaugingModel,
    simulation: GaugingSimulation,
    summary: GaugingSummary,
    findings: tuple[Finding, ...],
    path: Path,
    differences: tuple[ChannelDifference, ...] = (),
    inputs: tuple[str, ...] = (),
) -> GaugingPage:
    """Everything that the page shows; `path` is the model file, `differences` are those from recordings.

    `inputs` names the recorded channels that drove the gauge.
    """
    made, recording = model.values, simulation.recording
    transducer = made.transducer
    return GaugingPage(
        recording=recording,
        model=model.name,
        summary=summary,
        linear=size_distribution(model.setup, method="linear", parts=model.file.run.parts),
        wanted_um=model.setup.wanted_um,
        tolerance=made.tolerance,
        parts=_ground(model, simulation) if simulation.courses else _driven(recording),
        ground=simulation.sizes,
        dress_every=made.grinding.dress_every if made.grinding.wheel_wear > 0 else 0,
        waveform=simulation.waveform,
        rest_gap_m=0.0 if transducer is None else transducer.rest_gap_m,
        stroke_s=0.01 if transducer is None else 0.5 / transducer.electromagnet.frequency_hz,
        inputs=inputs,
        differences=differences,
        findings=findings,
        parameters=parameters_with_origin(model.file, model.parameters),
        told={
            **facts_of(path, model.file.model.note),
            "time between samples [s]": model.period_s,
            "parts of the Monte Carlo calculation": len(summary.sizes.size_um),
            "seed": recording.provenance["simulated"]["seed"],
        },
    )


def _ground(model: GaugingModel, simulation: GaugingSimulation) -> tuple[PartOnPage, ...]:
    return tuple(
        PartOnPage(
            name=name,
            time_s=course.time_s,
            allowance_um=course.allowance_um,
            measured_um=model.measured_um(course.voltage_v),
            voltage_v=course.voltage_v,
            feed_um_per_s=course.feed_um_per_s,
            ends_s=course.stage_end_s,
            is_finished=course.tripped,
        )
        for name, course in simulation.courses.items()
    )


def _driven(recording: Recording) -> tuple[PartOnPage, ...]:
    """Recorded runs, as the gauge would have seen them; their channels stand in the order of `gauging_driving`."""
    sizes, voltages = recording.with_role(ALLOWANCE.role), recording.with_role(GAUGE.role)
    assert MEASURED.role == ALLOWANCE.role
    found = []
    for run in recording.runs[:MOST_RUNS]:
        allowance, measured = (recording.values(run, [name])[:, 0] for name in sizes[:2])
        voltage = recording.values(run, voltages[:1])[:, 0]
        time_s = recording.time_s(run)
        found.append(PartOnPage(run, time_s - time_s[0], allowance, measured, np.asarray(voltage), is_finished=False))
    return tuple(found)
