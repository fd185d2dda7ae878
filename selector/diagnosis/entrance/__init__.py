"""The entrance: clocks and names brought together, and what cannot be used turned away."""
