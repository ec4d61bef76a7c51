"""Rules for who may move a robot, when, and how far: pure functions and state machines."""
