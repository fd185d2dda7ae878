"""Heat in bodies: systems, laws, time stepping, steady state and reduction."""
