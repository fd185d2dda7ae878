"""`selector export --replay`: every written file is executed and told; names that nobody sane would give do no harm."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector import exporting
from selector.cli import exit_status
from selector.controllers import Guard, Input, ModelFile, Output, OutputLimits, Term
from selector.controllers.c_compiler import compiler
from selector.controllers.model_file import write_model
from selector.controllers.replay import replayed
from tests.controllers.golden_text import texts_of

ROOT = Path(__file__).parents[2]
PATENT = ROOT / "fixtures" / "models" / "patent-two-sensors.json"
PATENT8 = ROOT / "fixtures" / "patent8"
needs_cc = pytest.mark.skipif(compiler() is None, reason="no C compiler; Debian: apt install gcc")
needs_parser = pytest.mark.skipif(find_spec("tree_sitter_iec61131_3_st") is None, reason='pip install ".[controls]"')
SAVED = ["model.json", "commissioning.html"]


def exported(capsys, model: Path, target: str, out: Path, run: Path, machine: Path) -> dict:
    arguments = ["export", model, "--for", target, "--out", out, "--replay", run, "--machine", machine, "--json"]
    assert exit_status([*map(str, arguments)]) == 0
    return json.loads(capsys.readouterr().out)


def folder_of(
    folder: Path,
    names: tuple[str, ...] = ("T1",),
    axis: str = "Z",
    broken: slice = slice(0),
    samples: int = 300,
    **guard: object,
) -> tuple[Path, Path, Path]:
    """A model of temperatures, called like all of them, a recording of them, and its machine file."""
    folder.mkdir(exist_ok=True)
    limits = (OutputLimits(output="Z", clamp_um=100.0, slew_um_per_s=2.0),)
    inputs = tuple(
        Input(name=name, reference="absolute", valid_min=15.0, valid_max=40.0, centre=25.0, scale=2.0) for name in names
    )
    terms = tuple(Term(powers={name: 1}, coefficient=3.0) for name in names)
    model = ModelFile(
        name=" ".join(names)[:100], inputs=inputs, outputs=(Output(name="Z", axis=axis, intercept=0.1, terms=terms),),
        guard=Guard.model_validate({"limits": limits, **guard}),
    )  # fmt: skip
    write_model(model, folder / "the model.json")
    time_s = 10.0 * np.arange(samples)
    reading = 20.0 + 9.0 * (1.0 - np.exp(-time_s / 900.0))
    reading[broken] = np.nan
    pd.DataFrame({"time_s": time_s, **dict.fromkeys(names, reading)}).to_csv(folder / "a run.csv", index=False)
    channels = "".join(
        f'[channels.{json.dumps(name, ensure_ascii=False)}]\nrole = "temperature"\nunit = "degC"\n' for name in names
    )
    (folder / "ma chine.toml").write_text(f'[time]\ncolumn = "time_s"\nunit = "s"\n{channels}', encoding="utf-8")
    return folder / "the model.json", folder / "a run.csv", folder / "ma chine.toml"


def found_ids(said: dict, level: str) -> list[str]:
    return [finding["id"] for finding in said["findings"] if finding["level"] == level]


@needs_cc
def test_every_file_of_c_is_executed_and_told(tmp_path, capsys):
    out = tmp_path / "out"
    said = exported(capsys, PATENT, "c", out, PATENT8 / "recording.csv", PATENT8 / "machine.toml")
    parts = said["replay"]["parts"]
    files = [f"thermal_correction{ending}.c" for ending in ("", "_f")]
    assert [(part["file"], part["output"]) for part in parts] == [(file, o) for file in files for o in ("Z", "Y")]
    own = {"file", "output", "executed_by", "max_abs_difference_um", "allowed_um", "guard_difference_um"}
    assert all(set(part) == own for part in parts)
    assert all(part["max_abs_difference_um"] <= part["allowed_um"] for part in parts)
    assert said["replay"]["max_abs_difference_um"] == parts[2]["max_abs_difference_um"] == 0.0
    assert 0.0 < parts[2]["guard_difference_um"] < 1e-4
    assert "single-precision-bound" in found_ids(said, "info")
    assert "Single precision" in (out / "thermal_correction_f.c").read_text()
    page = (out / "commissioning.html").read_text(encoding="utf-8")
    assert page.count("thermal_correction_f.c") >= 4
    assert "roundings" in page


@needs_parser
@pytest.mark.parametrize(
    ("target", "files"),
    [
        ("sinumerik", ["thermal_correction.scl", "thermal_to_sd.scl"]),
        ("beckhoff", ["FB_ThermalCorrection.TcPOU", "temp_comp_ads.txt"]),
    ],
)
def test_what_turns_um_into_the_units_of_a_control_is_executed(tmp_path, capsys, target, files):
    said = exported(capsys, PATENT, target, tmp_path / "out", PATENT8 / "recording.csv", PATENT8 / "machine.toml")
    assert [part["file"] for part in said["replay"]["parts"]] == [file for file in files for _ in ("Z", "Y")]
    assert "replay-differs" not in found_ids(said, "error")


@needs_cc
def test_a_second_file_that_differs_is_an_error_with_numbers(tmp_path, capsys, monkeypatch):
    honest = exporting.TARGETS["c"]

    def lying(model, *, is_sign_verified=False):
        files = dict(honest.write(model, is_sign_verified=is_sign_verified).files)
        files["thermal_correction_f.c"] = files["thermal_correction_f.c"].replace("m->k0_1;", "1.01f * m->k0_1;")
        return replace(honest.write(model), files=files)

    monkeypatch.setattr(exporting, "TARGETS", {"c": replace(honest, write=lying)})
    said = exported(capsys, PATENT, "c", tmp_path / "out", PATENT8 / "recording.csv", PATENT8 / "machine.toml")
    assert said["replay"]["max_abs_difference_um"] == 0.0
    (finding,) = [one for one in said["findings"] if one["id"] == "replay-differs"]
    assert (finding["level"], finding["evidence"]["file"]) == ("error", "thermal_correction_f.c")
    assert finding["evidence"]["max_abs_difference_um"] > 0.1 > finding["evidence"]["allowed_um"]


def test_the_macro_holds_and_ramps_as_the_whole_guard(tmp_path, capsys):
    model, run, machine = folder_of(tmp_path / "f", broken=slice(100, 130), recover_after_s=300.0, hold_at_most_s=100.0)
    said = exported(capsys, model, "fanuc", tmp_path / "out", run, machine)
    (part,) = said["replay"]["parts"]
    assert part["max_abs_difference_um"] <= part["allowed_um"] < 1e-6
    assert part["guard_difference_um"] < 1e-6
    # it waits 300 s more, and 300 s at the start, which is no fault: 30 + 30 of 300 samples
    (share,) = [one["evidence"]["share_of_samples"] for one in said["findings"] if one["id"] == "not-the-whole-model"]
    assert share == 0.2


def test_a_drive_follows_whatever_it_reads_and_is_told_so(tmp_path, capsys):
    model, run, machine = folder_of(tmp_path / "f", broken=slice(100, 130), recover_after_s=0.0)
    said = exported(capsys, model, "rexroth", tmp_path / "out", run, machine)
    assert said["replay"]["parts"][0]["max_abs_difference_um"] <= said["replay"]["parts"][0]["allowed_um"] < 0.01
    (told,) = [one["statement"] for one in said["findings"] if one["id"] == "not-the-whole-model"]
    assert "followed" in told


@pytest.mark.parametrize(("target", "did"), [("fanuc", "took the end of the range"), ("rexroth", "extrapolates")])
def test_readings_beyond_the_valid_range_are_told(tmp_path, capsys, target, did):
    model, run, machine = folder_of(tmp_path / "f", recover_after_s=0.0)
    table = pd.read_csv(run)
    table.loc[150:, "T1"] += 15.0
    table.to_csv(run, index=False)
    said = exported(capsys, model, target, tmp_path / "out", run, machine)
    (told,) = [one for one in said["findings"] if one["id"] == "outside-valid-range"]
    assert told["level"] == "warning"
    assert told["where"]["channel"] == "T1"
    assert told["evidence"]["share_of_samples"] == pytest.approx(0.5, abs=0.05)
    assert did in told["statement"]


#: Names of one model; `name` of the model itself takes 100 characters of them.
NAMES = {
    "comments": ("T*) x := 1; (*", "a??/", "what?", "[red]T[/red]", "Tä °µ 温度", "a;b,c", "a\\"),
    "quotes": ("T'1\"x", "T*/ int x; /*", "../../x", "??", "$(x)`x`", "# x"),
    "markup": ("<script>alert(1)</script>", "]]>", "50% {x}", "L" * 100),
}
ONE_SENSOR = ("rexroth",)
"""Controls that take one thermometer an axis."""


@needs_cc
@needs_parser
@pytest.mark.parametrize("kind", NAMES)
def test_hostile_names_do_no_harm(tmp_path, capsys, monkeypatch, kind):
    for target in ("c", *sorted(set(exporting.TARGETS) - {"c", "linuxcnc"})):
        together = [(name,) for name in NAMES[kind]] if target in ONE_SENSOR else [NAMES[kind]]
        for number, names in enumerate(together):
            model, run, machine = folder_of(tmp_path / "with a blank", names, samples=40)
            out = tmp_path / f"{target}{number}"
            said = exported(capsys, model, target, out, run, machine)
            assert bool(said["replay"]["rehearsal"]) == (target == "c")
            # the sheet tells of rehearsed faults in the same words for every control
            monkeypatch.setattr(replayed, "rehearsed", lambda *_: ())
            assert said["replay"]["parts"]
            assert "replay-differs" not in found_ids(said, "error")
            written = {file: (out / file).read_bytes() for file in set(said["files"]) - set(SAVED)}
            assert all(text.isascii() for text in texts_of(written).values())
            assert "<script>alert" not in (out / "commissioning.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["=1+1", "+1+1", "-2", "@SUM(1)", "Z]=9"])
def test_an_axis_that_no_nc_can_have_is_refused_and_nothing_written(tmp_path, capsys, name):
    model, _, _ = folder_of(tmp_path / "f", axis=name)
    assert exit_status(["export", str(model), "--for", "sinumerik", "--out", str(tmp_path / "out")]) == 2
    assert "outputs.axis" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
