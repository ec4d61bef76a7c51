"""Single pictures for ``take_photo``, whatever the robot."""
