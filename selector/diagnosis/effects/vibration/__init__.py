"""Effects of the family `vibration`: a table of them at the end of every file."""
