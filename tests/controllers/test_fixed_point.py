"""The fixed-point program, compiled with traps for overflow, never differs by more than its printed bound."""

from __future__ import annotations

import itertools
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from selector.controllers import Guard, Input, ModelFile, Output, OutputLimits, PositionPart, State, Term
from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.model_file import read_model
from selector.controllers.replay.compiled import compiler
from selector.controllers.replay.parts import Rows, reference_answers
from selector.controllers.writers.c99 import c_files
from selector.controllers.writers.exported import ExportRefusedError
from selector.controllers.writers.fixed_point import (
    INT_NAME,
    fixed_point_bound_um,
    fixed_point_findings,
)
from selector.controllers.writers.fixed_point_numbers import ONE, Fixed, fixed, shifted
from selector.errors import InputError
from tests.controllers import hostile
from tests.controllers.golden_text import golden, without_version


def fixed_point_files(model: ModelFile, *, is_sign_verified: bool) -> dict[str, str]:
    return c_files(model, precision="whole", name=INT_NAME, is_sign_verified=is_sign_verified)


ROOT = Path(__file__).resolve().parents[2]
PATENT = ROOT / "fixtures/models/patent-two-sensors.json"
MISSING = -(2**31)

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")


class Compiled:
    """The generated program as a filter: numbers of the inputs in, of the outputs out; it traps undefined behaviour."""

    def __init__(self, model, folder, kept=()):
        files = fixed_point_files(model, is_sign_verified=False)
        for name, text in files.items():
            (folder / name).write_text(text, encoding="ascii")
        members = files[f"{INT_NAME}.h"].split("typedef")[1].split("}")[0]
        parts = re.split(r"/\* (inputs|outputs|to be kept when the control is off) \*/", members)
        self.inputs = re.findall(r"int32_t (\w+);", parts[2])
        self.outputs = re.findall(r"int32_t (\w+);", parts[4])
        scan = "".join(f' && scanf("%d", &m.{name}) == 1' for name in self.inputs)
        say = "".join(f' printf("%d ", m.{name});' for name in self.outputs)
        main = (
            f'#include <stdio.h>\n#include "{INT_NAME}.h"\nint main(void)\n{{\n'
            + f"    {INT_NAME} m;\n    {INT_NAME}_init(&m);\n"
            + "".join(f"    m.{name} = {value};\n" for name, value in dict(kept).items())
            + f'    while (1{scan}) {{ {INT_NAME}_step(&m);{say} puts(""); }}\n    return 0;\n}}\n'
        )
        (folder / "main.c").write_text(main, encoding="ascii")
        self.program = folder / "run"
        options = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic"]
        traps = ["-fsanitize=undefined", "-fsanitize-undefined-trap-on-error"]
        subprocess.run(
            [compiler(), *options, *traps, "-o", self.program, folder / "main.c", folder / f"{INT_NAME}.c"], check=True
        )

    def __call__(self, rows):
        """`rows`: name of an input → series of integers."""
        table = np.column_stack(
            [
                np.asarray(rows.get(name, name in ("is_ready", "is_wanted"))) + np.zeros(len(rows["dt_ms"]))
                for name in self.inputs
            ]
        )
        text = "\n".join(" ".join(map(str, row)) for row in table.astype(np.int64).tolist())
        done = subprocess.run([self.program], input=text, capture_output=True, text=True, check=True)
        found = np.array(done.stdout.split(), dtype=np.int64).reshape(-1, len(self.outputs))
        return dict(zip(self.outputs, found.T, strict=True))


def at_once(model):
    """The same model with a slew limit that never holds anything back."""
    limits = tuple(OutputLimits(output=o.name, clamp_um=1e5, slew_um_per_s=1e6) for o in model.outputs)
    return model.model_copy(update={"guard": Guard(limits=limits, recover_after_s=0.0), "fallbacks": ()})


