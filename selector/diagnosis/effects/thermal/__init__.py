"""Effects of the family `thermal`, one file each."""
