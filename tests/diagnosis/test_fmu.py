"""Mode B with a functional mock-up unit: built here by the C compiler, driven by recordings, its parameter refitted."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile

import numpy as np
import pandas as pd
import pytest

from selector.diagnosis.open_model.refitting import refitted
from selector.errors import InputError, ReadError
from selector.recording import Channel, Recording

pytest.importorskip("fmpy", reason="FMPy is not installed (extra fmu)")
COMPILER = shutil.which("cc") or shutil.which("gcc")
pytestmark = pytest.mark.skipif(
    COMPILER is None or not sys.platform.startswith("linux"), reason="needs a C compiler on Linux to build the unit"
)

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="lag" guid="{lag}">
  <CoSimulation modelIdentifier="lag" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="heat" valueReference="0" causality="input" variability="continuous"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="Z" valueReference="1" causality="output" variability="continuous"><Real/></ScalarVariable>
    <ScalarVariable name="tau" valueReference="2" causality="parameter" variability="fixed"><Real start="900" min="100" max="9000" unit="s"/></ScalarVariable>
    <ScalarVariable name="gain" valueReference="3" causality="parameter" variability="fixed"><Real start="2" min="0.1" max="20"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>
"""  # noqa: E501
SOURCE = r"""
#include <math.h>
#include <stdlib.h>
typedef struct { double v[4]; } Unit;
const char* fmi2GetTypesPlatform(void) { return "default"; }
const char* fmi2GetVersion(void) { return "2.0"; }
int fmi2SetDebugLogging(void* c, int on, size_t n, const char* const* k) { return 0; }
void* fmi2Instantiate(const char* a, int t, const char* g, const char* r, const void* f, int v, int l) {
  Unit* u = calloc(1, sizeof(Unit)); u->v[2] = 900.0; u->v[3] = 2.0; return u; }
void fmi2FreeInstance(void* c) { free(c); }
int fmi2SetupExperiment(void* c, int d, double t, double s, int e, double z) { return 0; }
int fmi2EnterInitializationMode(void* c) { return 0; }
int fmi2ExitInitializationMode(void* c) { return 0; }
int fmi2Terminate(void* c) { return 0; }
int fmi2Reset(void* c) { return 0; }
int fmi2GetReal(void* c, const unsigned* r, size_t n, double* x) {
  for (size_t i = 0; i < n; i++) x[i] = ((Unit*)c)->v[r[i]]; return 0; }
int fmi2SetReal(void* c, const unsigned* r, size_t n, const double* x) {
  for (size_t i = 0; i < n; i++) ((Unit*)c)->v[r[i]] = x[i]; return 0; }
int fmi2DoStep(void* c, double t, double h, int no) {
  Unit* u = c; double e = exp(-h / u->v[2]); u->v[1] = e * u->v[1] + (1.0 - e) * u->v[3] * u->v[0]; return 0; }
int fmi2CancelStep(void* c) { return 0; }
"""
_UNUSED = ("GetInteger", "GetBoolean", "GetString", "SetInteger", "SetBoolean", "SetString")


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    folder = tmp_path_factory.mktemp("unit")
    more = "".join(
        f"int fmi2{name}(void* c, const unsigned* r, size_t n, void* x) {{ return 0; }}\n" for name in _UNUSED
    )
    states = "".join(
        f"int fmi2{name}(void) {{ return 3; }}\n"
        for name in (
            "GetFMUstate", "SetFMUstate", "FreeFMUstate", "SerializedFMUstateSize", "SerializeFMUstate",
            "DeSerializeFMUstate", "GetDirectionalDerivative", "SetRealInputDerivatives", "GetRealOutputDerivatives",
            "GetStatus", "GetRealStatus", "GetIntegerStatus", "GetBooleanStatus", "GetStringStatus",
        )
    )  # fmt: skip
    (folder / "lag.c").write_text(SOURCE + more + states)
    subprocess.run([COMPILER, "-shared", "-fPIC", "-O1", "-o", "lag.so", "lag.c", "-lm"], cwd=folder, check=True)
    with zipfile.ZipFile(folder / "lag.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.write(folder / "lag.so", "binaries/linux64/lag.so")
    return folder / "lag.fmu"


def recording(tau_s=1500.0, gain=3.0, name="heat"):
    random = np.random.default_rng(2)
    tables = {}
    for run in ("r0", "r1"):
        heat = np.repeat(random.choice([0.0, 4.0, 8.0], 8), 30)
        z = np.zeros(240)
        for k in range(1, 240):
            e = np.exp(-60.0 / tau_s)
            z[k] = e * z[k - 1] + (1.0 - e) * gain * heat[k - 1]
        index = pd.Index(60.0 * np.arange(240.0), name="time_s")
        tables[run] = pd.DataFrame({name: heat, "Z": z + random.normal(scale=0.1, size=240)}, index)
    channels = (Channel(name, "state", "1"), Channel("Z", "displacement", "um", axis="Z"))
    return Recording.from_runs(tables, channels, {})


def test_a_unit_is_refitted(unit):
    from selector.diagnosis.open_model.runnable import fmu_model

    there = recording()
    with fmu_model(unit, there) as model:
        assert model.mode == "B"
        assert model.bounded == {"tau", "gain"}
        found = refitted(model, there)
    # a step of heat between two samples is read as a line, which delays it by some seconds: 3 % of 1500 s
    assert found.values["tau"] == pytest.approx(1500.0, rel=0.05)
    assert found.values["gain"] == pytest.approx(3.0, rel=0.03)
    assert list(found.comparison.responses) == ["Z"]


def test_an_input_that_was_not_recorded_is_named(unit):
    from selector.diagnosis.open_model.runnable import fmu_model

    with pytest.raises(InputError, match="'heat'"), fmu_model(unit, recording(name="power")):
        pass


def test_what_is_no_unit_is_refused(tmp_path):
    from selector.diagnosis.open_model.runnable import fmu_model

    path = tmp_path / "text.fmu"
    path.write_text("no zip")
    with pytest.raises(ReadError, match=r"text\.fmu"), fmu_model(path, recording()):
        pass
