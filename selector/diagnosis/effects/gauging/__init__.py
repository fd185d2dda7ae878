"""Effects of the family `gauging`: a table of them at the end of every file."""
