"""Cases whose simulation cools always alike, or in which temperatures work on each other: convection, interaction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from proving_ground.concealment import one_axis, opposed
from proving_ground.thermal.duty import BOTH, Duty, Omission, with_bath
from proving_ground.thermal.machine import Heat, Machine
from proving_ground.thermal.scene import FINE, WHITE, of, thermal_case
from proving_ground.world import scenarios_of
from selector.types import Matrix, Vector


def windage(axes: Mapping[str, float] = BOTH, exponent: float = 0.3) -> Omission:
    """Air that the spindle stirs cools spindle and headstock, by its speed to the power of `exponent`."""

    def heated(tool: Machine, heat: Heat, one: Duty, size: float) -> Heat:
        stirred = (one["speed"] / tool.highest_rpm) ** exponent
        return with_bath(heat, "windage", heat.bath_degc["hall"], size * stirred)

    return Omission("thermal.convection", place="headstock", heated=heated, axes=axes)


def _risen(_tool: Machine, heat: Heat, _duty: Duty, size: float) -> Heat:
    return replace(heat, natural={**heat.natural, "hall": size})


RISING_FILM = Omission("thermal.convection", place="headstock", heated=_risen)
"""Film coefficients that grow with the rise above the hall (natural convection, radiation): `size` per 10 K."""


def product(place: str, first: str, second: str, axes: Mapping[str, float] = BOTH) -> Omission:
    """A lever that lengthens with one temperature while another tilts it: their product, 1 µm for 10 K × 10 K."""

    def shifted(tool: Machine, rises: Matrix, _duty: Duty) -> dict[str, Vector]:
        a, b = tool.sensors[first][1], tool.sensors[second][1]
        return dict.fromkeys(BOTH, (rises @ a) * (rises @ b) / 100.0)

    return Omission("thermal.interaction", place=place, shifted=shifted, axes=axes)


_CASES = (
    thermal_case(
        "thermal.convection/windage",
        "The turning spindle stirs the air, which cools it faster at any speed. Offset and gain are fitted.",
        (windage(),),
        ("intermittent", "steps", "cooling"),
        hidden=("absorbed",),
        law=(1.9, 2.3),
        refitted=True,
        **WHITE,
    ),
    thermal_case(
        "thermal.convection/natural",
        "Film coefficients grow with the rise above the hall.",
        (RISING_FILM,),
        ("staircase", "intermittent", "steps"),
        (of("n"), of("f")),
        hidden=("absorbed",),
        hours=(6.0, 8.0),
        **WHITE,
    ),
    thermal_case(
        "thermal.convection/one axis",
        "Windage that shows in Z alone.",
        (windage({"Z": 1.0}, 0.4),),
        ("steps", "intermittent", "cooling"),
        hidden=("absorbed", one_axis("Z")),
        law=(1.9, 2.3),
        noise="heavy",
        periods_s=(20.0,),
    ),
    thermal_case(
        "thermal.interaction/product",
        "Z follows the product of two temperatures; offset and gain of the simulation were fitted to it.",
        (product("front bearing", "T1", "T4"),),
        ("steps", "intermittent", "warm-up"),
        hidden=("absorbed",),
        must=("T4",),
        refitted=True,
        **WHITE,
    ),
    thermal_case(
        "thermal.interaction/opposed",
        "The product of nose and motor temperatures tilts the head: up in Z, back in Y.",
        (product("headstock nose", "T6", "T3", {"Z": 1.0, "Y": -0.7}),),
        ("intermittent", "steps", "warm-up"),
        hidden=(opposed,),
        must=("T3",),
    ),
    thermal_case(
        "thermal.interaction/one axis",
        "Product of column and headstock temperatures, Y alone; feed is there and known.",
        (product("column front, upper", "T4", "T2", {"Y": 1.0}),),
        ("steps", "cooling", "intermittent"),
        (of("n"), of("f")),
        hidden=("absorbed", one_axis("Y")),
        must=("T4",),
        knows=("feed",),
        **FINE,
    ),
)
SCENARIOS = scenarios_of(_CASES, "thermal.convection/windage", "thermal.interaction/product")
