"""The body controller: one loop at a fixed rate, in a process of its own."""
