"""Whole closed solids proposed from what the scans show."""
