"""Frozen values that the whole project passes around; no I/O, no clock.

Frames and units (REP-103): body x forward, y left, z up; world ENU, z up; metres, radians, seconds;
quaternions by name; battery 0 to 100 percent.
"""
