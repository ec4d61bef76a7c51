"""The edge process: the composition root, and what only it serves."""
