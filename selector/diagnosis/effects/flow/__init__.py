"""Effects of the family `flow`, one file each."""
