"""Exact best subsets of columns and of sensors: the search, its compiled parts, its results."""
