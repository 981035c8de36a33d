"""Drawn stripes whose centres are known: light (H, W) to 255 of a Gaussian profile, each pixel the mean over its width."""

import numpy as np
from scipy.special import erf


def stripe(centres: np.ndarray, width: int, sigma: float, light: float) -> np.ndarray:
    """One stripe with its centre (H,) [px] in each row."""
    edges = (np.arange(width + 1) - 0.5)[None] - np.asarray(centres, dtype=float)[:, None]
    share = 0.5 * erf(edges / (sigma * np.sqrt(2)))
    return light * sigma * np.sqrt(2 * np.pi) * np.diff(share, axis=1)


def noisy(light: np.ndarray, rng: np.random.Generator, deviation: float = 1.5) -> np.ndarray:
    """As a sensor gives it: noise, whole numbers, an end of the scale."""
    return np.clip(np.round(light + rng.normal(0.0, deviation, light.shape)), 0, 255).astype(np.float32)


def none_saturated(light: np.ndarray) -> np.ndarray:
    return np.zeros(light.shape, dtype=bool)
