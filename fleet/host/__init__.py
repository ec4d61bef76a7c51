"""Run robots: the composition root, one controller and exception barrier per robot, and the safety rules."""
