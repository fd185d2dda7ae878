"""What is told of a predicted duty cycle."""
