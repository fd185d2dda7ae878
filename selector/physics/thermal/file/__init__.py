"""The model file of a thermal machine, and its parameters."""
