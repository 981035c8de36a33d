"""The fitted weights as they are shipped: the table in `score.toml`, which `handey fit score` writes."""

import tomllib
from pathlib import Path

TABLE = tomllib.loads(Path(__file__).with_name("score.toml").read_text())
