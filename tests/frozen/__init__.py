"""What the program tells today, kept: two checkouts run the same commands and their outputs are compared."""
