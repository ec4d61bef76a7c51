"""Machines that walk by themselves: a body velocity goes in, their state comes out, the gait is theirs."""
