"""Parent process of an edge: halts the robots of a process that dies, and restarts the edge."""
