"""Health of an edge and load of its computer."""