def rich(**state):
    """Rise, absolute with a centre far away, speed, memory, cubes, position."""
    return ModelFile(
        name="rich",
        inputs=(
            Input(name="T1", centre=4.1, scale=2.3, valid_min=-0.7, valid_max=10.0),
            Input(name="amb", role="ambient", reference="absolute", centre=0.0, scale=1.1, valid_min=18.0,
                  valid_max=26.0005),
            Input(name="n", role="spindle_speed", unit="rpm", reference="absolute", centre=1500.0, scale=900.0,
                  valid_min=0.0, valid_max=3000.0),
        ),
        states=(State(name="late", source="T1", centre=2.2, scale=1.7, **({"tau_s": 1800.0} | state)),),
        outputs=(
            Output(
                name="Z", axis="Z", intercept=-1.871,
                terms=(
                    Term(powers={"T1": 3}, coefficient=0.137), Term(powers={"T1": 1, "amb": 2}, coefficient=-0.0731),
                    Term(powers={"late": 1}, coefficient=11.3),
                    Term(powers={"late": 2, "n": 1}, coefficient=0.2),
                ),
            ),
            Output(
                name="Y", axis="Y", intercept=0.1, terms=(Term(powers={"n": 1}, coefficient=2.0 / 3.0),),
                position=PositionPart(axis="Y", reference_m=0.25, valid_min_m=-0.1, valid_max_m=0.6, intercept=3.0,
                                      terms=(Term(powers={"T1": 1, "amb": 1}, coefficient=1.7),)),
            ),
        ),
    )  # fmt: skip


def valid_rows(model, n, seed, *, is_counted):
    """Readings inside the valid ranges: corners first, then anywhere; the same as counts. Steps of 1 s to 10 min."""
    rng = np.random.default_rng(seed)
    numbers = fixed(model)
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=len(model.inputs))))
    shares = np.vstack([np.repeat(corners, 3, axis=0), rng.random((n, len(model.inputs)))])
    n = len(shares)
    dt_ms = rng.choice([1000, 1500, 10_000, 60_000, 600_000], n)
    readings, counts = [], []
    for share, item in zip(shares.T, model.inputs, strict=True):
        per_unit = float(numbers.inputs[item.name].per_unit)
        x = item.valid_min + share * (item.valid_max - item.valid_min)
        start = 0.0
        if item.reference == "rise":
            x[0] = 0.0
            start = 20.0 + 3.0 * rng.random()
        if is_counted:
            # whole counts inside the range
            low, high = np.ceil(item.valid_min * per_unit), np.floor(item.valid_max * per_unit)
            start = np.rint(start * per_unit)
            count = np.clip(np.rint(x * per_unit), low, high) + start
            readings.append(count / per_unit)
        else:
            readings.append(x + start)
            count = np.rint((x + start) * per_unit)
        counts.append(count.astype(np.int64))
    position_m = rng.choice([-0.1, 0.6, 0.25, 0.1234567], n)
    return dt_ms, np.column_stack(readings), counts, position_m


def largest_differences(model, folder, *, n=1500, is_counted, seed=1):
    """Per output, measured against the float64 reference [µm]."""
    dt_ms, readings, counts, position_m = valid_rows(model, n, seed, is_counted=is_counted)
    rows = {"dt_ms": dt_ms} | {f"reading_{k}": series for k, series in enumerate(counts, 1)}
    rows["position_1"] = np.rint(position_m * 1e6)
    found = Compiled(model, folder)(rows)
    guarded = GuardedModel(model)
    axes = {o.position.axis for o in model.outputs if o.position is not None}
    differences = {o.name: 0.0 for o in model.outputs}
    for k in range(len(dt_ms)):
        row = dict(zip((i.name for i in model.inputs), readings[k].tolist(), strict=True))
        expected = guarded.step(dt_ms[k] / 1000.0, row, dict.fromkeys(axes, position_m[k]))
        assert expected.mode == found["mode"][k] == 1
        for j, o in enumerate(model.outputs, 1):
            gap = abs(expected.correction_um[o.name] - found[f"correction_{j}"][k] / 1000.0)
            differences[o.name] = max(differences[o.name], gap)
    return differences


@pytest.mark.parametrize("which", ["patent", "rich", "odd time constant"])
@pytest.mark.parametrize("is_counted", [True, False])
def test_measured_difference_is_within_the_bound_and_the_bound_is_not_silly(which, is_counted, tmp_path):
    model = {"patent": read_model(PATENT), "rich": rich(), "odd time constant": rich(tau_s=3.00049)}[which]
    model = at_once(model)
    measured = largest_differences(model, tmp_path, is_counted=is_counted)
    bound = fixed_point_bound_um(model, is_counted=is_counted)
    for name, largest in measured.items():
        assert largest <= bound[name]
        # all roundings at their worst at once do not happen in some thousand rows
        assert bound[name] < 10.0 * largest, (name, bound[name], largest)


