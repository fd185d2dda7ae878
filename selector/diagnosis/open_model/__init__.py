"""Models that can be run, not only their traces: refitted, effects switched on inside them, FMUs."""
