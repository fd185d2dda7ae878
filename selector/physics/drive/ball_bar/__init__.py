"""Circular tests: what a ball-bar shows, how round it is, and which causes are behind it."""
