"""Selection of the edge of a pair that runs the robots: the lease, its service, and the consequences."""
