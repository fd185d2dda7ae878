"""Every written file gives what it has to give, whatever the recording; a defect in any of them is found."""

from __future__ import annotations

import dataclasses
from functools import cache
from importlib.util import find_spec

import numpy as np
import pytest

from selector.controllers import Guard, Input, ModelFile, Output, OutputLimits, PositionPart, Term
from selector.controllers.c_compiler import compiler
from selector.controllers.evaluator import axes_of
from selector.controllers.guard.decided import with_decided_limits
from selector.controllers.model_file import read_model
from selector.controllers.replay.compiled import INSTALL, missing_program
from selector.controllers.replay.parts import places_m, reference_answers, straight_line_um
from selector.controllers.replay.replayed import executed
from selector.controllers.writers.targets import TARGETS
from tests.controllers import hostile
from tests.controllers.model_builders import PATENT

CALLS = {"every second": (1.0,), "any": (0.125, 0.5, 1.0, 7.0, 60.0, 900.0), "rarely": (30.0, 90.0)}


@pytest.fixture(autouse=True)
def _what_executes(request):
    target = request.node.callspec.params.get("target", "") if hasattr(request.node, "callspec") else ""
    if target in ("c", "fmu") and compiler() is None:
        pytest.skip("no C compiler; Debian: apt install gcc")
    if target == "fmu":
        pytest.importorskip("fmpy", reason="FMPy is not installed (extra fmu)")
    if target in ("st", "plcopen", "tcpou", "sinumerik", "beckhoff") and find_spec("tree_sitter_iec61131_3_st") is None:
        pytest.skip('no parser of Structured Text; pip install ".[controls]"')
    if target == "linuxcnc" and missing_program() is not None:
        pytest.skip(f"no LinuxCNC here: {INSTALL}")


def calls(model, n, seed, rhythm):
    """Hostile readings in calls as they are replayed: ready and wanted, whole eighths of a second."""
    rows = hostile.rows(n, seed, len(axes_of(model)))
    dt_s, yes = np.random.default_rng(seed).choice(CALLS[rhythm], n), np.ones(n, dtype=bool)
    dt_s[0] = 0.0
    readings = rows.readings[:, : len(model.inputs)]
    # nobody commands anything in a recording
    switches = {"is_ready": yes, "is_wanted": yes, "is_restart": ~yes, "standstill_s": np.zeros(n), "test_um": None}
    return dataclasses.replace(rows, dt_s=dt_s, readings=readings, **switches)


def steep(**guard):
    """The slope meets its limits, no dead band hides anything."""
    limits = (OutputLimits(output="Z", clamp_um=20.0, slew_um_per_s=0.7), OutputLimits(output="Y", clamp_um=8.0))
    model = hostile.model(limits=limits, **guard)

    def steeper(output):
        part = output.position
        if part is None:
            return output
        terms = tuple(term.model_copy(update={"coefficient": 5.0}) for term in part.terms)
        return output.model_copy(update={"position": part.model_copy(update={"intercept": 40.0, "terms": terms})})

    def all_of(of):
        return of.model_copy(update={"outputs": tuple(map(steeper, of.outputs))})

    return all_of(model).model_copy(update={"fallbacks": tuple(map(all_of, model.fallbacks))})


def screw(reference="absolute"):
    """What a drive can take."""
    low, high = (15.0, 50.0) if reference == "absolute" else (-2.0, 25.0)
    terms = (Term(powers={"T1": 1}, coefficient=2.2),)
    slope = (Term(powers={"T1": 1}, coefficient=11.0),)
    zero = -23.0 if reference == "absolute" else 0.0
    part = PositionPart(axis="X", reference_m=0.05883, valid_min_m=0.0, valid_max_m=0.6, intercept=11.0 * zero,
                        terms=slope)  # fmt: skip
    return ModelFile(
        name="screw",
        inputs=(Input(name="T1", reference=reference, valid_min=low, valid_max=high),),
        outputs=(Output(name="X", axis="X", intercept=2.2 * zero, terms=terms, position=part),),
        guard=Guard(limits=(OutputLimits(output="X", clamp_um=500.0),)),
    )


def replayed_parts(target, model, rows, change=lambda files: files, whole=None):
    model = with_decided_limits(model)
    files = change(dict(TARGETS[target].write(model).files))
    parts = [part for part in TARGETS[target].parts if part.file in files]
    return executed(model, files, parts, rows, whole or reference_answers(model, rows)), model


def differences(found, model):
    return [one for part in found for one in part.differences(model)]


MODELS = {
    "hostile": hostile.model(),
    "steep": steep(),
    "steep, hold": steep(on_fault="hold", hold_at_most_s=None),
    "steep, fault": steep(outside_valid_range="fault", without_fallback="ramp-to-zero"),
    "screw": screw(),
    "screw, rise": screw("rise"),
}
TAKEN = [
    (target, model)
    for target in TARGETS
    for model in MODELS
    if model.startswith("screw") or target != "rexroth"
    if target != "linuxcnc" or model in ("steep", "screw")
]


@cache
def called(which, rhythm, n=300, seed=5):
    """Calls of a model, and what the guard answers to them, whatever the control."""
    rows = calls(MODELS[which], n, seed, rhythm)
    return rows, reference_answers(with_decided_limits(MODELS[which]), rows)


