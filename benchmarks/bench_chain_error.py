"""How good the chains of the shipped lathe are, and how long the coupled solution takes.

The numbers of docs/explanation/vibration-chains.md: ``python benchmarks/bench_chain_error.py``.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from selector.physics.vibration.chains import Agreement, ChainAccuracy, chain_accuracy
from selector.physics.vibration.model_file import read_model_file
from selector.physics.vibration.structure import Structure, excitation, receptance, receptances, structure_modes
from selector.physics.vibration.vibration_model import VibrationModel, vibration_model
from selector.physics.vibration.vibration_summary import judged_frequencies_hz
from tests.physics.vibration.modal_sum import receptance_by_modes

Vector = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
HZ = np.geomspace(5.0, 2000.0, 4000)
VARIED = 200


def main() -> None:
    model = vibration_model(read_model_file(ROOT / "fixtures" / "vibration" / "lathe.toml"))
    structure, names = model.structure, model.structure.names
    split = model.split_hz(model.shaft_rpm)
    assert split is not None
    lines = excitation(model.sources, model.shaft_rpm)
    judged = judged_frequencies_hz(model, lines.frequency_hz, split)

    modes = structure_modes(structure)
    print(
        "modes",
        ", ".join(f"{hz:.0f} Hz ({eta:.3f})" for hz, eta in zip(modes.frequency_hz, modes.loss_factor, strict=True)),
    )
    worst = 0.0
    for at in names:
        scale = np.abs(receptance(structure, HZ, of=at, at=at)).max()
        for of in names:
            by_modes = receptance_by_modes(structure, HZ, of=of, at=at, modes=modes)
            worst = max(worst, float(np.abs(by_modes - receptance(structure, HZ, of=of, at=at)).max() / scale))
    print(f"modes against direct, of the largest amplitude: {worst:.1e}")

    many, force = np.geomspace(5.0, 2000.0, 10_000), np.eye(1, len(names))[0]
    direct_s = seconds(lambda: receptances(structure, many, force[None]))
    modes_s = seconds(lambda: receptance_by_modes(structure, many, of="tool", at="tool"))
    print(f"{len(names)} members at 10 000 frequencies: direct {direct_s:.3f} s, by modes {modes_s:.3f} s")

    for dampers_carry in (False, True):
        how = "dampers carry" if dampers_carry else "as published"
        print(f"\nsplit {split:.0f} Hz, {judged[0]:.0f} to {judged[-1]:.0f} Hz, {how}")
        print("chain, source | share within 10 % (amplitude alone), rms: published | one way | cut out | bands [Hz]")
        for one in accuracy(model, structure, judged, split, dampers_carry=dampers_carry):
            parts = " | ".join(short(part) for part in (one.published, one.one_way, one.cut_out))
            bands = ", ".join(f"{low:.0f}-{high:.0f}" for low, high in one.published.bands_hz if high > 1.1 * low)
            print(f"{one.chain:8s} {one.source!s:4s} | {parts} | {bands}")

    print(f"\n{VARIED} lathes with every mass, stiffness and ψ between half and twice: share within 10 %")
    shares = defaultdict[tuple[str, str | None], list[float]](list)
    for seed in range(VARIED):
        for one in accuracy(model, varied(structure, seed), judged, split):
            shares[one.chain, one.source].append(100 * one.published.share_within)
    for (chain, source), values in shares.items():
        low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
        print(f"{chain:8s} {source!s:4s} | median {middle:3.0f} %, eight of ten from {low:.0f} to {high:.0f} %")


def accuracy(
    model: VibrationModel, structure: Structure, judged_hz: Vector, split: float, *, dampers_carry: bool = False
) -> tuple[ChainAccuracy, ...]:
    return chain_accuracy(
        structure, model.chains, judged_hz, sources=model.sources, split_hz=split, dampers_carry=dampers_carry
    )


def varied(structure: Structure, seed: int) -> Structure:
    """The structure with all its numbers between half and twice, seeded."""
    factor = (float(2.0**power) for power in np.random.default_rng(seed).uniform(-1, 1, 200))
    return Structure(
        tuple(replace(member, mass_kg=member.mass_kg * next(factor)) for member in structure.members),
        tuple(
            replace(
                joint,
                stiffness_n_per_m=joint.stiffness_n_per_m * next(factor),
                dissipation=joint.dissipation * next(factor),
            )
            for joint in structure.joints
        ),
    )


def short(part: Agreement) -> str:
    of_amplitude = np.mean(np.abs(np.abs(part.ratio) - 1.0) <= 0.1)
    return f"{100 * part.share_within:3.0f} ({100 * of_amplitude:3.0f}) % {part.rms_db:5.1f} dB"


def seconds(run: Callable[[], object]) -> float:
    """Shortest of five."""
    times = []
    for _ in range(5):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


if __name__ == "__main__":
    main()