def random_model(seed):
    """Up to four inputs of any role and range, memory of each, terms up to the ninth degree."""
    rng = np.random.default_rng(seed)
    inputs, states = [], []
    for k in range(int(rng.integers(1, 5))):
        role, unit = [("temperature", "degC"), ("spindle_speed", "rpm"), ("position", "m")][int(rng.integers(3))]
        width = {"degC": 12.0, "rpm": 8000.0, "m": 0.7}[unit] * rng.random()
        low = -0.2 * width if rng.random() < 0.5 else 3.0 * width
        reference = "rise" if unit == "degC" and low < 0.0 else "absolute"
        centre = float(low + width * rng.uniform(-1.0, 2.0))
        scaling = {"centre": centre, "scale": float(width * rng.uniform(0.1, 2.0))}
        inputs.append(Input(name=f"i{k}", role=role, unit=unit, reference=reference, valid_min=float(low),
                            valid_max=float(low + width), **scaling))  # fmt: skip
        states.append(State(name=f"s{k}", source=f"i{k}", tau_s=float(10.0 ** rng.uniform(0.0, 5.0)), **scaling))
    names = [of.name for of in (*inputs, *states)]

    def terms(size):
        products = {}
        for _ in range(int(rng.integers(1, 6))):
            chosen = rng.choice(names, min(len(names), int(rng.integers(1, 4))), replace=False)
            products[frozenset(chosen)] = {str(name): int(rng.integers(1, 4)) for name in chosen}
        return tuple(Term(powers=powers, coefficient=float(rng.normal(0.0, size))) for powers in products.values())

    part = PositionPart(
        axis="Y", reference_m=0.2501, valid_min_m=-0.1, valid_max_m=0.6, intercept=3.0, terms=terms(2.0)
    )
    outputs = (Output(name="Z", intercept=1.23, terms=terms(0.4)), Output(name="Y", intercept=0.0, position=part))
    return at_once(ModelFile(name="random", inputs=tuple(inputs), states=tuple(states), outputs=outputs))


@pytest.mark.parametrize("seed", range(3))
def test_bound_holds_for_random_models(seed, tmp_path):
    model = random_model(seed)
    for is_counted in (True, False):
        measured = largest_differences(model, tmp_path, n=300, is_counted=is_counted, seed=seed)
        for name, bound in fixed_point_bound_um(model, is_counted=is_counted).items():
            assert measured[name] <= bound


def test_memory_of_hours_does_not_stand_still(tmp_path):
    """Called every second through a ramp of 0.5 K in 4 h: 0.035 counts a call, into a memory of 10 h."""
    model = at_once(
        ModelFile(
            name="slow",
            inputs=(Input(name="T1", valid_min=0.0, valid_max=10.0),),
            states=(State(name="late", source="T1", tau_s=36_000.0),),
            outputs=(Output(name="Z", intercept=0.0, terms=(Term(powers={"late": 1}, coefficient=100.0),)),),
        )
    )
    n = 14_400
    counts = 20_000 + np.rint(500.0 * np.arange(n) / n).astype(np.int64)
    found = Compiled(model, tmp_path)({"dt_ms": np.full(n, 1000), "reading_1": counts})["correction_1"] / 1000.0
    guarded = GuardedModel(model)
    expected = np.array([guarded.step(1.0, {"T1": c / 1000.0}).correction_um["Z"] for c in counts])
    bound = fixed_point_bound_um(model, is_counted=True)["Z"]
    assert expected[-1] < -8.0
    assert np.max(np.abs(found - expected)) <= bound < 0.06
    # a filter in whole counts would not have moved at all: its largest step is 0.014 counts
    assert 500 / 36_000 < 0.5


def test_hostile_integers_overflow_nothing_and_stay_within_clamp_and_slew(tmp_path):
    model = hostile.model()
    run = Compiled(model, tmp_path)
    rng = np.random.default_rng(5)
    ends = np.array([MISSING, MISSING + 1, 2**31 - 1, 2**31 - 2, 0, 1, -1, 850_000, 20_000, 25_000])
    n = 6000
    rows = {"dt_ms": rng.choice([*ends, 1, 10, 1000, 60_000], n), "position_1": rng.choice(ends, n)}
    for k in (1, 2, 3):
        calm = 20_000 + np.cumsum(rng.integers(-20, 21, n))
        rows[f"reading_{k}"] = np.where(rng.random(n) < 0.05, rng.choice(ends, n), calm)
    rows["is_ready"], rows["is_wanted"] = rng.random(n) > 0.01, rng.random(n) > 0.05
    rows["is_restart"], rows["standstill_ms"] = rng.random(n) < 0.002, rng.choice(ends, n)
    rows["test_nm_1"] = np.where(rng.random(n) < 0.03, rng.choice([10_000, *ends], n), 0)
    found = run(rows)
    assert {1, 2, 4, 5, 0} <= set(found["mode"])
    assert np.abs(found["correction_1"]).max() <= 20_000
    assert np.abs(found["correction_2"]).max() <= 8_000
    # 1 µm/s for the second output, and 1 nm that was left over
    free = (found["mode"][1:] != 0) & ~rows["is_restart"][1:]
    step = np.abs(np.diff(found["k0_2"]))[free]
    allowed = np.clip(rows["dt_ms"], 0, 10_000)[1:][free] + 1
    assert np.all(step <= allowed)


