"""Thermal modes: what they are, and which of them the tests support."""
