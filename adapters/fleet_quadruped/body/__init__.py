"""The body: kinematics, gait, odometry and postures, as functions of measured values and dt; no I/O, no clock."""
