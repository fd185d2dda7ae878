"""The catalogue of what a simulation may have left out: found by `catalogue.catalogue`."""
