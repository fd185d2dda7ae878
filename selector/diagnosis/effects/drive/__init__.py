"""Effects of the family `drive`: a table of them at the end of every file."""
