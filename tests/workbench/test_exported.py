"""Files of an export that was asked otherwise than the form asks now are told, in the words of the fields."""

from __future__ import annotations

import dataclasses
import json
from types import SimpleNamespace

import pytest
from dash import html
from plotly.utils import PlotlyJSONEncoder
from typer.testing import CliRunner

from selector.cli import app
from selector.controllers import read_model
from selector.controllers.writers.targets import TARGETS
from selector.readers import Overrides
from selector.shipped import shipped
from selector.workbench.bench import Bench
from selector.workbench.commands import Export, export_command
from selector.workbench.pages import export, selection
from selector.workbench.parts import differing_fields

PATENT = shipped("patent8")
ASKED = Export("selection/model.json", clamp_um={"Z": 40.0}, inverted=("Z",))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A study folder with a model and its export as `ASKED`."""
    folder = tmp_path_factory.mktemp("study")
    words = ["select", str(PATENT / "recording.csv"), "--machine", str(PATENT / "machine.toml"), "--response", "Z"]
    done = CliRunner().invoke(app, [*words, "--max-sensors", "2", "--out", str(folder / "selection")])
    assert done.exit_code == 0, done.output
    command = [*export_command(folder, ASKED, None, Overrides())]
    command[1], command[command.index("--out") + 1] = str(folder / ASKED.model), str(folder / ASKED.folder)
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    return folder


def test_what_was_chosen_since_the_files_were_written_is_told_in_the_words_of_the_fields(study):
    then = (*export_command(study, ASKED, None, Overrides()), "--json")

    def others(**changes):
        now = export_command(study, dataclasses.replace(ASKED, **changes), None, Overrides())
        return set(differing_fields(now, then))

    assert others() == set()
    assert others(clamp_um={"Z": 41.0}) == {"largest correction of Z"}
    assert others(slew_um_per_s={"Z": 2.0}) == {"fastest change of Z"}
    assert others(inverted=()) == {"turned round"}
    assert others(is_sign_verified=True) == {"The sign test was passed"}
    assert others(replayed=(study / "r1.csv",)) == {"the recordings to run through the program"}


def test_the_number_in_grey_is_the_one_that_counts(study):
    (limits,) = export._outputs(Bench(study), ASKED.model)
    assert limits["slew_um_per_s"] == "1 (cautious)"
    assert limits["clamp_um"] == f"{read_model(study / ASKED.model).guard.limits[0].clamp_um:g}"
    decided = json.loads((study / ASKED.folder / "model.json").read_text(encoding="utf-8"))
    place = study / ASKED.model
    before = place.read_bytes()
    place.write_text(json.dumps(decided), encoding="utf-8")
    try:
        (limits,) = export._outputs(Bench(study), ASKED.model)
        assert (limits["clamp_um"], limits["slew_um_per_s"]) == ("40", "1")
    finally:
        place.write_bytes(before)


@pytest.mark.parametrize(("target", "shown"), [("fmu", []), ("st", ["thermal_correction.st"])])
def test_programs_are_shown_as_text_but_no_archive(study, target, shown):
    asked = Export(ASKED.model, target=target)
    command = [*export_command(study, asked, None, Overrides())]
    command[1], command[command.index("--out") + 1] = str(study / asked.model), str(study / asked.folder)
    assert CliRunner().invoke(app, command).exit_code == 0
    bench = Bench(study)
    bench.export = asked
    section = export._answered(bench, "now", None)
    assert [one.children for one in section._traverse() if isinstance(one, html.Summary)] == shown
    files = [one.children for one in section._traverse() if isinstance(one, html.A)]
    assert TARGETS[target].parts[0].file in files


@pytest.mark.parametrize("is_useless", [False, True])
def test_the_report_alone_says_what_to_keep_and_a_useless_model_leads_to_no_control(study, is_useless):
    result = json.loads((study / "selection" / "selection.json").read_text())
    assert not [one for one in result["findings"] if one["id"] == "no-better-than-nothing"]
    if is_useless:
        result["findings"].append({"id": "no-better-than-nothing"})
    bench = SimpleNamespace(folder=study, result=lambda _: result)
    said = json.dumps(selection._answered(bench, "", None).to_plotly_json(), cls=PlotlyJSONEncoder)
    assert "Keep " not in said
    assert "selection/report.html" in said
    assert ("#export" in said) != is_useless
