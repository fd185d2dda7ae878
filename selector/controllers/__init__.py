"""From the model to the control: the model file, what it means, how it reads, what it does on other recordings."""
