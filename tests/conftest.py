"""Property tests draw the same cases every time; `--hypothesis-profile=wide` draws new ones, and more."""

from hypothesis import settings

settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("wide", max_examples=1000, deadline=None)
settings.load_profile("same")
