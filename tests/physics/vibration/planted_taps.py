"""Tap tests of a structure whose stiffness and ψ are known: hammer blows, noise, records that end, UFF files."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from selector.physics.vibration.model_file import read_model_file
from selector.physics.vibration.structure import Structure, receptance
from selector.physics.vibration.taps import TapResponse, response_of_records
from selector.physics.vibration.vibration_model import VibrationModel, vibration_model

MODEL = Path(__file__).parents[3] / "fixtures/vibration/small-lathe.toml"
NODES = {"bed": 1, "workpiece": 2, "tool": 3}
AT, OF = ("tool", "workpiece"), ("tool", "workpiece", "bed")
RATE_HZ, SAMPLES = 2048.0, 1024


def model() -> VibrationModel:
    return vibration_model(read_model_file(MODEL))


def drawn(seed: int, within: float = 0.4) -> VibrationModel:
    """The same machine with other stiffnesses and ψ, each within a share of what the file says."""
    rng, made = np.random.default_rng(seed), model()
    names = [name for name in made.parameters if name.startswith("joints.")]
    return made.with_parameters({n: made.parameters[n].value * (1 + within * rng.uniform(-1, 1)) for n in names})


def blow(
    structure: Structure,
    at: str,
    of: tuple[str, ...],
    rng: np.random.Generator,
    *,
    samples: int = SAMPLES,
    noise: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Force [N] and accelerations [m/s²] of one blow as they are recorded, shapes (n_samples,) and (n_of, n_samples).

    The true motion is that of a record eight times as long; what is recorded stops while it still rings. Noise of the
    force is 0.2 % of its peak, that of an acceleration 0.5 % of its own peak, both white. Every blow is askew by some
    5°, which makes the motion smaller, and beside the place by so much that the motion is 1 % off. Hammer and
    accelerometers say 2 % too much or too little (`blows`).
    """
    time_s = np.arange(8 * samples) / RATE_HZ
    begin, width = 0.01 + 0.002 * rng.uniform(), 0.002 * rng.uniform(0.8, 1.2)
    inside = (time_s >= begin) & (time_s < begin + width)
    force = rng.uniform(300, 900) * np.where(inside, np.sin(np.pi * (time_s - begin) / width), 0.0)
    frequency, spectrum = np.fft.rfftfreq(len(time_s), 1 / RATE_HZ), np.fft.rfft(force)
    gain = np.cos(np.radians(5) * noise * rng.normal()) * (1 + 0.01 * noise * rng.normal())
    motions = []
    for one in of:
        answer = receptance(structure, frequency, of=one, at=at) * -((2 * np.pi * frequency) ** 2)
        motions.append(gain * np.fft.irfft(answer * spectrum, len(time_s))[:samples])
    force, motion = force[:samples], np.array(motions)
    motion += noise * 0.005 * np.abs(motion).max(axis=1, keepdims=True) * rng.standard_normal(motion.shape)
    return force + noise * 0.002 * force.max() * rng.standard_normal(samples), motion


def blows(
    true: VibrationModel, seed: int, taps: int, *, of: tuple[str, ...] = OF, noise: float = 1.0
) -> dict[str, list[tuple[np.ndarray, np.ndarray]]]:
    """Member that was tapped → force and motions of each tap, as the sensors say them."""
    rng = np.random.default_rng([seed, 1])
    off = {name: 1 + noise * 0.02 * rng.normal() for name in ("hammer", *of)}
    gains = np.array([[off[name]] for name in of])
    found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for at in AT:
        for _ in range(taps):
            force, motions = blow(true.structure, at, of, rng, noise=noise)
            found.setdefault(at, []).append((off["hammer"] * force, gains * motions))
    return found


def planted(true: VibrationModel, seed: int, taps: int, *, noise: float = 1.0) -> list[TapResponse]:
    """The compliances of such a test."""
    found = []
    for at, of_place in blows(true, seed, taps, noise=noise).items():
        forces, motions = (np.array(one) for one in zip(*of_place, strict=True))
        found += [response_of_records(of, at, forces, motions[:, k], 1 / RATE_HZ, 2) for k, of in enumerate(OF)]
    return found


def records(
    true: VibrationModel, seed: int, taps: int, *, of: tuple[str, ...] = OF, noise: float = 1.0
) -> list[dict[str, object]]:
    """Datasets 58 of such a test, records in time in m/s² and N."""
    found = []
    for at, of_place in blows(true, seed, taps, of=of, noise=noise).items():
        for force, motions in of_place:
            case = len(found) + 1
            found.append(dataset(force, at, "hammer", case))
            found += [dataset(one, name, "accelerometer", case) for name, one in zip(of, motions, strict=True)]
    return found


def spectra(true: VibrationModel, seed: int, taps: int) -> list[dict[str, object]]:
    """Datasets 58 of such a test as an analyser makes them without any window: the mean by H1, and its coherence."""
    found = []
    for at, of_place in blows(true, seed, taps).items():
        force, motion = (np.fft.rfft(np.array(one)) for one in zip(*of_place, strict=True))
        power = np.sum(np.abs(force) ** 2, axis=0)
        for k, of in enumerate(OF):
            cross = np.sum(motion[:, k] * force.conj(), axis=0)
            coherence = np.abs(cross) ** 2 / (power * np.sum(np.abs(motion[:, k]) ** 2, axis=0))
            for kind, values in ((4, cross / power), (6, coherence)):
                found.append(spectrum(values, of, at, kind))
    return found


def spectrum(values: np.ndarray, of: str, at: str, kind: int = 4, **more: object) -> dict[str, object]:
    """A frequency response in (m/s²)/N, or with `kind` 6 a coherence, as dataset 58."""
    step = RATE_HZ / SAMPLES
    head = {
        "func_type": kind, "ref_node": NODES[at], "x": step * np.arange(len(values)), "abscissa_inc": step,
        "abscissa_spec_data_type": 18, "orddenom_spec_data_type": 13, "orddenom_axis_units_lab": "N",
    }  # fmt: skip
    return dataset(values, of, "accelerometer", 1, **(head | more))


def dataset(values: np.ndarray, node: str, what: str, case: int, **more: object) -> dict[str, object]:
    """A record in time as dataset 58."""
    is_force = what == "hammer"
    head = {
        "type": 58, "binary": 1, "id1": what, "func_type": 1, "ver_num": 0, "load_case_id": case,
        "rsp_node": NODES[node], "rsp_dir": 3, "ref_node": 0, "ref_dir": 3,
        "x": np.arange(len(values)) / RATE_HZ, "data": values, "abscissa_spacing": 1, "abscissa_inc": 1 / RATE_HZ,
        "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 13 if is_force else 12, "orddenom_spec_data_type": 0,
        "ordinate_axis_units_lab": "N" if is_force else "m/s^2",
    }  # fmt: skip
    return head | more


def write_uff(path: Path, datasets: list[dict[str, object]], *, unitless: bool = False, **units: float) -> Path:
    """A UFF file; `units` are how many of its own length and force units one of SI is (dataset 164, if it has one)."""
    import pyuff

    head = pyuff.prepare_164(
        units_code=1, units_description="SI", temp_mode=1, length=1.0, force=1.0, temp=1.0, temp_offset=273.15
    )
    path.unlink(missing_ok=True)
    with warnings.catch_warnings():
        # it leaves the file open when it goes from text to bytes
        warnings.simplefilter("ignore", ResourceWarning)
        pyuff.UFF(str(path)).write_sets([*([] if unitless else [{**head, **units}]), *({**one} for one in datasets)])
    return path
