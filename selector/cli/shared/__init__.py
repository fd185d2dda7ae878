"""What commands share: options, recordings, study files, the screen, written files, exit codes."""
