"""What vibrates: the structure, its modes, and the sources that shake it."""
