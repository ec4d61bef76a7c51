"""Roll-out of signed configurations to many edges (docs/how-to/roll-out.md)."""
