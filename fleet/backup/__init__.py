"""Backups of an edge: its state, also while it runs, and its configuration without values of secrets."""
