"""Depth from files: images and clouds, organised or not, in any orientation."""
