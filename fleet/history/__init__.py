"""History of an edge: events of its robots, with the senders of requests and their results, in one store."""
