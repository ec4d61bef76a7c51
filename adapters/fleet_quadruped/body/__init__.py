"""The body: kinematics, gait, odometry, postures; functions of measured values and dt, no I/O."""
