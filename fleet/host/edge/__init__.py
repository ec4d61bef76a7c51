"""The edge process: the composition root, and the services of this process alone."""
