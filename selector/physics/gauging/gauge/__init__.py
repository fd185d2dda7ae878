"""The gauge: its parts, how it swings, what it shows, and when its relay trips."""
