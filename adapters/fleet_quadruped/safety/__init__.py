"""Safety of a dog: pure tables and functions; the loop asks them in every cycle."""
