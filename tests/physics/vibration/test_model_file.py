"""Vibration model files: what they say, and that every mistake is refused with its key."""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.errors import ModelFileError
from selector.physics.model_text import plain_values
from selector.physics.vibration.chains import Chain
from selector.physics.vibration.model_file import (
    checked_model_file,
    file_shafts,
    file_structure,
    mean_rpm,
    parsed_model_file,
    read_model_file,
)
from selector.physics.vibration.structure import Joint, Line, Member
from selector.physics.vibration.vibration_model import vibration_model
from tests.physics.vibration.model_values import SMALL, changed

FIXTURES = Path(__file__).resolve().parents[3] / "fixtures" / "vibration"

EXTRA = {"name": "x", "range": "low", "sources": ["motor"], "path": ["bed"], "final": "tool"}
CORNERS = [[0.0, 600.0], [0.25, 1200.0], [0.5, 1200.0]]


def test_sections_are_the_values_of_the_structure():
    file = checked_model_file(SMALL)
    structure, chains = file_structure(file), vibration_model(file).chains
    assert structure.members == (Member("workpiece", 20.0), Member("tool", 5.0), Member("bed", 800.0))
    assert structure.joints[1] == Joint(("tool", "bed"), 1e8, 0.25)
    # a text stands for a group of one, and so does an array of one
    assert chains[0] == Chain("low", "low", ("spindle",), (("workpiece",), ("bed",)), "workpiece")
    assert chains[2].branch == (("tool",),)
    assert chains[1].held == "bed"
    assert vibration_model(file).sources[0].lines[1] == Line(order=9.3, force_n=20.0, phase_rad=0.7)
    cut = vibration_model(file).cutting({"spindle": 1200.0})
    # pi * 60 mm * 1200 r/min, exact but for rounding
    assert cut.speed_m_per_min == pytest.approx(math.pi * 0.06 * 1200.0, rel=1e-14)
    assert (file.realisations.phases, file.run.method, file.surface.roughness_below_mm) == (4, "coupled", 0.8)


def test_a_shaft_that_follows_turns_by_its_ratio_and_a_recorded_leader_takes_it_along():
    file = checked_model_file(changed(("shafts.spindle.rpm", CORNERS), ("shafts.third", {"of": "motor"})))
    courses = file_shafts(file)
    assert courses["motor"].rpm.tolist() == [900.0, 1800.0, 1800.0]
    assert courses["third"].rpm.tolist() == [900.0, 1800.0, 1800.0]
    # a ramp over the first half of the run, level over the second: (900 + 1200) / 2, exact but for rounding
    assert mean_rpm(courses["spindle"], 0.0, 0.5) == pytest.approx(1050.0, rel=1e-12)
    replaced = file_shafts(file, {"spindle": courses["motor"]})
    assert replaced["third"].rpm.tolist() == [1350.0, 2700.0, 2700.0]
    assert file_shafts(file, {"motor": courses["spindle"]})["third"].rpm.tolist() == [600.0, 1200.0, 1200.0]


def test_plain_values_make_the_same_file_again():
    for path in sorted(FIXTURES.glob("*.toml")):
        file = read_model_file(path)
        assert checked_model_file(plain_values(file)) == file


def test_the_lathe_has_the_members_sources_and_chains_of_the_paper():
    file = read_model_file(FIXTURES / "lathe.toml")
    assert (len(file.members), list(file.sources)) == (16, ["IK1", "IK2", "IK3", "IK4", "IK5"])
    names = [chain.name for chain in file.chains]
    assert names == [f"high {n}" for n in range(1, 7)] + [f"low {n}" for n in range(1, 9)]
    ends = {
        (chain.range, source, chain.final): chain.name
        for chain in vibration_model(file).chains
        for source in chain.sources
    }
    # printed: the high frequencies of IK2, IK3 and IK5 do not reach the tool, those of IK4 not the workpiece
    assert {key[1:] for key in ends if key[0] == "high"} == {
        ("IK1", "workpiece"), ("IK2", "workpiece"), ("IK3", "workpiece"), ("IK5", "workpiece"), ("IK1", "tool"),
        ("IK4", "tool"),
    }  # fmt: skip
    softest = sorted(joint.stiffness_n_per_m for joint in file.joints)
    barrier = [joint for joint in file.joints if "bed" in joint.between and joint.stiffness_n_per_m < 1e8]
    # the lower slide and its screw, ten times softer than the next joint
    assert {joint.between[0] for joint in barrier} == {"lower slide", "longitudinal screw"}
    assert softest[2] >= 10.0 * softest[1]


