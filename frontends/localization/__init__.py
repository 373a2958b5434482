"""Localisation in a saved map: where in the building is the robot, and is it there at all."""
