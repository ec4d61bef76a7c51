"""Missions: tasks for a fleet, written in YAML; a pure engine executes each run."""
