"""Live data: what a process beside the control reads, computes behind the guard, writes, reads back and keeps."""
