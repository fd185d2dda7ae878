"""Delimited text: encodings, separators, lines."""
