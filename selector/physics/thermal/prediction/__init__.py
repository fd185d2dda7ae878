"""From heating and cooling tests to the displacement of a duty cycle and its correction program."""
