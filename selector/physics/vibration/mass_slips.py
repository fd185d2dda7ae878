"""Which masses were perhaps given in grams: one that does not fit the other members, or all of them."""

from __future__ import annotations

import math
from collections.abc import Iterator

from selector.findings import Finding
from selector.physics.model_text import key_text
from selector.physics.vibration.modes import StructureModes
from selector.physics.vibration.structure import GROUND, Structure

MORE_THAN_CARRIED = 10.0
"""Times the heaviest member on the ground that nothing which it carries weighs."""

SLOW_HZ = 20.0
"""On its joints alone a member that is carried swings faster."""

_TONNE = 1000.0
_LOWEST_HZ = 10.0
_GRAMS = 1e-3


def mass_slips(structure: Structure, modes: StructureModes, heaviest_kg: float) -> Iterator[Finding]:
    """Warnings on masses that would fit the others in grams; of single ones beyond `heaviest_kg` others tell.

    Of all: where none is below a tonne, and one is beyond `heaviest_kg` or the structure swings below 10 Hz. Of one
    that does not stand on the ground: where it is more than ten times as heavy as all that do, and its joints are so
    soft for it that it would swing below 20 Hz.
    """
    masses = {one.name: one.mass_kg for one in structure.members}
    least, most = min(masses.values()), max(masses.values())
    if least >= _TONNE and (most > heaviest_kg or float(modes.frequency_hz[0]) < _LOWEST_HZ):
        yield Finding(
            "unlikely-masses",
            "warning",
            f"No member is lighter than {least:.6g} kg, and the heaviest has {most:.6g} kg. In g all of them would be "
            f"{_GRAMS * least:.6g} to {_GRAMS * most:.6g} kg.",
            evidence={"least_kg": least, "most_kg": most},
            suggestion="divide every mass_kg by 1000 if g was meant",
        )
        return
    standing = {name: mass for name, mass in masses.items() if _stands(structure, name)}
    carrier = max(standing, key=lambda name: standing[name])
    for name, mass_kg in masses.items():
        stiffness = sum(one.stiffness_n_per_m for one in structure.joints if name in one.between)
        alone_hz = math.sqrt(stiffness / mass_kg) / (2.0 * math.pi)
        if (
            name in standing
            or mass_kg > heaviest_kg
            or mass_kg <= MORE_THAN_CARRIED * standing[carrier]
            or alone_hz >= SLOW_HZ
        ):
            continue
        yield Finding(
            "unlikely-masses",
            "warning",
            f"{name!r} has {mass_kg:.6g} kg, {mass_kg / standing[carrier]:.3g} times as much as the heaviest member "
            f"that stands on the ground ({carrier!r}, {standing[carrier]:.6g} kg), and would swing on its joints at "
            f"{alone_hz:.3g} Hz. {mass_kg:.6g} g would be {_GRAMS * mass_kg:.6g} kg.",
            evidence={"member": name, "mass_kg": mass_kg, "carrier": carrier, "alone_hz": alone_hz},
            suggestion=f"write {key_text(('members', name, 'mass_kg'))} = {_GRAMS * mass_kg:.6g} if g was meant",
        )


def _stands(structure: Structure, name: str) -> bool:
    return any(GROUND in joint.between and name in joint.between for joint in structure.joints)
