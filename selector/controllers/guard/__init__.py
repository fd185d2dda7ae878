"""The guard: a model made safe against broken sensors, restarts and jumps, as every exported program runs it."""
