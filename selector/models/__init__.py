"""Which model: terms, least squares, exact subset search, validation."""
