"""What a column is: names of channels, inferred roles, and what each column becomes."""
