"""The live view for Foxglove: what a recorder writes, sent as it happens; read-only."""
