"""Checks of everything around an edge: each reports facts and a remedy. They change nothing."""
