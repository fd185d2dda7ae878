"""The compiled simulation of an axis, and its slow twin."""
