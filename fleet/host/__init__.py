"""The composition root, the wall around each robot, and safety."""
