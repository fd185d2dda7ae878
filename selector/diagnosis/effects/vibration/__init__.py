"""Effects of the family `vibration`, one file each."""