def test_limits_of_any_size_overflow_nothing(tmp_path):
    item = Input(name="T1", valid_min=-9e5, valid_max=9e5, rate_limit_per_min=1e12, reading_max=1e300)
    part = PositionPart(axis="Z", reference_m=-999.0, valid_min_m=-999.0, valid_max_m=999.0, intercept=1e6)
    limits = (OutputLimits(output="Z", clamp_um=2e6, slew_um_per_s=1e300, slope_clamp_um_per_m=2e6),)
    model = ModelFile(
        name="large", inputs=(item,), states=(State(name="late", source="T1", tau_s=2.9e6),),
        outputs=(Output(name="Z", intercept=1e6, terms=(Term(powers={"late": 1}, coefficient=1.0),), position=part),),
        guard=Guard(limits=limits, recover_after_s=0.0),
    )  # fmt: skip
    rng = np.random.default_rng(7)
    ends = np.array([2**31 - 2, -(2**31) + 1])
    rows = {"dt_ms": rng.choice([10**9, 1000], 200), "reading_1": rng.choice(ends, 200),
            "position_1": rng.choice(ends, 200)}  # fmt: skip
    assert np.abs(Compiled(model, tmp_path)(rows)["correction_1"]).max() == 2_000_000_000


@pytest.mark.parametrize(("fault", "code"), [(MISSING, 3), (850_000, 4), (120_000, 5), (29_000, 6), (29_000, 8)])
def test_fault_holds_the_last_value_then_ramps_to_zero_as_the_reference_does(fault, code, tmp_path):
    model = ModelFile(
        name="guarded",
        inputs=(
            Input(
                name="T1", valid_min=-1.0, valid_max=8.0, rate_limit_per_min=1.5 if code == 6 else None,
                reading_max=90.0,
            ),
        ),
        outputs=(Output(name="Z", intercept=5.0, terms=(Term(powers={"T1": 1}, coefficient=1.0),)),),
        guard=Guard(on_fault="hold", hold_at_most_s=100.0, recover_after_s=30.0, outside_valid_range="fault"),
    )  # fmt: skip
    readings = np.array([20_000] * 20 + [fault] * 40 + [20_000] * 20)
    found = Compiled(model, tmp_path)({"dt_ms": np.full(80, 5000), "reading_1": readings})
    assert found["sensor_1"][20] == code
    assert set(found["mode"][20:40]) == {2}
    assert set(found["correction_1"][20:40]) == {-5000}
    assert found["mode"][45] == 3
    assert found["correction_1"][50] == 0
    always = np.ones(80, dtype=bool)
    degc = np.where(readings == MISSING, np.nan, readings / 1000.0)[:, None]
    rows = Rows(np.full(80, 5.0), degc, np.zeros((80, 0)), always, always, ~always, np.zeros(80))
    expected = reference_answers(model, rows)
    np.testing.assert_array_equal(found["sensor_1"], expected.sensors[:, 0])
    np.testing.assert_array_equal(found["mode"], expected.mode)
    bound = fixed_point_bound_um(model)["Z"]
    np.testing.assert_allclose(found["correction_1"] / 1000.0, expected.correction_um[:, 0], rtol=0.0, atol=bound)


def test_less_than_a_nanometre_a_call_is_not_lost(tmp_path):
    limits = (OutputLimits(output="Z", clamp_um=10.0, slew_um_per_s=0.0301),)
    model = ModelFile(
        name="slow",
        inputs=(Input(name="T1", valid_min=0.0, valid_max=1.0),),
        outputs=(Output(name="Z", intercept=5.0),),
        guard=Guard(limits=limits, recover_after_s=0.0),
    )
    found = Compiled(model, tmp_path)({"dt_ms": np.full(10_000, 1), "reading_1": [20_000]})
    assert found["correction_1"][-1] == -301


