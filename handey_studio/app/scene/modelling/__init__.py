"""The model in the making, in the scene."""
