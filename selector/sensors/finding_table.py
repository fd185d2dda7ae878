"""The findings of comparing and grouping sensors: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds

CONSTANT_SENSOR = "constant-sensor"
ROUND_WITHOUT_EFFECT = "round-without-effect"

FINDINGS = Kinds.of(
    """
chaining [warning] a group of sensors hangs together only through links: its ends are not alike
    → Choose a higher λ, at which the ends of the group part, or λ = auto.
between-groups [info] a sensor belongs to two fuzzy groups nearly alike
    → Neither group's representative stands for it well: keep it with --must if its place matters.
round-without-effect [info] a round of screening drops no sensor: none that could be merged are linked at its λ
    → Leave the round out, or give it a lower λ.
constant-must [warning] a sensor that must be kept does not move in these recordings: no model can use it
    → Take it off the must list, or record runs in which its place warms up.
constant-sensor [warning] a sensor does not move: it correlates with nothing
    → check the sensor, or record runs in which its place warms up
duplicate-sensors [warning] two sensors repeat each other up to scale and offset
    → check whether one signal was recorded twice; one of the two is enough
anticorrelated-sensors [info] two sensors move against each other
    → Check the sign and the wiring of both.
incomplete-rows [warning] rows lack a sensor and are left out when sensors are compared
    → leave out the sensors that are missing most if too few rows remain
"""
)
