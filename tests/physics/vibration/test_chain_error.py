from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from docs.images.chain_error_map import chain_error_map, two_member_ratio
from selector.errors import InputError
from selector.physics.vibration.chains import Chain, chain_accuracy, chain_receptance
from selector.physics.vibration.structure import GROUND, Joint, Line, Member, Source, Structure, receptance, receptances
from tests.physics.vibration.test_chain import HZ, LATHE

LINES = (Line(frequency_hz=1.0, force_n=1.0),)


@given(
    st.floats(1e-3, 10.0), st.floats(0.1, 10.0), st.floats(0.05, 5.0), st.floats(0.1, 2.0), st.floats(0.1, 2.0),
    st.sampled_from(["first", "second"]), st.booleans(),
)  # fmt: skip
def test_the_map_is_that_of_two_members(mass, frequency, forcing, psi_1, psi_2, kind, dampers_carry):
    # p1 = 300 1/s, m1 = 5 kg
    heavy = 5.0 / mass
    structure = Structure(
        (Member("1", 5.0), Member("2", heavy)),
        (Joint(("1", "2"), 5.0 * 300**2, psi_1), Joint(("2", GROUND), heavy * (300 / frequency) ** 2, psi_2)),
    )
    chain = (
        Chain("c", "high", (), (("1",), ("2",)), "1")
        if kind == "first"
        else Chain("c", "high", (), (("2",),), "1", branch=(("1",),))
    )
    hz = [forcing * 300 / (2 * math.pi)]
    expected = chain_receptance(structure, chain, hz, dampers_carry=dampers_carry).final / receptance(
        structure, hz, of="1", at="1" if kind == "first" else "2"
    )
    found = two_member_ratio(
        mass, frequency, forcing, dissipation=(psi_1, psi_2), kind=kind, dampers_carry=dampers_carry
    )
    # rounding times mass ratio · squared frequency ratio, up to 1e5 either way
    assert found == pytest.approx(expected[0], rel=1e-9)


def test_map_over_a_band():
    band = np.geomspace(0.1, 3.0, 200)
    found = chain_error_map([1e-3, 0.1, 1.0], [0.2, 1.0, 5.0, 9.0], dissipation=(0.5, 0.5), forcing_ratio=band)
    assert found.share_within.shape == found.rms_db.shape == found.largest_error.shape == (3, 4)
    ratio = two_member_ratio(0.1, 5.0, band, dissipation=(0.5, 0.5))
    assert found.largest_error[1, 2] == np.abs(ratio - 1).max()
    assert found.share_within[1, 2] == (np.abs(ratio - 1) <= 0.1).mean()
    assert found.rms_db[1, 2] == pytest.approx(math.sqrt(((20 * np.log10(np.abs(ratio))) ** 2).mean()), rel=1e-14)
    # a hundred times lighter is better wherever it is not good yet
    assert (found.share_within[0] > found.share_within[2]).all()
    assert (found.rms_db[0] < found.rms_db[2]).all()


def test_map_at_one_frequency():
    found = chain_error_map([0.1], [2.0], dissipation=(0.5, 0.5), forcing_ratio=0.7)
    error = abs(two_member_ratio(0.1, 2.0, 0.7, dissipation=(0.5, 0.5)) - 1)
    assert found.largest_error == pytest.approx(np.array([[error]]), rel=1e-14)
    assert found.share_within == [[float(error <= 0.1)]]


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        ((0.0, 1.0, 0.5), "mass_ratio"),
        ((1.0, -1.0, 0.5), "frequency_ratio"),
        ((1.0, 1.0, math.nan), "forcing_ratio"),
        ((1.0, 1.0, -0.5), "forcing_ratio"),
        # alone on its joint the undamped member 1 is in resonance
        ((0.1, 0.5, 1.0), "dissipation"),
    ],
)
def test_ratios_that_give_no_number_are_refused(arguments, where):
    with pytest.raises(InputError) as refused:
        two_member_ratio(*arguments, dissipation=(0.0, 0.0))
    assert refused.value.where == where


HIGH = Chain("high", "high", ("cut",), (("chuck",), ("spindle",), ("head",)), "chuck", held="bed")
LOW = Chain("low", "low", ("cut", "motor"), (("chuck", "spindle"), ("head", "bed")), "chuck")
CUT = Source("cut", "slide", LINES, against="chuck")
MOTOR = Source("motor", "spindle", LINES)


