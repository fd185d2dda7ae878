"""The proof of an export: recorded readings through the generated program, beside the reference."""
