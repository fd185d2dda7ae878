"""The catalogue of what a simulation may have left out: one file an effect, found by `catalogue.catalogue`."""
