"""Whether a program that is called verified is the one that was tested, and what a control without a guard is told."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from selector.cli import exit_status
from selector.controllers import Input, ModelFile, Output, Term
from selector.controllers.guard.decided import is_turned, with_turned_signs
from selector.controllers.model_file import equations_sha256, kept_sha256, read_model, write_model
from selector.controllers.self_check import sealed
from selector.controllers.writers.targets import TARGETS

PATENT = Path(__file__).parents[2] / "fixtures" / "models" / "patent-two-sensors.json"

EQUATIONS = equations_sha256(read_model(PATENT))


def told(capsys, *arguments: object) -> dict[str, dict]:
    """Findings of an export by their id."""
    assert exit_status(["export", *map(str, arguments), "--json"]) == 0
    return {finding["id"]: finding for finding in json.loads(capsys.readouterr().out)["findings"]}


def refused(capsys, *arguments: object) -> str:
    assert exit_status(["export", *map(str, arguments)]) == 2
    return capsys.readouterr().err


def head_of(folder: Path) -> str:
    """Equations SHA-256 in the head of a program."""
    return re.search("SHA-256 ([0-9a-f]{64})", (folder / "thermal_correction.py").read_text())[1]


def test_the_same_words_give_the_same_program_from_the_model_and_from_its_copy(tmp_path, capsys):
    first, second = tmp_path / "first", tmp_path / "second"
    told(capsys, PATENT, "--for", "python", "--invert", "Z", "--out", first)
    found = told(capsys, first / "model.json", "--for", "python", "--invert", "Z", "--out", second)
    assert "sign-turned" in found
    assert (first / "thermal_correction.py").read_bytes() == (second / "thermal_correction.py").read_bytes()


def test_only_the_tested_program_is_called_verified(tmp_path, capsys):
    tested = tmp_path / "tested"
    found = told(capsys, PATENT, "--for", "python", "--invert", "Z", "--out", tested)
    digits = f"python:{head_of(tested)[:16]}"
    assert f"--tested {digits}" in found["sign-unverified"]["suggestion"]
    assert f"--tested {digits}" in (tested / "commissioning.html").read_text(encoding="utf-8")
    # the screen says it first, whatever it leaves out below
    assert exit_status(["export", str(PATENT), "--for", "python", "--invert", "Z", "--out", str(tested)]) == 0
    assert f"--tested {digits}" in " ".join(capsys.readouterr().out.partition("warning:")[0].split())
    # who forgets --invert would get the other sign
    out = tmp_path / "out"
    said = refused(capsys, PATENT, "--for", "python", "--out", out, "--sign-verified", "--tested", digits)
    assert digits in said
    assert "--invert" in said
    assert not out.exists()
    found = told(
        capsys, PATENT, "--for", "python", "--out", out, "--invert", "Z", "--sign-verified", "--tested", digits
    )
    assert not {"sign-unverified", "sign-taken-on-trust"} & set(found)
    # another clamp has the same equations
    told(capsys, PATENT, "--for", "python", "--out", out, "--invert", "Z", "--clamp", "Z=20", "--sign-verified",
         "--tested", digits)  # fmt: skip


@pytest.mark.parametrize(
    "digits", ["0", "0123456", "nonsense", EQUATIONS[:16], f"st:{EQUATIONS[:16]}", f"python:{EQUATIONS[:7]}"]
)
def test_digits_that_say_nothing_are_refused(tmp_path, capsys, digits):
    said = refused(capsys, PATENT, "--for", "python", "--out", tmp_path / "out", "--sign-verified", "--tested", digits)
    assert equations_sha256(read_model(PATENT)) in said.replace("\n", "").replace(" ", "")


def test_a_test_without_its_result_is_refused(tmp_path, capsys):
    digits = equations_sha256(read_model(PATENT))[:16]
    assert "--sign-verified" in refused(
        capsys, PATENT, "--for", "python", "--out", tmp_path / "out", "--tested", digits
    )


def test_trust_is_told(tmp_path, capsys):
    found = told(capsys, PATENT, "--for", "python", "--out", tmp_path / "out", "--sign-verified")
    assert found["sign-taken-on-trust"]["evidence"] == {"equations_sha256": head_of(tmp_path / "out")}


@pytest.mark.parametrize("target", sorted(set(TARGETS) - {"rexroth"}))
def test_what_to_do_about_the_other_sign_is_never_the_same_again(target):
    model = read_model(PATENT)
    straight = TARGETS[target].write(model).sign_test.wrong
    assert straight.startswith("of Z, Y: ")
    assert "--invert" in straight
    mixed = TARGETS[target].write(with_turned_signs(model, ["Z"])).sign_test.wrong
    assert re.search(r"\bof Y: [^;.]*--invert", mixed)
    assert re.search(r"\bof Z: [^;.]*already", mixed)


def test_kept_readings_are_as_good_with_the_other_sign():
    model = read_model(PATENT)
    turned = with_turned_signs(model, ["Z"])
    assert [is_turned(output) for output in turned.outputs] == [True, False]
    assert equations_sha256(turned) != equations_sha256(model)
    assert kept_sha256(turned) == kept_sha256(model)
    other = model.model_copy(update={"outputs": model.outputs[:1]})
    assert kept_sha256(other) != kept_sha256(model)


def test_show_tells_the_sign(tmp_path, capsys):
    write_model(with_turned_signs(read_model(PATENT), ["Y"]), tmp_path / "turned.json")
    assert exit_status(["model", "show", str(tmp_path / "turned.json")]) == 0
    assert "Y: turned" in capsys.readouterr().out


@pytest.fixture
def drive(tmp_path) -> Path:
    model = ModelFile(
        name="screw",
        inputs=(Input(name="T", reference="absolute", valid_min=15.0, valid_max=35.0, rate_limit_per_min=2.0),),
        outputs=(Output(name="Z", axis="Z", intercept=-46.0, terms=(Term(powers={"T": 1}, coefficient=2.0),)),),
    )
    write_model(model, tmp_path / "screw.json")
    return tmp_path / "screw.json"


def test_no_limits_are_promised_where_there_are_none(drive, tmp_path, capsys):
    out = tmp_path / "out"
    found = told(capsys, drive, "--for", "rexroth", "--out", out)
    assert "guard-missing" in found
    assert "limit-not-decided" not in found
    page = re.sub("<[^>]*>", " ", (out / "commissioning.html").read_text(encoding="utf-8").split("<script>")[0])
    for promise in ("largest correction of", "when a sensor breaks", "is limited to it", "Warming a sensor by hand"):
        assert promise not in page
    assert "none of them" in page
    assert "This is not a safety function." in page
    for option in ("--clamp", "--slew"):
        said = refused(capsys, drive, "--for", "rexroth", "--out", tmp_path / "other", option, "Z=20")
        assert option in said
    assert not (tmp_path / "other").exists()


def test_limits_are_promised_where_there_are_some(drive, tmp_path, capsys):
    out = tmp_path / "out"
    assert "limit-not-decided" in told(capsys, drive, "--for", "st", "--out", out)
    page = (out / "commissioning.html").read_text(encoding="utf-8")
    assert page.count("This is not a safety function.") == 1
    for promise in ("largest correction of Z", "when a sensor breaks", "is limited to it", "Warming a sensor by hand"):
        assert promise in page


def test_a_fallback_for_another_place_of_the_axis_is_refused():
    from tests.controllers import hostile

    content = hostile.model().model_dump(by_alias=True)
    output = next(item for item in content["fallbacks"][0]["outputs"] if item["position"] is not None)
    output["position"]["reference_m"] += 0.1
    with pytest.raises(ValueError, match="as the model has"):
        ModelFile.model_validate(content)


def test_limits_and_sign_may_be_those_of_an_axis(tmp_path, capsys):
    model = read_model(PATENT)
    named = model.model_copy(
        update={
            "outputs": tuple(of.model_copy(update={"name": f"Verlagerung {of.name}"}) for of in model.outputs),
            "guard": model.guard.model_copy(update={"limits": ()}), "validation": {}, "test_vectors": (),
            "guard_vectors": None, "fallbacks": (),
        }
    )  # fmt: skip
    write_model(sealed(named), tmp_path / "model.json")
    asked = [tmp_path / "model.json", "--for", "python", "--out", tmp_path / "out"]
    told(capsys, *asked, "--clamp", "Z=40", "--slew", "z=0.5", "--invert", "Z")
    made = read_model(tmp_path / "out" / "model.json")
    limits = {one.output: (one.clamp_um, one.slew_um_per_s) for one in made.guard.limits}
    assert limits["Verlagerung Z"] == (40.0, 0.5)
    assert [is_turned(output) for output in made.outputs] == [of.axis == "Z" for of in made.outputs]
    assert "one of Verlagerung Z, Verlagerung Y" in refused(capsys, *asked, "--slew", "X=1")
    # which of the two was meant for the axis nobody knows
    twice = refused(capsys, *asked, "--slew", "Z=1", "--slew", "Verlagerung Z=2")
    assert "'Z' and 'Verlagerung Z'" in twice
