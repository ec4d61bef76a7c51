"""The body: kinematics, gait, odometry, postures; functions of measured values and dt, without I/O."""
