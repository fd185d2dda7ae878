"""What is said of a vibrating structure before anybody believes it."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from selector.physics.vibration.model_file import checked_model_file, read_model_file
from selector.physics.vibration.structure import structure_modes
from selector.physics.vibration.vibration_model import vibration_model
from selector.physics.vibration.vibration_summary import CHAINS_OFF, chain_findings, model_findings
from tests.physics.vibration.model_values import changed

LATHE = Path(__file__).resolve().parents[3] / "fixtures" / "vibration" / "lathe.toml"


def model(*changes):
    return vibration_model(checked_model_file(changed(*changes)))


def said(built):
    return {one.id: one for one in model_findings(built, structure_modes(built.structure))}


def of_chains(built):
    motions = built.motions(built.shaft_rpm)
    return chain_findings(built, motions["coupled"], motions["chains"])


def test_nothing_is_odd_about_a_plausible_machine():
    assert said(model()) == {}
    assert said(vibration_model(read_model_file(LATHE))) == {}


@pytest.mark.parametrize(
    ("change", "key", "perhaps"),
    [
        (("joints.0.stiffness_n_per_m", 200.0), "joints[1].stiffness_n_per_m", 2e8),
        (("members.bed.mass_kg", 8e5), "members.bed.mass_kg", 800.0),
        (("joints.0.dissipation", 30.0), "joints[1].dissipation", 0.3),
        (("sources.spindle.lines.0.unbalance_kg_m", 100.0), "sources.spindle.lines[1].unbalance_kg_m", 1e-4),
        (("cutting.diameter_mm", 0.06), "cutting.diameter_mm", 60.0),
    ],
)
def test_slips_of_units_are_told_with_what_was_perhaps_meant(change, key, perhaps):
    found = said(model(change))["unlikely-value"]
    assert found.evidence["key"] == key
    # a product of two numbers
    assert found.evidence["perhaps"] == pytest.approx(perhaps, rel=1e-12)


def test_eigenfrequencies_that_no_machine_has_name_member_and_joint():
    high = said(model(("members.tool.mass_kg", 0.005)))["unlikely-eigenfrequency"]
    # 1e8 N/m on 5 g
    assert high.evidence["frequency_hz"] == pytest.approx(math.sqrt(1e8 / 0.005) / (2 * math.pi), rel=1e-3)
    assert (high.evidence["member"], high.evidence["joint"]) == ("tool", "the joint tool – bed")
    low = said(model(*((f"joints.{n}.stiffness_n_per_m", 1e3) for n in range(3))))["unlikely-eigenfrequency"]
    assert low.evidence["frequency_hz"] < 1.0


def test_a_line_near_a_resonance_of_little_damping_says_how_much_and_where():
    light = [(f"joints.{n}.dissipation", 0.02) for n in range(3)]
    built = model(*light, ("sources.motor.lines.0.frequency_hz", 122.0))
    resonance = float(structure_modes(built.structure).frequency_hz[0])
    found = said(built)["sharp-resonance"]
    # |λ/(λ − ω²)| of a single resonance with η = 0.02/2π
    exact = abs((1 + 0.02j / (2 * math.pi)) / (1 + 0.02j / (2 * math.pi) - (122.0 / resonance) ** 2))
    # λ = (2π·frequency)²·(1 + iη) but for terms of η², 1e-5
    assert found.evidence["amplification"] == pytest.approx(exact, rel=1e-3)
    assert exact > 30
    assert found.evidence["joint"] == "the joint bed – ground"
    # a run-up that passes the resonance meets it, wherever its mean lies
    passing = model(*light, ("sources.motor.lines.0.frequency_hz", 50.0),
                    ("shafts.spindle.rpm", [[0.0, 600.0], [0.5, 1200.0]]))  # fmt: skip
    assert said(passing)["sharp-resonance"].evidence["amplification"] == pytest.approx(2 * math.pi / 0.02, rel=1e-3)
    assert "sharp-resonance" not in said(model(*light, ("sources.motor.lines.0.frequency_hz", 50.0),
                                               ("sources.spindle.lines.1.order", 2.0)))  # fmt: skip


def test_chains_that_differ_by_more_than_a_tenth_say_by_how_much_and_where():
    built = model()
    motions = built.motions(built.shaft_rpm)
    (found,) = [one for one in of_chains(built) if one.id == "chains-off-coupled"]
    of = {one["final"]: one for one in (found.evidence, *found.evidence["others"])}
    assert found.evidence["relative"] == max(one["relative"] for one in of.values())
    # the spindle alone has a chain to the workpiece
    carried = motions["chains"].carried[1]
    assert 0 < carried.sum() < len(carried)
    exact, published = motions["coupled"].of("workpiece")[carried], motions["chains"].of("workpiece")[carried]
    off = math.sqrt((abs(published - exact) ** 2).sum() / (abs(exact) ** 2).sum())
    assert off > CHAINS_OFF
    worst = of["workpiece"]
    assert worst["relative"] == pytest.approx(off, rel=1e-12)  # rounding
    assert worst["worst_hz"] == motions["coupled"].frequency_hz[carried][abs(published - exact).argmax()]
    # no line has chains to both
    assert "tool_workpiece" not in of


def test_lines_that_no_chain_carries_are_named_with_their_sources_and_not_laid_on_back_reaction():
    pump = ("sources.pump", {"member": "workpiece", "lines": [{"frequency_hz": 45.0, "force_n": 5000.0}]})
    without, beside = (of_chains(model(*more)) for more in ((), (pump,)))
    off, off_beside = ([one for one in found if one.id == "chains-off-coupled"] for found in (without, beside))
    assert off_beside == off
    built = model(pump)
    motions = built.motions(built.shaft_rpm)["coupled"]
    row = motions.frequency_hz.tolist().index(45.0)
    lost = {one.evidence["final"]: one for one in beside if one.id == "no-chain-to-final"}
    assert set(lost) == {"tool", "workpiece"}
    for final, told in lost.items():
        assert "pump" in told.evidence["sources"]
        assert told.level == "info"
        # rms of one sinusoid, and of what else lacks a chain there
        size = 1e6 * abs(motions.of(final)[row]) / math.sqrt(2.0)
        assert told.evidence["missing_um"] == pytest.approx(size, rel=0.1)
    # a line of the high range, and the source is in low chains only
    high = of_chains(model(("run.period_s", 1e-4), ("sources.motor.lines.0.frequency_hz", 4800.0),
                           ("sources.motor.lines.0.force_n", 1e8)))  # fmt: skip
    assert 4800.0 in next(one for one in high if one.evidence.get("final") == "tool").evidence["frequency_hz"]
    heard = of_chains(model(("chains.2", ...), ("run.method", "chains")))
    assert {one.level for one in heard} == {"warning"}


def test_lines_with_chains_to_one_final_only_are_told_where_the_other_needs_them():
    loud = model(("sources.motor.lines.0.force_n", 1e4))
    (told,) = [one for one in of_chains(loud) if one.id == "no-chain-to-final"]
    assert (told.evidence["final"], told.evidence["sources"]) == ("workpiece", ["motor"])
    assert told.evidence["frequency_hz"] == [30.0, 50.0]
    quiet = model(("sources.motor.lines.0.force_n", 1e-3), ("sources.motor.lines.1.force_n", 1e-3))
    told = [one.evidence for one in of_chains(quiet) if one.id == "no-chain-to-final"]
    assert [(one["final"], one["sources"]) for one in told] == [("tool", ["spindle"])]


def test_chains_without_back_reaction_to_leave_out_are_not_off():
    # the tool weighs a millionth of the bed, on which only the motor acts
    built = model(
        ("members.tool.mass_kg", 1e-3), ("joints.1.stiffness_n_per_m", 1e8),
        ("members.workpiece.mass_kg", 1e-3), ("sources.spindle", ...),
        ("chains", [{"name": "side", "range": "low", "sources": ["motor"], "path": ["bed"], "branch": ["tool"],
                     "final": "tool"}]),
    )  # fmt: skip
    assert of_chains(built) == ()
