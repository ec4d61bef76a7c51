"""Missions: what a fleet shall do, written in YAML; a pure engine carries a run of one to its end."""
