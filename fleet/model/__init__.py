"""Immutable value types shared by the whole project; no I/O, no clock.

Frames and units (REP-103): body x forward, y left, z up; world ENU, z up; metres, radians, seconds;
quaternions by name; battery 0 to 100 percent.
"""
