"""A scan: photographs of stripes → peaks → triangulated readings → the depth map (Handey 1987 §3)."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from handey_studio.base import BadInput, Progress, Share, Silent
from handey_studio.geometry.transforms import apply, transform
from handey_studio.sensing.depth_map import DepthMap
from handey_studio.sensing.stripes.fusing import ScanArea, fuse_readings, inside
from handey_studio.sensing.stripes.instrument import MAX_CELL_M, MAX_SIDE_CELLS, Instrument
from handey_studio.sensing.stripes.photographs import Photograph, dark_frame_of, list_photographs, read_photograph
from handey_studio.sensing.stripes.stripe_camera import StripeCamera, points_on_planes
from handey_studio.sensing.stripes.stripe_light import LaserColour, laser_light
from handey_studio.sensing.stripes.stripe_look import how_it_looks, sampled
from handey_studio.sensing.stripes.stripe_peaks import PeakOptions, StripePeaks, find_peaks

MAX_POINTS = 20_000_000
SPAN = (0.002, 0.998)  # quantiles of the readings that a depth map without a given area spans
LEAST_NOISE_M = 1e-5
NUDGE_PX = 0.25  # by which a peak is moved to see how far its point moves
SPACING_LOOKS = 40  # photographs, and points of each, by which the stripes' spacing is measured
APART = 17  # rows; more than twice what a peak is averaged with
GRAZING = "grazing the plane"


@dataclass(frozen=True)
class ScanOptions:
    """`channel` is the laser's colour (auto, red, green, blue, grey), `direction` how the stripes run (auto, down, across)."""

    channel: str = "auto"
    direction: str = "auto"
    peaks: PeakOptions = field(default_factory=PeakOptions)


@dataclass(frozen=True, eq=False)
class Look:
    """One photograph's readings: `points` (n, 3) [m] of the range frame at pixels `uv` (n, 2); where they were seen and lit from (3,).

    `dropped` counts rows without a reading by reason. `jitter_px` (k,) is how far peaks lie off their neighbours' line, `height_per_px`
    (n,) [m] how much one pixel would raise each reading.
    """

    points: NDArray
    uv: NDArray
    eye: NDArray
    lamp: NDArray | None
    dropped: dict[str, int]
    jitter_px: NDArray
    height_per_px: NDArray


@dataclass(frozen=True, eq=False)
class Scan:
    """What a scan found: a look for each of its photographs `files`, those of the first camera first.

    `noise_px` is the peaks' standard deviation along their rows and `noise` [m] what it makes of a reading's height; both are measured
    from neighbouring rows. `colours` and `directions` tell each camera's laser light and how the stripes run in its photographs.
    """

    looks: tuple[Look, ...]
    files: tuple[Path, ...]
    colours: tuple[LaserColour, ...]
    directions: tuple[str, ...]
    noise_px: float
    noise: float
    cancelled: bool = False

    @property
    def points_range(self) -> NDArray:
        """All readings (n, 3) [m]."""
        return np.concatenate([np.zeros((0, 3)), *(look.points for look in self.looks)])

    @property
    def stripes(self) -> int:
        """How many photographs show a stripe."""
        return sum(len(look.points) > 0 for look in self.looks)

    @property
    def dropped(self) -> dict[str, int]:
        """How many rows gave no reading, by reason, most frequent first."""
        total = Counter[str]()
        for look in self.looks:
            total.update(look.dropped)
        return {reason: count for reason, count in total.most_common() if count}


def scan_folder(
    folder: Path, instrument: Instrument, dark: Path | None = None, options: ScanOptions = ScanOptions(), progress: Progress = Silent()
) -> Scan:
    """Triangulate a folder of stripe photographs. `dark` is the dark frame of those without one of their own.

    A folder without any stripe gives a scan without readings. Raises BadInput for files and counts that do not fit.
    """
    groups = _groups(folder, instrument)
    looks: list[Look] = []
    colours, directions, total = [], [], sum(map(len, groups))
    for camera, group in enumerate(groups):
        darks = [dark_frame_of(path, dark, instrument.names[camera]) for path in group]
        colour, direction = _how_it_looks(group, darks, options)
        colours.append(colour)
        directions.append(direction)
        begun = len(looks)
        share = Share(progress, begun / total, (begun + len(group)) / total)
        looks += _looks(group, darks, instrument, camera, replace(options, direction=direction), colour, share)
    files = tuple(path for group in groups for path in group)[: len(looks)]
    return Scan(tuple(looks), files, tuple(colours), tuple(directions), *reading_noise(looks), progress.cancelled)


