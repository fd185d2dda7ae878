"""The real drive EMPS: what is identified, and how far the simulation is from both records.

python -m benchmarks.bench_emps

Prints the tables of docs/explanation/emps-drive.md. Parameters come from DATA_EMPS alone, except where said; the pulses
of DATA_EMPS_PULSES, 5.07 V where its flag is set, act as a known force. The first 50 ms do not count.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import optimize
from scipy.io import loadmat

from proving_ground.real.identification import identified_axis_of_servo, identified_rigid_axis
from selector.physics.drive.parts.axis import Axis, AxisState, Friction, RigidMechanics, Sensing, Servo
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import Motion, Reference, recorded

Vector = NDArray[np.float64]

FOLDER = Path(__file__).parents[1] / "fixtures" / "emps"
PERIOD_S, SKIP = 1e-3, 50
PULSE_V = 5.07
NAMES = ("mass_kg", "guide_damping_ns_per_m", "coulomb_n", "offset_n")
PUBLISHED = (95.1089, 203.5034, 20.3935, -3.1648)
LAWS = {
    "true speed, now": Sensing(motor_resolution=5e-8),
    "over one sample": Sensing(motor_resolution=5e-8, speed_from_encoder=True),
    "over two samples": Sensing(motor_resolution=5e-8, speed_from_encoder=True, speed_samples=2),
}
RECORDED = "over two samples"
"""The law that the records show."""


@dataclass(frozen=True)
class Record:
    """One of the two records; `output_v` is the voltage without the pulse, which only the control made."""

    name: str
    position_m: Vector
    voltage_v: Vector
    output_v: Vector
    reference: Reference
    start: AxisState
    servo: Servo


def records() -> tuple[Record, Record]:
    return _record("DATA_EMPS"), _record("DATA_EMPS_PULSES")


def _record(name: str) -> Record:
    variables = loadmat(FOLDER / f"{name}.mat")
    data = {key: np.asarray(value, dtype=np.float64).ravel() for key, value in variables.items() if key[0] != "_"}
    kp, kv, gain = (float(data[key][0]) for key in ("kp", "kv", "gtau"))
    pulse_v = PULSE_V * data["pulses_N"] / 5.0 if "pulses_N" in data else np.zeros_like(data["vir"])
    reference = replace(recorded(data["t"], data["qg"], PERIOD_S), force_n=gain * pulse_v)
    # the record begins in motion: a parabola through what a benchmark may use to start from
    speed, place = np.polyfit(np.arange(20) * PERIOD_S, data["qm"][:20], 2)[1:]
    start = AxisState(motor=place, motor_speed=speed, table_m=place, table_speed_m_per_s=speed)
    servo = Servo(kp, kv, actuator_gain=gain, sample_s=PERIOD_S, feedback="motor")
    return Record(name, data["qm"], data["vir"], data["vir"] - pulse_v, reference, start, servo)


def axis_of(values: Vector | tuple[float, ...], servo: Servo, law: str = RECORDED) -> Axis:
    mass, viscous, coulomb, offset = (float(value) for value in values)
    return Axis(RigidMechanics(mass, viscous), servo, Friction(coulomb, offset_n=offset), sensing=LAWS[law])


@dataclass(frozen=True)
class LoopErrors:
    """How the simulated loop differs from a record: position that the control sees [m], its output [V]."""

    position_rms_m: float
    position_max_m: float
    relative_position_error: float  #: ‖difference‖ / ‖recorded position‖
    command_rms: float


def loop_errors(motion: Motion, record: Record) -> LoopErrors:
    position = (motion.measured_m - record.position_m)[SKIP:]
    command = (motion.command - record.output_v)[SKIP:]
    return LoopErrors(
        float(np.sqrt(np.mean(position**2))),
        float(np.abs(position).max()),
        float(np.linalg.norm(position) / np.linalg.norm(record.position_m[SKIP:])),
        float(np.sqrt(np.mean(command**2))),
    )


def fitted_in_loop(axis: Axis, record: Record) -> tuple[Vector, Vector]:
    """Parameters `NAMES` with which the simulated loop leaves the least of position and command, and standard errors.

    Residuals of both are divided by what the first simulation leaves of each, so that both count alike; the steps of
    the encoder, which would hide what a small change of a parameter does, are left out of the search. Standard errors
    are those of residuals that are independent of each other, so too small where they are not.
    """
    before = loop_errors(simulate_axis(axis, record.reference, step_s=PERIOD_S, start=record.start), record)
    smooth = replace(axis, sensing=replace(axis.sensing, motor_resolution=0.0))
    begin = np.array(
        [axis.mechanics.mass_kg, axis.mechanics.guide_damping_ns_per_m, axis.friction.coulomb_n, axis.friction.offset_n]
    )
    size = np.abs(begin)

    def residuals(scaled: Vector) -> Vector:
        mass, viscous, coulomb, offset = (scaled * size).tolist()
        one = replace(smooth, mechanics=RigidMechanics(mass, viscous), friction=Friction(coulomb, offset_n=offset))
        motion = simulate_axis(one, record.reference, step_s=PERIOD_S, start=record.start)
        return np.concatenate(
            [
                (motion.measured_m - record.position_m)[SKIP:] / before.position_rms_m,
                (motion.command - record.output_v)[SKIP:] / before.command_rms,
            ]
        )

    # steps of the finite differences are large beside the moments at which friction changes its sign
    bounds = ([1e-3, 0.0, 0.0, -np.inf], np.inf)
    found = optimize.least_squares(residuals, begin / size, bounds=bounds, diff_step=1e-3, xtol=1e-6, ftol=1e-8)
    spread = 2.0 * found.cost / (len(found.fun) - len(begin))
    covariance = np.linalg.pinv(found.jac.T @ found.jac) * spread
    return found.x * size, np.sqrt(np.diag(covariance)) * size


def closed(record: Record, axis: Axis) -> str:
    motion = simulate_axis(axis, record.reference, step_s=PERIOD_S, start=record.start)
    errors = loop_errors(motion, record)
    # relative to the whole voltage, as the authors' force
    share = errors.command_rms * (len(record.voltage_v) - SKIP) ** 0.5 / np.linalg.norm(record.voltage_v[SKIP:])
    return (
        f"{1e6 * errors.position_rms_m:6.2f} µm rms {1e6 * errors.position_max_m:6.1f} µm max "
        f"{100 * errors.relative_position_error:.4f} % | {1e3 * errors.command_rms:6.1f} mV rms {100 * share:5.2f} %"
    )


def free(record: Record, axis: Axis) -> str:
    alone = replace(axis, sensing=Sensing(), servo=replace(axis.servo, sample_s=0.0))
    course = replace(record.reference, force_n=None)
    motion = simulate_axis(alone, course, step_s=PERIOD_S, start=record.start, commands=record.voltage_v)
    error = motion.motor - record.position_m
    variance = np.mean((record.position_m - record.position_m.mean()) ** 2)
    rms = float(np.sqrt(np.mean(error**2)))
    return f"{1e3 * rms:6.3f} mm rms {1e3 * np.abs(error).max():6.2f} mm max, R² {1 - rms**2 / variance:.4f}"


def row(values: Vector) -> str:
    return "".join(f"{value:10.4f}" for value in values)


def main() -> None:
    nominal, pulses = records()
    servo = nominal.servo
    print("inverse dynamic model, least squares:", ", ".join(NAMES))
    print(f"{'published':38s}{row(np.array(PUBLISHED))}")
    found = {}
    for record in (nominal, pulses):
        for delay_s in (0.0, 0.5 * PERIOD_S):
            fit = identified_axis_of_servo(PERIOD_S, record.position_m, record.voltage_v, servo, delay_s=delay_s)
            found[record.name, delay_s] = fit
            label = f"{record.name}, force {1e3 * delay_s:g} ms late"
            print(f"{label:38s}{row(fit.values)}  ±{row(fit.standard_errors)}  {100 * fit.relative_force_error:.2f} %")
    first = found[nominal.name, 0.0]
    print(f"cut-off {first.cut_off_hz:.1f} Hz, one sample of {first.decimation}, condition {first.condition:.1f}")
    for share in (0.7, 0.85, 1.15, 1.3):
        bandwidth_hz = share * first.cut_off_hz / 5.0
        force_n = servo.actuator_gain * nominal.voltage_v
        moved = identified_rigid_axis(PERIOD_S, nominal.position_m, force_n, bandwidth_hz=bandwidth_hz)
        print(f"cut-off x {share:<28g}{row(moved.values)}   {100 * moved.relative_force_error:.2f} %")

    print("\nin the loop, by simulation, speed of the control ...")
    fits = {}
    for law in LAWS:
        for record in (nominal, pulses):
            begin = time.perf_counter()
            values, standard_errors = fitted_in_loop(axis_of(first.values, servo, law), record)
            fits[law, record.name] = values
            seconds = time.perf_counter() - begin
            print(f"{law:18s}{record.name:20s}{row(values)}  ±{row(standard_errors)}  {seconds:.1f} s")

    print("\nclosed loop, simulated − recorded")
    parameters = {
        "published": np.array(PUBLISHED),
        "inverse model": first.values,
        "in the loop": fits[RECORDED, nominal.name],
    }
    for label, values in parameters.items():
        for law in LAWS:
            for record in (nominal, pulses):
                print(f"{label:14s} {law:17s} {record.name:17s} {closed(record, axis_of(values, servo, law))}")
    print("\nwith a delay of the actuator, inverse model")
    for delay_s in (0.0, 1e-4, 2e-4, 5e-4, 1e-3):
        axis = axis_of(first.values, replace(servo, delay_s=delay_s))
        for record in (nominal, pulses):
            print(f"{1e3 * delay_s:4.1f} ms {record.name:17s} {closed(record, axis)}")
    print("\nfree run on the recorded voltage")
    for label, values in parameters.items():
        for record in (nominal, pulses):
            print(f"{label:14s} {record.name:17s} {free(record, axis_of(values, servo))}")
    axis = axis_of(first.values, servo)
    simulate_axis(axis, nominal.reference, step_s=PERIOD_S, start=nominal.start)
    begin = time.perf_counter()
    for _ in range(20):
        simulate_axis(axis, nominal.reference, step_s=PERIOD_S, start=nominal.start)
    print(f"\none simulation of 24.84 s: {1e3 * (time.perf_counter() - begin) / 20:.1f} ms")


if __name__ == "__main__":
    main()
