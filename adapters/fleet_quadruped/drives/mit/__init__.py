"""Motors with the MIT protocol: Mini Cheetah, T-Motor AK, Damiao."""
