"""fleet.yaml to models; every error is reported with line and column."""
