"""The host's own follower: leads a robot that drives and tells its pose to goals. It sees no obstacles."""
