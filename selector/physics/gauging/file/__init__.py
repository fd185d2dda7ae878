"""The model file of in-process gauging, and its parameters."""
