"""Recording and simulation brought together: clocks, names, and what cannot be used turned away."""
