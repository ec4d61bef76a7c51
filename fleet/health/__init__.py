"""Signals to health, per robot and per edge."""
