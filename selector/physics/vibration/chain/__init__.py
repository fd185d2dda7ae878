"""The published chain method, and where it is good."""
