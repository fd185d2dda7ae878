"""Shapes of signals in which an effect shows: what a term of the catalogue is computed from."""
