"""What is done with CAN buses: whether somebody else speaks, and what was on them before a fault."""
