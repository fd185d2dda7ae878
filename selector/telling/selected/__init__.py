"""What is told of a selection: its account, tables, advice, formula and pictures."""
