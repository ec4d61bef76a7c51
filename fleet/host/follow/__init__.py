"""Goal follower, for robots that accept velocities and report their pose; no obstacle avoidance."""
