"""fleet.yaml to models, with line and column for every problem."""
