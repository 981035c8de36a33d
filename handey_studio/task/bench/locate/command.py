"""What the command gathers: scenes from seeds or folders, Handey Studio and its peers, the table and the plot."""

import tempfile
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from handey_studio.base import Progress
from handey_studio.cell.scenes.pile_scenes import CAMERA
from handey_studio.task.bench.locate.answers import TOGETHER, Handey, Method
from handey_studio.task.bench.locate.labelled_scenes import load_labelled, scene_folders, simulate
from handey_studio.task.bench.locate.peers import LocatePeers, Peer
from handey_studio.task.bench.locate.plot import check_plot, plot
from handey_studio.task.bench.locate.run import bench_locate
from handey_studio.world.library import Library

SEEDS = range(20)


def run_bench(
    library: Library,
    tell: Callable[[str], None],
    progress: Progress,
    *,
    seeds: Iterable[int] | None = None,
    scenes: Path | None = None,
    sensor: str = CAMERA,
    ask: str = TOGETHER,
    peers: bool = False,
    peer_python: str | None = None,
    peer_poses: int = 1,
    plot_to: Path | None = None,
) -> dict[str, Any]:
    """Measure and tell. Scenes are those in the folder `scenes`; with `seeds`, those seeds' simulated ones as `sensor` sees them, made
    there if they are missing; without a folder they are made and forgotten. `ask` for a scene's parts "together" or "each" alone; peers
    are asked for each. Raises BadInput, before any work where it can."""
    check_plot(plot_to)
    with ExitStack() as open_things:
        methods: list[Method] = [Handey(ask)]
        if peers or peer_python is not None:
            process = open_things.enter_context(LocatePeers(peer_python))
            methods += [Peer(process, name, peer_poses) for name in process.names]
        if scenes is not None and seeds is None:
            folders = scene_folders(scenes)
        else:
            place = scenes or Path(open_things.enter_context(tempfile.TemporaryDirectory(prefix="handey-scenes-")))
            folders = simulate(SEEDS if seeds is None else seeds, place, library, sensor, progress)
        report = bench_locate(load_labelled(folders, library), methods, tell, progress, len(folders))
    if plot_to is not None and report["rows"]:
        plot(report["summary"], plot_to)
    return report | {"ask": ask}
