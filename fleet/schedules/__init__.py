"""Automatic starts of missions: triggers, stored firings, and the runner."""
