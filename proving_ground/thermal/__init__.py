"""Thermal cases of the blind proof."""
