"""Several scans of one object brought together."""
