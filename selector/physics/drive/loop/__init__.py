"""The control loop of an axis: its responses, poles and stability."""
