"""Motors that speak the MIT frame: Mini Cheetah, T-Motor AK, Damiao."""