def test_accuracy_of_chains_in_their_ranges_source_by_source():
    found = chain_accuracy(LATHE, [HIGH, LOW], HZ, sources=[CUT, MOTOR], split_hz=200.0)
    assert [(one.chain, one.source, one.final) for one in found] == [
        ("high", "cut", "chuck"),
        ("low", "cut", "chuck"),
        ("low", "motor", "chuck"),
    ]
    assert np.array_equal(found[0].frequency_hz, HZ[HZ > 200])
    assert np.array_equal(found[1].frequency_hz, HZ[HZ <= 200])
    low = HZ[HZ <= 200]
    # the cut acts on the chuck (the other way, which a ratio does not show), the motor on the spindle
    for one, at in ((found[1], "chuck"), (found[2], "spindle")):
        published = chain_receptance(LATHE, LOW, low).final
        ratio = published / receptance(LATHE, low, of="chuck", at=at)
        assert np.abs(one.published.ratio / ratio - 1).max() < 1e-12
        error = np.abs(ratio - 1)
        assert one.published.share_within == np.mean(error <= 0.1)
        assert one.published.largest_error == pytest.approx(error.max(), rel=1e-12)
        assert one.published.largest_at_hz == low[error.argmax()]
    for one in found:
        # what is wrong in all is what the links leave out times what cutting out leaves out
        assert np.abs(one.one_way.ratio * one.cut_out.ratio / one.published.ratio - 1).max() < 1e-12


def test_without_sources_the_force_is_spread_over_the_group_by_mass():
    (found,) = chain_accuracy(LATHE, [LOW], HZ)
    assert found.source is None
    assert np.array_equal(found.frequency_hz, HZ)
    force = np.array([30.0, 60.0, 0.0, 0.0, 0.0]) / 90.0
    exact = receptances(LATHE, HZ, force[None])[0][:, 0]
    ratio = chain_receptance(LATHE, LOW, HZ).final / exact
    assert np.abs(found.published.ratio / ratio - 1).max() < 1e-12


def test_a_structure_that_is_the_chain_is_cut_out_without_error():
    structure = Structure(LATHE.members[:3], (*LATHE.joints[:2], Joint(("head", GROUND), 2e9, 0.5)))
    chain = Chain("all", "high", (), (("chuck",), ("spindle",), ("head",)), "chuck")
    (found,) = chain_accuracy(structure, [chain], HZ)
    # ψ goes to η and back
    assert found.cut_out.largest_error < 1e-12
    assert found.cut_out.bands_hz == ((HZ[0], HZ[-1]),)
    assert found.one_way.share_within == found.published.share_within < 1


def test_bands_are_where_the_error_is_within_the_limit(monkeypatch):
    monkeypatch.setattr("selector.physics.vibration.chains.WITHIN", 0.2)
    (found,) = chain_accuracy(LATHE, [HIGH], HZ, sources=[CUT])
    inside = np.abs(found.published.ratio - 1.0) <= 0.2
    assert 0 < inside.sum() < len(HZ)
    # an amplitude may be right where its phase is not, and never the other way round
    of_amplitude = np.mean(np.abs(np.abs(found.published.ratio) - 1.0) <= 0.2)
    assert found.published.share_within < of_amplitude < 1
    by_band = sum((low <= HZ) & (high >= HZ) for low, high in found.published.bands_hz)
    assert np.array_equal(by_band, inside.astype(int))


def test_chains_without_frequencies_are_left_out():
    assert [one.chain for one in chain_accuracy(LATHE, [HIGH, LOW], HZ, split_hz=5000.0)] == ["low"]
    assert chain_accuracy(LATHE, [], HZ) == ()


def test_antiresonances_that_nothing_damps_give_large_numbers_but_numbers():
    # an absorber tuned to 50 Hz without damping: what carries it stands still there
    tuned = (100 * math.pi) ** 2
    structure = Structure(
        (Member("table", 64.0), Member("absorber", 1.0)),
        (Joint(("table", GROUND), 64 * tuned / 4, 0.5), Joint(("absorber", "table"), tuned, 0.0)),
    )
    (found,) = chain_accuracy(structure, [Chain("c", "low", (), (("table",),), "table")], [30.0, 50.0])
    assert found.published.largest_at_hz == 50.0
    assert 1e6 < found.published.largest_error < math.inf
    assert math.isfinite(found.published.rms_db)


def test_wrong_chains_and_sources_are_refused():
    with pytest.raises(InputError, match="'motor', which acts outside"):
        chain_accuracy(LATHE, [LOW], HZ, sources=[Source("motor", "head", LINES)])
    with pytest.raises(InputError, match=r"between \(x\)"):
        chain_accuracy(LATHE, [Chain("c", "low", (), (("x",),), "x")], HZ)