def test_golden_files():
    for name, text in fixed_point_files(read_model(PATENT), is_sign_verified=False).items():
        assert without_version(text) == golden(f"fixed_point/{name}")


def test_bound_is_printed_and_told():
    model = hostile.model()
    bound = fixed_point_bound_um(model)
    text = fixed_point_files(model, is_sign_verified=True)[f"{INT_NAME}.c"]
    printed = [float(v) for v in re.findall(r"inside the valid ranges: \w (\S+) um", text)]
    # printed with five decimals, rounded up
    assert all(0.0 <= p - b <= 1.01e-5 for p, b in zip(printed, bound.values(), strict=True))
    found = fixed_point_findings(model)
    assert [f.id for f in found] == ["fixed-point-bound", "fixed-point-bound"]
    assert found[0].evidence["bound_um"] == bound["Z"]


def largest_values(of: Fixed):
    """A bound of every intermediate value of the model."""
    for v in of.variables.values():
        yield v.total + (1 << v.shift)
        yield v.largest**2 + ONE
    for p in (*of.own.values(), *of.slopes.values()):
        yield p.total + (1 << p.shift)


def test_every_intermediate_value_is_below_63_bits():
    for model in (read_model(PATENT), rich(), hostile.model()):
        sizes = list(largest_values(fixed(model)))
        assert len(sizes) > 4
        assert all(size < 2**63 for size in sizes)


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"coefficient": 1e9}, "64 bits"),
        ({"tau_s": 4e6}, "64 bits"),
        ({"centre": 1e14}, "64 bits"),
        ({"clamp_um": 3e6}, "32 bits"),
    ],
)
def test_what_does_not_fit_is_refused_with_the_reason(change, part):
    with pytest.raises(ExportRefusedError, match=part) as caught:
        fixed_point_files(
            ModelFile(
                name="too large",
                inputs=(Input(name="T1", valid_min=0.0, valid_max=10.0, centre=change.get("centre", 0.0)),),
                states=(State(name="late", source="T1", tau_s=change.get("tau_s", 10.0)),),
                outputs=(Output(
                    name="Z", intercept=0.0, terms=(Term(powers={"T1": 1}, coefficient=change.get("coefficient", 1.0)),)
                ),),
                guard=Guard(limits=(OutputLimits(output="Z", clamp_um=change.get("clamp_um", 5.0)),)),
            ),
            is_sign_verified=False,
        )  # fmt: skip
    assert isinstance(caught.value, InputError)


def test_shift_rounds_to_the_nearest():
    assert [shifted(v, 2) for v in (-7, -6, -5, -2, -1, 0, 1, 2, 5, 6, 7)] == [-2, -2, -1, -1, 0, 0, 0, 1, 1, 2, 2]
    assert shifted(5, 0) == 5


def test_counts_are_chosen_so_that_the_range_is_resolved_and_fits():
    inputs = (
        Input(name="T", valid_min=0.0, valid_max=0.5),
        Input(name="p", role="position", unit="m", reference="absolute", valid_min=0.0, valid_max=0.8),
        Input(name="n", role="spindle_speed", unit="rpm", reference="absolute", valid_min=0.0, valid_max=42000.0),
        Input(name="s", role="spindle_speed", unit="rpm", reference="absolute", valid_min=0.0, valid_max=3e7),
    )
    model = ModelFile(name="counts", inputs=inputs, outputs=(Output(name="Z", intercept=1.0),))
    assert [float(c.per_unit) for c in fixed(model).inputs.values()] == [1000.0, 100_000.0, 1000.0, 10.0]


@pytest.mark.parametrize("name", ['T*/ int x; /*"', "T)(", "T\\", "T??/", "温度 µ", "*/"])
def test_names_stay_in_their_remarks(name, tmp_path):
    model = ModelFile(
        name=name,
        inputs=(Input(name=name, valid_min=0.0, valid_max=10.0),),
        outputs=(Output(name=name, intercept=1.0, terms=(Term(powers={name: 1}, coefficient=2.0),)),),
        guard=Guard(recover_after_s=0.0),
    )
    found = Compiled(model, tmp_path)({"dt_ms": [10_000, 10_000], "reading_1": [20_000, 22_000]})
    assert list(found["correction_1"]) == [-1000, -5000]
