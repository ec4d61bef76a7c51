"""Common parts of the built-in robot simulators, and the demo broker."""
