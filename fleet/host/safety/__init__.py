"""Who may move a robot, when, and how far: pure rules and state machines, the clock passed in."""
