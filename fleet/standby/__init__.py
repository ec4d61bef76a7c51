"""Which of the two edges of a pair runs the robots: the lease, its service, and what follows from it."""
