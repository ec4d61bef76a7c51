"""What the built-in simulated robots share, and the demo broker."""
