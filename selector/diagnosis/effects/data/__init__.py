"""Effects of the family `data`, one file each."""
