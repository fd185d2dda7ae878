"""selector: choose temperature sensors, build and prove thermal-error models, hand them to the control."""

__version__ = "0.1.0"
