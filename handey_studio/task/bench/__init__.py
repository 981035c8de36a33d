"""Benchmarks: whole tasks in many random scenes, judged against the hidden truth."""
