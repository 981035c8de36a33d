"""§6: calibrating the range finder to the robot."""
