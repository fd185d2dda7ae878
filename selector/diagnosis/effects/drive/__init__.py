"""Effects of the family `drive`, one file each."""
