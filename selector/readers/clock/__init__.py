"""Time: stamps and numbers → a clock that ticks forwards."""
