"""Effects of the family `gauging`, one file each."""
