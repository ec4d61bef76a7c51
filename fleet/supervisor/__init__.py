"""The parent of an edge: it outlives the processes that have robots, halts those robots, and starts again."""