def _groups(folder: Path, instrument: Instrument) -> list[list[Path]]:
    """Each camera's photographs."""
    paths = list_photographs(folder)
    groups = [[path for path in paths if path.name.startswith(name)] for name in instrument.names]
    for name, group in zip(instrument.names, groups, strict=True):
        if not group:
            raise BadInput(f'the folder "{folder}" holds no photograph whose name begins with the camera\'s, "{name}".')
    return groups


def _how_it_looks(group: Sequence[Path], darks: Sequence[Path | None], options: ScanOptions) -> tuple[LaserColour, str]:
    """The laser's light and the stripes' direction in a camera's photographs, from a few of them."""
    few = [(read_photograph(group[k]), None if (dark := darks[k]) is None else read_photograph(dark)) for k in sampled(len(group))]
    return how_it_looks(few, options.channel, options.direction, options.peaks)


def _looks(
    group: Sequence[Path],
    darks: Sequence[Path | None],
    instrument: Instrument,
    camera: int,
    options: ScanOptions,
    colour: LaserColour,
    progress: Progress,
) -> list[Look]:
    """The readings of a camera's photographs; fewer when cancelled."""
    view = instrument.cameras[camera]
    planes, rig = instrument.planes_of(len(group)), instrument.rig_of(len(group))
    looks: list[Look] = []
    read_dark = lru_cache(maxsize=1)(read_photograph)  # one dark frame often serves all
    for k, (path, dark) in enumerate(zip(group, darks, strict=True)):
        if progress.cancelled:
            break
        progress.report(k / len(group), f"photograph {k + 1} of {len(group)}: {path.name}")
        photograph = _of_size(read_photograph(path), view, path)
        light = laser_light(photograph, None if dark is None else read_dark(dark), colour)
        peaks = find_peaks(light, photograph.saturated, options.direction, options.peaks)
        looks.append(look_at(peaks, view, planes[k], rig[k], instrument.laser, options.direction))
        if sum(len(look.points) for look in looks) > MAX_POINTS:
            raise BadInput(f"the photographs give more than {MAX_POINTS} readings, the limit; scan them in parts.")
    return looks


def _of_size(photograph: Photograph, camera: StripeCamera, path: Path) -> Photograph:
    if photograph.size != (camera.width, camera.height):
        raise BadInput(f'photograph "{path}" is {photograph.size} px, but its camera has {(camera.width, camera.height)} px.')
    return photograph


def look_at(peaks: StripePeaks, camera: StripeCamera, plane: NDArray, T_range_rig: NDArray, laser: NDArray | None, direction: str) -> Look:
    """The readings of one photograph's peaks: where their rays meet the plane (4,), moved with the rig into the range frame."""
    along = 1 if direction == "across" else 0
    points = points_on_planes(camera, peaks.uv, plane)
    nudged = points_on_planes(camera, peaks.uv + NUDGE_PX * np.eye(2)[along], plane)
    good = np.isfinite(points).all(axis=1)
    return Look(
        points=apply(T_range_rig, points[good]),
        uv=peaks.uv[good],
        eye=apply(T_range_rig, camera.T_range_camera[:3, 3]),
        lamp=None if laser is None else apply(T_range_rig, laser),
        dropped=peaks.dropped | {GRAZING: int((~good).sum())},
        jitter_px=_jitter(peaks.uv[:, 1 - along], peaks.uv[:, along]),
        height_per_px=np.abs(((nudged - points)[good] @ T_range_rig[:3, :3].T)[:, 2]) / NUDGE_PX,
    )


