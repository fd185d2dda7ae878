"""Recorded speeds and forces that drive a model."""
