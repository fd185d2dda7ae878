"""The model file of a feed drive, and its parameters."""