def _jitter(rows: NDArray, places: NDArray) -> NDArray:
    """How far each peak lies off the middle of those APART rows before and after it, scaled to a peak's own deviation [px].

    Nearer ones share its error: what it was averaged with, and the surface's grain. In stripes too short for that the next rows serve.
    """
    if not len(rows):
        return np.zeros(0)
    first = int(rows.min())
    run = np.full(int(rows.max()) - first + 1, np.nan)
    run[rows.astype(int) - first] = places
    for apart in (APART, 1):
        off = (run[apart:-apart] - 0.5 * (run[: -2 * apart] + run[2 * apart :])) / np.sqrt(1.5)
        if np.isfinite(off).any():
            return off[np.isfinite(off)]
    return np.zeros(0)


def reading_noise(looks: Sequence[Look]) -> tuple[float, float]:
    """The peaks' standard deviation [px], robust against steps, and what it makes of a reading's height [m]."""
    jitter = np.concatenate([np.zeros(0), *(look.jitter_px for look in looks)])
    heights = np.concatenate([np.zeros(0), *(look.height_per_px for look in looks)])
    heights = heights[np.isfinite(heights)]
    noise_px = 1.4826 * float(np.median(np.abs(jitter))) if len(jitter) else 0.0
    return noise_px, max(LEAST_NOISE_M, noise_px * float(np.median(heights)) if len(heights) else 0.0)


def depth_map_of(scan: Scan, instrument: Instrument) -> DepthMap:
    """The paper's depth map of a scan, over the instrument's area or over its readings. Raises BadInput without readings."""
    instrument, T_area_range = with_area(scan, instrument)
    counts = [len(look.points) for look in scan.looks]
    places = [np.array([look.eye for look in scan.looks])]
    if instrument.laser is not None:
        places.append(np.array([look.lamp for look in scan.looks]))
    ends = tuple(np.repeat(apply(T_area_range, place), counts, axis=0) for place in places)
    return fuse_readings(scan_area(instrument, scan.noise), apply(T_area_range, scan.points_range), ends)


def scan_area(instrument: Instrument, noise: float) -> ScanArea:
    """The grid of an instrument that has an area; `noise` [m] is that of one reading's height."""
    x, y = instrument.area or (instrument.cell, instrument.cell)
    shape = (max(1, round(y / instrument.cell)), max(1, round(x / instrument.cell)))
    return ScanArea(shape, instrument.cell, instrument.T_world_range, noise, instrument.max_height)


def outside_area(scan: Scan, instrument: Instrument) -> int:
    """How many readings fall outside of the depth map."""
    instrument, T_area_range = with_area(scan, instrument)
    return int((~inside(scan_area(instrument, scan.noise), apply(T_area_range, scan.points_range))).sum())


def with_area(scan: Scan, instrument: Instrument) -> tuple[Instrument, NDArray]:
    """The instrument with an area, and the shift (4, 4) of readings into its range frame: as they are, where the area is given.

    Else the area is what the readings span, from a corner of theirs, in cells no smaller than from one stripe to the next.
    """
    points = scan.points_range
    if not len(points):
        raise BadInput("the scan has no reading, so there is no depth map.")
    if instrument.area is not None:
        return instrument, np.eye(4)
    low, high = np.quantile(points[:, :2], SPAN, axis=0)
    least = max(instrument.cell, round(stripe_spacing(scan), 4), float((high - low).max()) / (MAX_SIDE_CELLS - 8))
    cell = min(least, MAX_CELL_M)
    corner = (np.floor(low / cell) - 2) * cell
    sides = np.clip(np.ceil((high - corner) / cell) + 2, 1, MAX_SIDE_CELLS) * cell
    T_world_area = instrument.T_world_range @ transform(None, (corner[0], corner[1], 0.0))
    moved = replace(instrument, area=(float(sides[0]), float(sides[1])), cell=cell, T_world_range=T_world_area)
    return moved, transform(None, (-corner[0], -corner[1], 0.0))


def stripe_spacing(scan: Scan) -> float:
    """The median distance [m] across the range frame's plane from one photograph's stripe to the next's; 0 with a single stripe."""
    spacings = []
    steps = max(1, len(scan.looks) // SPACING_LOOKS)
    for one, after in list(zip(scan.looks[:-1], scan.looks[1:], strict=True))[::steps]:
        if len(one.points) and len(after.points):
            away, _ = KDTree(after.points[:, :2]).query(one.points[:: max(1, len(one.points) // SPACING_LOOKS), :2])
            spacings.append(float(np.median(away)))
    return float(np.median(spacings)) if spacings else 0.0
