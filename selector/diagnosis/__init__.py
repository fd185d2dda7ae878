"""What a simulation left out: the one place where physics and statistics meet."""
