"""What happened to an edge's robots, who asked, and how it ended: one store, of which all else are views."""
