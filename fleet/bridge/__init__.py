"""Bridge between the bus and the cloud: forwarding rules, translation, rates, and the order of dropping."""
