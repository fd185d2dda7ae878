"""Effects of the family `data`: a table of them at the end of every file."""
