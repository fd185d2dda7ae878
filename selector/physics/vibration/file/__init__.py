"""The model file of a vibration, and its parameters."""
