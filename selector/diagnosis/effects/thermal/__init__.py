"""Effects of the family `thermal`: a table of them at the end of every file."""
