"""Heat in the machine: modes, duty cycles, the correction program, lumped networks and fields."""
