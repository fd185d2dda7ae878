"""Machines of finite elements are made once in a run of the suite."""

from tests.physics.thermal.shared_machines import shared_machines as shared_machines
