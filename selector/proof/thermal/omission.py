"""What a simulation leaves out: how that changes the heat of the true machine, or adds to its displacement."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from selector.proof.thermal.conduction import Heat
from selector.proof.thermal.duty import Duty
from selector.proof.thermal.machine import Machine

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
BOTH: Mapping[str, float] = {"Z": 1.0, "Y": 1.0}


@dataclass(frozen=True, eq=False)
class Omission:
    """One thing that happens in the machine and not in its simulation, at any size (0 = not at all).

    Attributes
    ----------
    id : str
        Of the catalogue, or ``"hidden.…"``.
    accept : tuple of str
        Ids that are right; empty = `id` alone.
    place : str or None
    heated : callable (Heat, Duty, size) -> Heat
        The heat of the true machine, from that of the simulation.
    shifted : callable (rises, Duty) -> mapping of str to ndarray
        Axis → displacement at size 1 [µm] on the grid of the rises of the volumes (n_times, n_volumes) [K].
    stand_in : callable (rises of every run, duties) -> sequence of mapping of str to ndarray
        What the simulation has in the place of `shifted` at size 1, fitted by its author.
    axes : mapping of str to float
        By what the response of an axis is multiplied, e.g. ``{"Z": 1, "Y": -0.7}``; an axis that is lacking: 0.
    brief : bool
        It shows for a part of the time only: windows are stated.
    """

    id: str
    accept: tuple[str, ...] = ()
    place: str | None = None
    heated: Callable[[Heat, Duty, float], Heat] = lambda heat, _duty, _size: heat
    shifted: Callable[[Matrix, Duty], Mapping[str, Vector]] | None = None
    stand_in: Callable[[Sequence[Matrix], Sequence[Duty]], Sequence[Mapping[str, Vector]]] | None = None
    axes: Mapping[str, float] = field(default_factory=lambda: BOTH)
    brief: bool = False


Maker = Callable[[np.random.Generator, Machine, Sequence[Duty]], Omission]
"""Draws an omission for a machine and its duties."""


def with_power(heat: Heat, inlet: str, watts: Vector) -> Heat:
    """The heat with more of it at an inlet."""
    power = dict(heat.power_w)
    power[inlet] = power.get(inlet, 0.0) + watts
    return replace(heat, power_w=power)


def with_bath(heat: Heat, bath: str, degc: Vector, factor: Vector) -> Heat:
    """The heat with a bath of this temperature whose films are multiplied by `factor`."""
    return replace(heat, bath_degc={**heat.bath_degc, bath: degc}, bath_factor={**heat.bath_factor, bath: factor})


def gated(
    generator: np.random.Generator, n: int, off_steps: tuple[float, float], on_steps: tuple[float, float]
) -> Vector:
    """A course of n steps that is 0 and 1 by turns for drawn numbers of steps, 0 first."""
    result = np.zeros(n)
    at = int(generator.uniform(*off_steps))
    while at < n:
        span = max(1, int(generator.uniform(*on_steps)))
        result[at : at + span] = 1.0
        at += span + max(1, int(generator.uniform(*off_steps)))
    return result
