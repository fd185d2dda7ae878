"""What is told of a diagnosis."""
