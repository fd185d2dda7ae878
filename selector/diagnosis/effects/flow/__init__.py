"""Effects of the family `flow`: a table of them at the end of every file."""
