"""What `diagnose` is asked, what answers it, and the files that it writes."""
