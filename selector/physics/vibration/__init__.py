"""Vibration from sources outside of the cut: chains as published, the coupled structure, what it leaves behind."""