@pytest.mark.parametrize("rhythm", CALLS)
@pytest.mark.parametrize(("target", "which"), TAKEN)
def test_every_file_gives_what_it_has_to_give(target, which, rhythm):
    if target == "linuxcnc" and rhythm != "any":
        pytest.skip("one session of LinuxCNC is enough: its program is that of C")
    rows, whole = called(which, rhythm)
    found, model = replayed_parts(target, MODELS[which], rows, whole=whole)
    assert [part.part.file for part in found] == [part.file for part in TARGETS[target].parts]
    for one in differences(found, model):
        assert one.is_explained, one


def test_allowed_is_small_where_no_dead_band_has_to_be_allowed_for():
    model = MODELS["steep"]
    rows, whole = called("steep", "every second", 1500)
    largest = {"c": 0.02, "sinumerik": 0.0001, "beckhoff": 0.06, "fanuc": 1e-8, "st": 0.0, "python": 0.0}
    for target, allowed_um in largest.items():
        for part in TARGETS[target].parts:
            allowed = part.allowed_um(with_decided_limits(model), rows, whole)
            assert max(allowed.values()) <= allowed_um, part.file


MISTAKES = [
    ("c", "thermal_correction_f.c", "m->correction_1 = towards", "m->correction_1 = 1.001f * towards"),
    ("c", "thermal_correction_f.c", "m->mode = m->follows;", "m->mode = 1;m->k0_1 += 1e-3f;"),
    # less than a hundredth of what single precision is allowed
    ("sinumerik", "thermal_correction.scl", "level_1 := level_1 +", "level_1 := level_1 + 1.0E-6 +"),
    ("sinumerik", "thermal_to_sd.scl", "1.0E-6", "1.0E-3"),
    ("sinumerik", "thermal_to_sd.scl", "0.001", "0.0011"),
    ("sinumerik", "thermal_to_sd.scl", ":= 100.0", ":= 100.7"),
    ("beckhoff", "temp_comp_ads.txt", "10.0 * fb.k0_1", "9.9 * fb.k0_1"),
    ("beckhoff", "temp_comp_ads.txt", ":= fb.slope_1", ":= 0.0"),
    ("beckhoff", "temp_comp_1.lis", "1000000  #", "1100000  #"),
    ("reprapfirmware", "selector_correction.g", "/ 1000.0", "/ 1001.0"),
    (
        "reprapfirmware",
        "selector_correction.g",
        "level_1 = global.selector_level_1 +",
        "level_1 = global.selector_level_1 + 0.000001 +",
    ),
    ("reprapfirmware", "selector_correction.g", "M290 R0 Z", "M290 R0 X"),
    ("fanuc", "O9100.nc", "-#501", "-#501-0.125"),
    ("fanuc", "O9100.nc", "=1000.", "=1001."),
    ("fanuc", "O9100.nc", "LE90.]GOTO", "LE100.]GOTO"),
]


@pytest.mark.parametrize(("target", "file", "was", "becomes"), MISTAKES)
def test_a_mistake_in_any_file_is_found(target, file, was, becomes):
    model = MODELS["steep"]
    # after a pause the macro waits, and nothing of it is seen
    rows, whole = called("steep", "rarely", 2000, 1) if target == "fanuc" else called("steep", "any", 1500, 1)

    def mistaken(files):
        return files | {file: files[file].replace(was, becomes)}

    assert was in TARGETS[target].write(with_decided_limits(model)).files[file]
    found, model = replayed_parts(target, model, rows, mistaken, whole)
    wrong = {one.file for one in differences(found, model) if not one.is_explained}
    # axis lists and table are one part
    assert wrong == {file.replace("temp_comp_1.lis", "temp_comp_ads.txt")}


def test_a_control_that_tells_its_mode_is_asked():
    rows, whole = called("steep", "every second", 1500)
    (macro,), _ = replayed_parts("fanuc", MODELS["steep"], rows, whole=whole)
    # it falls back as the whole guard does
    assert 0.0 < np.mean(macro.answers.mode == 1) < 1.0
    assert set(macro.answers.mode.tolist()) >= {1, 2, 10}


def test_the_line_of_a_control_goes_on_where_the_model_stops():
    model = with_decided_limits(MODELS["steep"])
    rows = calls(model, 200, 5, "rarely")
    rows.positions_m[:] = [[np.nan], [-3.0]] * 100
    np.testing.assert_array_equal(places_m(model, rows)[:, 0], [0.1, *[-3.0] * 199])
    whole = reference_answers(model, rows)
    line = straight_line_um(model, rows, whole, whole)[:, 0]
    np.testing.assert_allclose(line[1:], (whole.k0_um - 3.1 * whole.slope_um_per_m)[1:, 0], rtol=0.0, atol=1e-12)
    assert np.abs(line).max() > 20.0


@pytest.mark.parametrize("target", ["c", "sinumerik", "beckhoff", "fanuc"])
def test_the_patent_model_is_exact_within_hundredths(target):
    model = read_model(PATENT)
    rows = calls(model, 1000, 9, "rarely")
    found, model = replayed_parts(target, model, rows)
    for one in differences(found, model):
        assert one.max_abs_difference_um <= one.allowed_um <= 0.051
