"""The live view for Foxglove: the messages of a recorder, sent live; read-only."""