MISTAKES = {
    "zero stiffness": ([("joints.0.stiffness_n_per_m", 0.0)], "joints[1].stiffness_n_per_m"),
    "negative stiffness": ([("joints.0.stiffness_n_per_m", -1.0)], "joints[1].stiffness_n_per_m"),
    "negative psi": ([("joints.1.dissipation", -0.1)], "joints[2].dissipation"),
    "zero mass": ([("members.tool.mass_kg", 0.0)], "members.tool.mass_kg"),
    "infinite mass": ([("members.tool.mass_kg", math.inf)], "members.tool.mass_kg"),
    "NaN": ([("members.tool.mass_kg", math.nan)], "members.tool.mass_kg"),
    "a text": ([("members.tool.mass_kg", "5 kg")], "members.tool.mass_kg"),
    "the ground as member": ([("members.ground", {"mass_kg": 1.0})], "members.ground"),
    "unknown member in a joint": ([("joints.0.between", ["workpiece", "bad"])], "joints[1].between[2]"),
    "a joint with itself": ([("joints.0.between", ["bed", "bed"])], "joints[1].between"),
    "three members in a joint": ([("joints.0.between", ["bed", "tool", "workpiece"])], "joints[1].between"),
    "loose members": ([("joints.2", ...)], "joints"),
    "no joint": ([("joints", [])], "joints"),
    "feed 0": ([("cutting.feed_mm_per_rev", 0.0)], "cutting.feed_mm_per_rev"),
    "diameter 0": ([("cutting.diameter_mm", 0.0)], "cutting.diameter_mm"),
    "exponent 0": ([("cutting.depth_exponent", 0.0)], "cutting.depth_exponent"),
    "cut without shaft": ([("cutting.shaft", ...)], "cutting.shaft"),
    "cut with an unknown shaft": ([("cutting.shaft", "spindel")], "cutting.shaft"),
    "unknown member in a source": ([("sources.motor.member", "bde")], "sources.motor.member"),
    "unknown member against": ([("sources.motor.against", "bde")], "sources.motor.against"),
    "pushing itself": ([("sources.motor.against", "bed")], "sources.motor.against"),
    "unknown shaft": ([("sources.motor.shaft", "motr")], "sources.motor.shaft"),
    "orders without shaft": ([("sources.motor.shaft", ...)], "sources.motor.shaft"),
    "no lines": ([("sources.motor.lines", [])], "sources.motor.lines"),
    "a line without force": ([("sources.motor.lines.0.force_n", 0.0)], "sources.motor.lines[1].force_n"),
    "negative force": ([("sources.motor.lines.0.force_n", -1.0)], "sources.motor.lines[1].force_n"),
    "frequency and order": ([("sources.motor.lines.0.order", 1.0)], "sources.motor.lines[1].frequency_hz"),
    "neither": ([("sources.motor.lines.0.frequency_hz", ...)], "sources.motor.lines[1].frequency_hz"),
    "aliased frequency": ([("sources.motor.lines.0.frequency_hz", 500.0)], "sources.motor.lines[1].frequency_hz"),
    "aliased order": ([("sources.spindle.lines.1.order", 25.0)], "sources.spindle.lines[2].order"),
    "aliased in the run-up": (
        [("shafts.spindle.rpm", [[0.0, 600.0], [0.5, 6000.0]])],
        "sources.spindle.lines[2].order",
    ),
    "unknown member in a chain": ([("chains.0.path", ["workpiece", "bde"])], "chains[1].path[2]"),
    "unknown member held": ([("chains.1.held", "bde")], "chains[2].held"),
    "unknown source in a chain": ([("chains.0.sources", ["IK9"])], "chains[1].sources[1]"),
    "no way": ([("chains.0.path", ["workpiece"])], "chains[1].path"),
    "no way to the branch": ([("chains.0.path", ["workpiece", "tool"])], "chains[1].path"),
    "a member twice": ([("chains.0.path", ["workpiece", ["bed", "workpiece"]])], "chains[1].path"),
    "no path": ([("chains.0.path", [])], "chains[1].path"),
    "an empty group": ([("chains.0.path", ["workpiece", []])], "chains[1].path[2]"),
    "final elsewhere": ([("chains.0.final", "tool")], "chains[1].final"),
    "final no final": ([("chains.2.final", "bed"), ("chains.2.branch", [])], "chains[3].final"),
    "merged source": ([("chains.0.path", [["workpiece", "tool", "bed"]])], "chains[1].sources"),
    "a source elsewhere": ([("chains.0.sources", ["motor"])], "chains[1].sources"),
    "a chain twice": ([("chains.2.name", "low")], "chains[3].name"),
    "an unknown range": ([("chains.0.range", "middle")], "chains[1].range"),
    "both ranges without a cut": ([("cutting", ...)], "cutting"),
    "chains method without chains": ([("chains", ...), ("run.method", "chains")], "run.method"),
    "an unknown method": ([("run.method", "exact")], "run.method"),
    "rpm and of": ([("shafts.motor.rpm", 100.0)], "shafts.motor"),
    "neither rpm nor of": ([("shafts.spindle.rpm", ...)], "shafts.spindle"),
    "ratio without of": ([("shafts.spindle.ratio", 2.0)], "shafts.spindle.ratio"),
    "a shaft of none": ([("shafts.motor.of", "spin")], "shafts.motor.of"),
    "shafts in a circle": ([("shafts.spindle", {"of": "motor", "ratio": 2.0})], "shafts.spindle.of"),
    "standing shaft": ([("shafts.spindle.rpm", 0.0)], "shafts.spindle.rpm"),
    "always standing": ([("shafts.spindle.rpm", [[0.0, 0.0], [0.4, 0.0]])], "shafts.spindle.rpm"),
    "negative speed": ([("shafts.spindle.rpm", -1200.0)], "shafts.spindle.rpm"),
    "corners out of order": ([("shafts.spindle.rpm", [[0.0, 1.0], [0.0, 2.0]])], "shafts.spindle.rpm"),
    "corners that begin late": ([("shafts.spindle.rpm", [[1.0, 1.0], [2.0, 2.0]])], "shafts.spindle.rpm"),
    "one corner": ([("shafts.spindle.rpm", [[0.0, 1.0]])], "shafts.spindle.rpm"),
    "negative speed in a corner": ([("shafts.spindle.rpm", [[0.0, 1.0], [1.0, -2.0]])], "shafts.spindle.rpm[2][2]"),
    "unknown final": ([("finals", {"tool": "tol"})], "finals.tool"),
    "one final twice": ([("finals", {"tool": "workpiece"})], "finals.workpiece"),
    "negative noise": ([("sensing", {"noise_um": -1.0})], "sensing.noise_um"),
    "no phase": ([("realisations", {"phases": 0})], "realisations.phases"),
    "a long run": ([("run.duration_s", 1e5)], "run.duration_s"),
    "a short run": ([("run.duration_s", 0.002)], "run.duration_s"),
    "no period": ([("run.period_s", ...)], "run.period_s"),
    "bounds exchanged": ([("bounds", {"members.tool.mass_kg": [9.0, 1.0]})], "bounds"),
    "unknown key": ([("sources.motor.agianst", "bed")], "sources.motor.agianst"),
    "unknown section": ([("jonts", [])], "jonts"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_refused_with_their_key(name):
    changes, key = MISTAKES[name]
    with pytest.raises(ModelFileError) as refused:
        checked_model_file(changed(*changes), where="a.toml")
    assert refused.value.where.startswith(f"a.toml, key {key}"), refused.value
    assert all((refused.value.found, refused.value.expected, refused.value.advice))


def test_huge_counts_are_refused():
    lines = [{"frequency_hz": 1.0 + n / 100.0, "force_n": 1.0} for n in range(1500)]
    many = changed(("sources.motor.lines", lines), ("sources.spindle.lines", lines))
    with pytest.raises(ModelFileError, match=r"sources: 3000 lines.*at most 2000"):
        checked_model_file(many)
    with pytest.raises(ModelFileError, match=r"key members.* 200\b"):
        checked_model_file(changed(("members", {f"m{n}": {"mass_kg": 1.0} for n in range(201)})))
    with pytest.raises(ModelFileError, match=r"\(1502 lines"):
        checked_model_file(changed(("sources.motor.lines", lines), ("run.duration_s", 500.0)))


def test_counts_just_beyond_what_is_allowed_are_told_in_full():
    with pytest.raises(ModelFileError) as refused:
        checked_model_file(changed(("run.duration_s", 2000.001)))
    assert (refused.value.found, refused.value.expected) == ("2000001 samples", "at most 2000000")


def test_a_line_too_fast_for_any_period_is_told_what_makes_it_slower():
    shafts = {"spindle": {"rpm": 1200.0}, "b": {"of": "spindle", "ratio": 1e4}, "motor": {"of": "b", "ratio": 1e4}}
    with pytest.raises(ModelFileError) as refused:
        checked_model_file(changed(("shafts", shafts)))
    assert "run.period_s" not in refused.value.advice.partition(":")[0]
    assert all(word in refused.value.advice for word in ("order", "rpm", "ratio"))
    with pytest.raises(ModelFileError) as refused:
        checked_model_file(changed(("sources.motor.lines.0.frequency_hz", 1e6)))
    assert "run.period_s" in refused.value.advice
    assert "5e-07" in refused.value.advice


def test_another_kind_of_model_is_told_where_it_belongs():
    with pytest.raises(ModelFileError, match="simulate drive"):
        parsed_model_file('[model]\nkind = "drive"\nname = "x"')


@given(st.sets(st.sampled_from(sorted(MISTAKES)), min_size=2, max_size=4))
def test_several_mistakes_at_once_are_no_defect_of_the_program(names):
    """Whatever two of them make together, it is a file or an error of a file: nothing else comes out."""
    values = SMALL
    with suppress(KeyError, IndexError, TypeError):  # one of them took away what the next one changes
        values = changed(*(change for name in names for change in MISTAKES[name][0]))
    with suppress(ModelFileError):
        checked_model_file(values)
