"""The body controller: a fixed-rate loop in a process of its own."""
