"""What heats and cools the virtual machining centre, and the parts beside it that its mesh does not have.

The numbers are plausible for a machine of 5 t with a main motor of 7.5 kW; they are those of no real machine. Sizes:
bearing friction M = f·n^(2/3)·d³ (Palmgren) gives a loss that goes with n^(5/3), measured ones with n^1.3 to n^1.7;
still air with radiation 8–10 W/(m²·K), inside chambers 2–3; a shaft of 100 mm turning in air 20–40 W/(m²·K) at
3000 r/min; coolant that trickles over a table some tens of W/(m²·K), because it wets a part of it a part of the time.
"""

from __future__ import annotations

from typing import Literal

from selector.errors import OptionError
from selector.physics.thermal.coupling import Contact
from selector.physics.thermal.laws import FilmLaw, HeatLaw, Laws
from selector.physics.thermal.network import HeatShare, Network, Node, Surface

Physics = Literal["linear", "convection", "everything"]
"""What the machine has: constant films and lubricants; films that grow with the speed; lubricants that soften too."""

MAX_RPM = 3000.0
"""Highest speed of the spindle [r/min]."""

LUBRICATED = ("lower bearing", "upper bearing", "gearbox")
"""Parts whose mean temperature thins their lubricant; probes of the same names read it."""

_CONSTANT_RPM = 1500.0
_SOFTENING_PER_K = 0.012


def machine_laws(physics: Physics = "everything") -> Laws:
    """The laws of all sources and films.

    ``"linear"`` keeps every film at its coefficient for 1500 r/min and every lubricant as thick as at 20 °C: then heat
    is a function of the speed alone, and temperatures are linear in it.

    Raises
    ------
    OptionError
        If `physics` is none of the three.
    """
    if physics not in ("linear", "convection", "everything"):
        raise OptionError(
            f"physics {physics!r}",
            expected="linear, convection or everything",
            where="virtual machining centre",
            advice="choose one of the three",
        )
    softening = _SOFTENING_PER_K if physics == "everything" else 0.0
    return Laws(heat=_heat(softening), films=_films(moving=physics != "linear"))


def parts_beside() -> tuple[Network, tuple[Contact, ...]]:
    """Hydraulic unit and coolant tank as a network, and the contact of the hydraulic line with the headstock."""
    network = Network(
        nodes=(
            Node("hydraulic unit", 22e3, "hydraulic unit, oil", (-0.55, 0.10, 0.60)),
            Node("coolant tank", 400e3, "coolant tank", (0.70, 0.90, 0.25)),
        ),
        surfaces=(Surface("hydraulic unit", "hydraulic unit", 0.75), Surface("coolant tank", "coolant tank", 1.0)),
        heat_shares=(HeatShare("hydraulic pump", "hydraulic unit"),),
    )
    return network, (Contact("hydraulic line", "hydraulic unit", 3.0),)


def _heat(softening_per_k: float) -> tuple[HeatLaw, ...]:
    def friction(part: str, watts: float, exponent: float) -> HeatLaw:
        return HeatLaw(
            part,
            speed_w=watts,
            reference_rpm=MAX_RPM,
            exponent=exponent,
            softening_per_k=softening_per_k,
            at=part,
        )

    return (
        friction("lower bearing", 125.0, 1.5),
        friction("upper bearing", 95.0, 1.5),
        friction("gearbox", 95.0, 1.2),
        # inner rings and, with a tool in the cut, its chips
        HeatLaw("spindle", speed_w=25.0, reference_rpm=MAX_RPM, exponent=1.5, torque_share=0.01),
        HeatLaw("motor", on_w=15.0, turning_w=40.0, speed_w=130.0, reference_rpm=MAX_RPM, torque_share=0.04),
        HeatLaw("motor flange", speed_w=20.0, reference_rpm=MAX_RPM),
        # the axes move while the spindle turns
        HeatLaw("Z nut", turning_w=24.0),
        HeatLaw("Z screw bearing", turning_w=14.0),
        HeatLaw("Z guideways", turning_w=8.0),
        HeatLaw("Y nut", turning_w=14.0),
        HeatLaw("Y screw bearing", turning_w=6.0),
        HeatLaw("Y guideways", turning_w=5.0),
        HeatLaw("X nut", turning_w=16.0),
        HeatLaw("X screw bearing", turning_w=7.0),
        HeatLaw("X guideways", turning_w=5.0),
        HeatLaw("hydraulic pump", on_w=55.0),
    )


def _films(*, moving: bool) -> tuple[FilmLaw, ...]:
    def air(film: str, still: float, fast: float = 0.0) -> FilmLaw:
        """Film of `fast` more at the highest speed; constant at that of 1500 r/min where films do not move."""
        if moving:
            return FilmLaw(film, still, fast, reference_rpm=MAX_RPM, exponent=0.8)
        return FilmLaw(film, still + fast * (_CONSTANT_RPM / MAX_RPM) ** 0.8)

    def washed(film: str, coefficient: float) -> FilmLaw:
        return FilmLaw(film, coefficient, while_coolant=True, fluid="coolant")

    return (
        air("bed", 8.0),
        air("bed inside", 2.0),
        air("bed top", 7.0),
        air("column", 8.5),
        air("column inside", 2.0),
        air("headstock", 8.5, 2.0),
        air("headstock inside", 2.5, 2.5),
        air("motor", 9.0, 30.0),  # its fan is on the shaft
        air("spindle nose", 9.0, 35.0),
        air("spindle inside", 3.0, 12.0),
        air("saddle", 7.0),
        air("table", 7.0),
        air("table top", 8.5),
        air("guideways", 5.0),
        air("screws", 8.0, 6.0),
        air("hydraulic unit", 8.0),
        FilmLaw("coolant tank", 1500.0, fluid="coolant"),  # the tank is at the temperature of the coolant
        washed("table top", 60.0),
        washed("bed top", 30.0),
        washed("saddle", 8.0),
        washed("spindle nose", 80.0),
    )
