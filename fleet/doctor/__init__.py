"""Checks of everything around an edge: each says what it found and what to do. It changes nothing."""
