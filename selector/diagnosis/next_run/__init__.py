"""The run that would tell apart what this recording cannot."""
