"""What may be asked on the command line: the options of one command as one value."""
