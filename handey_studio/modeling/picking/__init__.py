"""From a click to what is meant: what the line of sight meets, and what it snaps to."""
