"""The same functions from the shell. `handey COMMAND --help` tells each command's options."""

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from handey_studio.base import BadInput, Entry, describe
from handey_studio.base.files import replace_file
from handey_studio.world import Library

if TYPE_CHECKING:
    from handey_studio.sensing.depth_view import DepthView
    from handey_studio.session import Session
    from handey_studio.task import MoveCommand, MoveResult

# Each command imports the rooms that it needs when it runs: together they take seconds to load.
DONE, FAILED, BAD_INPUT, NOTHING_FOUND = 0, 1, 2, 3
SCAN_CALIBRATE = (
    "camera and laser plane from photographs of a flat board: NAME.png shows the board, NAME.laser.png the same with the laser on "
    "(without such partners the stripe is looked for in the board's photographs), NAME.moved.png the same board after the rig's steps"
)
TWO_WORDS = ("scan calibrate", "scan simulate")


class _Parser(argparse.ArgumentParser):
    """Bad arguments in one sentence, without the usage lines."""

    def error(self, message: str) -> NoReturn:
        raise BadInput(f"{self.prog}: {message}; see {self.prog} --help.")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; the exit status: 0 done, 1 a MOVE failed, 2 bad input, 3 nothing found."""
    try:
        given = _parser().parse_args(_words(sys.argv[1:] if arguments is None else arguments))
        return given.run(given)
    except BadInput as error:
        print(error, file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("stopped.", file=sys.stderr)
        return 130


def _words(arguments: Sequence[str]) -> list[str]:
    """The arguments, a command of two words as one: a folder that is called calibrate is ./calibrate."""
    two = " ".join(arguments[:2])
    return [two, *arguments[2:]] if two in TWO_WORDS else list(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="handey", description="Locate parts in a pile, choose grasps, plan and place, and understand every decision.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", parser_class=_Parser)

    def command(name: str, run: Callable[[argparse.Namespace], int], text: str) -> argparse.ArgumentParser:
        added = commands.add_parser(name, help=text, description=text)
        added.set_defaults(run=run)
        added.add_argument("--library", type=Path, help="folder with your own robots/, parts/ and sessions/")
        return added

    studio = command("studio", _studio, "open the workbench in the browser")
    studio.add_argument("session", nargs="?", default="figure1", help="a session file, or its name in a library (default: figure1)")
    studio.add_argument("--host", default="127.0.0.1", help="address to listen on (default: 127.0.0.1, this machine only)")
    studio.add_argument("--port", type=_port, default=8080, help="port to listen on (default: 8080)")
    _locate_arguments(command("locate", _locate, "find known parts in a depth image"))
    _scan_arguments(command("scan", _scan, "triangulate a folder of laser-stripe photographs into a cloud and a depth map"))
    _scan_calibrate_arguments(command("scan calibrate", _scan_calibrate, SCAN_CALIBRATE))
    _scan_simulate_arguments(command("scan simulate", _scan_simulate, "photographs of a session's scene, to try scan and calibrate on"))
    for name, run, text in (
        ("move", _move, "run a session's MOVEs: sense, plan, execute"),
        ("plan", _plan, "the same, but stop before executing"),
    ):
        _move_arguments(command(name, run, text))
    bench = command("bench", _bench, "measure on many random scenes")
    _bench_arguments(bench)
    return parser


def _bench_arguments(bench: argparse.ArgumentParser) -> None:
    bench.add_argument(
        "what", choices=("piles", "locate"), help="piles: one MOVE in each of many random piles; locate: every part in many scenes"
    )
    bench.add_argument("--seeds", type=_seeds, help="FIRST:END of the seeds (default: 0:20)")
    bench.add_argument("--json", type=Path, help="write the table here")
    locate = bench.add_argument_group("bench locate")
    locate.add_argument(
        "--scenes", type=Path, help="folder of scenes, simulated or labelled real ones; with --seeds, where simulated ones are kept"
    )
    locate.add_argument("--sensor", choices=("camera", "range_finder"), default="camera", help="what sees new scenes (default: camera)")
    locate.add_argument("--peers", action="store_true", help="ask Open3D and OpenCV the same questions, as far as they are installed")
    locate.add_argument("--peer-python", metavar="PYTHON", help="interpreter of the environment that holds the peers (default: this one)")
    locate.add_argument("--peer-poses", type=_positive, default=1, help="poses that each peer may report for a part (default: 1, its best)")
    locate.add_argument("--plot", type=Path, help="draw recall, precision and time into a .png, .svg or .pdf")


def _locate_arguments(locate: argparse.ArgumentParser) -> None:
    locate.add_argument("--depth", required=True, type=Path, help="16-bit PNG, or a cloud: .npy, .ply, .pcd")
    locate.add_argument("--camera", type=Path, help="camera JSON with fx fy cx cy depth_scale (a cloud can do without)")
    locate.add_argument("--cloud-unit", choices=("m", "cm", "mm"), default="m", help="unit of a cloud's coordinates (default: m)")
    locate.add_argument("--part", required=True, action="append", help="a part by name, or a mesh file; may be given again")
    locate.add_argument("--part-scale", type=float, default=1.0, help="scales mesh files on reading: 0.001 for millimetres")
    locate.add_argument("--max-poses", type=_positive, default=5, help="at most this many of each part (default: 5)")
    locate.add_argument("--seed", type=int, default=0)
    locate.add_argument("--json", required=True, type=Path, help="where the poses go")
    locate.add_argument("--depth-map", type=Path, metavar="MAP.npz", help="where the grid of elevations goes, for a recorded cell")


def _scan_arguments(scan: argparse.ArgumentParser) -> None:
    scan.add_argument(
        "folder", type=Path, help="the photographs, png or jpg, in the order of their names; NAME.dark.png or dark.png: laser off"
    )
    scan.add_argument("--calibration", required=True, type=Path, help="the range finder's file (from scan calibrate, or written by hand)")
    scan.add_argument("--dark", type=Path, help="the dark frame of photographs without one of their own")
    scan.add_argument("--cloud", type=Path, metavar="OUT.ply", help="where the readings go, in metres, in the world's frame")
    scan.add_argument(
        "--depth", type=Path, metavar="OUT", help=".npy or .png: depth image for locate, its camera beside it; .npz: depth map"
    )
    scan.add_argument("--json", type=Path, help="where the counts, the noise and the timing go")
    scan.add_argument("--channel", default="auto", help="the laser's colour: auto, red, green, blue or grey (default: auto)")
    scan.add_argument("--stripe", default="auto", help="how the stripe runs through the photographs: auto, down or across (default: auto)")
    scan.add_argument(
        "--step-mm", type=_three, metavar="X,Y,Z", help="the rig's step between photographs, in the range frame (default: the file's)"
    )
    scan.add_argument("--cell-mm", type=float, help="side of the depth map's cells (default: the file's, or the stripes' spacing)")


def _scan_calibrate_arguments(calibrate: argparse.ArgumentParser) -> None:
    calibrate.add_argument("folder", type=Path, help="the board's photographs: at least 3 poses, tilted both ways by some 30°")
    calibrate.add_argument(
        "--board", required=True, type=_board_size, metavar="COLSxROWS", help="its INNER corners: 10 × 7 squares have 9x6"
    )
    calibrate.add_argument("--square-mm", required=True, type=float, help="side of a square; between circles, their distance")
    calibrate.add_argument("--out", required=True, type=Path, help="where the range finder's file goes")
    calibrate.add_argument("--pattern", default="chessboard", help="chessboard or circles (a square grid of dots; default: chessboard)")
    calibrate.add_argument("--camera", type=Path, help="a range finder's file whose camera is kept; only the laser is calibrated")
    calibrate.add_argument("--table", metavar="NAME", help="photograph whose board is z = 0 of the range frame (default: the first)")
    calibrate.add_argument("--moved-steps", type=_positive, default=1, help="steps of the rig from NAME to NAME.moved (default: 1)")
    calibrate.add_argument("--step-mm", type=float, help="length of a step, where it is known better than photographs tell")
    calibrate.add_argument("--channel", default="auto", help="the laser's colour: auto, red, green, blue or grey (default: auto)")


def _scan_simulate_arguments(simulate: argparse.ArgumentParser) -> None:
    simulate.add_argument("session", help="a session file, or its name in a library")
    simulate.add_argument(
        "--out", required=True, type=Path, help="the folder to make, with boards/, stripes/ and the true range finder's file"
    )
    simulate.add_argument(
        "--rig", choices=("stage", "sweep"), default="stage", help="stage: one moving camera with a lens; sweep: the cell's own"
    )
    simulate.add_argument("--stripes", type=_positive, default=100, help="photographs of stripes (default: 100)")
    simulate.add_argument("--boards", type=_positive, default=10, help="poses of the chessboard, 9x6 corners of 20 mm (default: 10)")
    simulate.add_argument("--laser", default="red", help="red, green or grey (default: red)")
    simulate.add_argument("--seed", type=int, default=0)


def _move_arguments(move: argparse.ArgumentParser) -> None:
    move.add_argument("session", help="a session file, or its name in a library")
    move.add_argument("--part", help="move this part instead of running the session's own commands")
    move.add_argument("--to", metavar="DESTINATION", help="x,y,z[,roll,pitch,yaw] (metres, degrees) or on:PART[:POSE]")
    move.add_argument("--seed", type=int, help="instead of the session's own seed")
    move.add_argument("--json", type=Path, help="where the steps, the certificate and the ledger go")
    move.add_argument("--save", type=Path, metavar="SESSION2", help="where the session with its results goes")


def _studio(given: argparse.Namespace) -> int:
    from handey_studio.app import run
    from handey_studio.session import find_session

    library = Library.choose(given.library)
    run(find_session(library, given.session), host=given.host, port=given.port, library=library)
    return DONE


def _locate(given: argparse.Namespace) -> int:
    from handey_studio.localization import LocateOptions, localize
    from handey_studio.localization.report import locate_report
    from handey_studio.sensing.files import read_depth
    from handey_studio.sensing.report import seen_report
    from handey_studio.sensing.support import support_planes

    for output in (given.json, given.depth_map):
        _check_output(output)
    library = Library.choose(given.library)
    parts = [library.part(name, given.part_scale) for name in given.part]
    begun = time.perf_counter()
    reading, supports = read_depth(given.depth, given.camera, given.cloud_unit), None
    timing, view, options = {"read": time.perf_counter() - begun}, reading.view, LocateOptions(max_poses=given.max_poses)
    rng = np.random.default_rng(given.seed)
    if not reading.knows_world:
        begun = time.perf_counter()
        supports = support_planes(view, rng)
        view = replace(view, T_world_sensor=supports.table.T_world_sensor)
        options = options if supports.table.found else replace(options, table_z_m=None)
        timing["support"] = time.perf_counter() - begun
    if given.depth_map:
        _keep_map(given.depth_map, view)
    result = localize(view, parts, options, rng)
    report = locate_report(result, view.T_world_sensor, timing) | seen_report(reading, supports)
    for pose in report["poses"]:
        pose["T_file_part"] = (reading.T_file_sensor @ pose["T_sensor_part"]).tolist()
    _write_json(given.json, report)
    if not result.poses:
        print(result.reason, file=sys.stderr)
        return NOTHING_FOUND
    for pose in result.poses:
        x, y, z = pose.T_world_part[:3, 3]
        print(
            f"{pose.part} at {x:.4f}, {y:.4f}, {z:.4f} m, score {pose.score:.2f}, {pose.edges_found} of {pose.edges_predicted} edges found"
        )
    return DONE


def _scan(given: argparse.Namespace) -> int:
    from handey_studio.cell.recorded import write_depth_map
    from handey_studio.geometry.transforms import apply, transform
    from handey_studio.sensing.instrument_file import read_instrument
    from handey_studio.sensing.scan import ScanOptions, depth_map_of, scan_folder
    from handey_studio.sensing.scan_files import scan_view, write_cloud, write_view
    from handey_studio.sensing.scan_report import scan_lines, scan_report

    for output in (given.cloud, given.depth, given.json):
        _check_output(output)
    _check_suffix(given.cloud, ".ply")
    _check_suffix(given.depth, ".npy", ".png", ".npz")
    instrument = read_instrument(given.calibration)
    if given.cell_mm is not None:
        instrument = replace(instrument, cell=1e-3 * given.cell_mm)
    if given.step_mm is not None:
        instrument = replace(instrument, rig=None, rig_step=transform(None, 1e-3 * np.array(given.step_mm)))
    begun = time.perf_counter()
    scan = scan_folder(given.folder, instrument, given.dark, ScanOptions(given.channel, given.stripe), _Lines())
    timing = {"scan": time.perf_counter() - begun}
    depth_map = depth_map_of(scan, instrument) if len(scan.points_range) else None
    timing["fuse"] = time.perf_counter() - begun - timing["scan"]
    report = scan_report(scan, instrument, depth_map, timing)
    if given.json:
        _write_json(given.json, report)
    print("\n".join(scan_lines(report)))
    if depth_map is None:
        print(
            f'no stripe was read in the photographs of "{given.folder}"; try --channel or --stripe, or give a dark frame.', file=sys.stderr
        )
        return NOTHING_FOUND
    try:
        if given.cloud:
            write_cloud(given.cloud, apply(instrument.T_world_range, scan.points_range))
        if given.depth and given.depth.suffix.lower() == ".npz":
            write_depth_map(given.depth, depth_map)
        elif given.depth:
            write_view(given.depth, scan_view(scan, instrument))
    except OSError as error:
        raise BadInput(f'"{error.filename}" cannot be written: {error.strerror}.') from None
    return DONE


def _scan_calibrate(given: argparse.Namespace) -> int:
    from handey_studio.sensing.board import Board
    from handey_studio.sensing.calibrate import CalibrateOptions, calibrate
    from handey_studio.sensing.instrument_file import read_instrument, write_instrument
    from handey_studio.sensing.scan_report import calibration_lines, calibration_report

    _check_output(given.out)
    board = Board(given.board[0], given.board[1], 1e-3 * given.square_mm, given.pattern)
    camera = None if given.camera is None else read_instrument(given.camera).cameras[0]
    step_m = None if given.step_mm is None else 1e-3 * given.step_mm
    options = CalibrateOptions(given.channel, given.table, given.moved_steps, step_m)
    found = calibrate(given.folder, board, camera, options, _Lines())
    report = calibration_report(found)
    try:
        write_instrument(given.out, found.instrument, report)
    except OSError as error:
        raise BadInput(f'"{given.out}" cannot be written: {error.strerror}.') from None
    print("\n".join(calibration_lines(report)))
    return DONE


def _scan_simulate(given: argparse.Namespace) -> int:
    from handey_studio.cell.photographs import Exposure
    from handey_studio.cell.scan_folders import FolderOptions, moved_steps, write_stage_folder, write_sweep_folder
    from handey_studio.session import find_session, read_session
    from handey_studio.session.run import cell_of

    library = Library.choose(given.library)
    session = read_session(find_session(library, given.session))
    options = FolderOptions(given.stripes, given.boards, Exposure(colour=given.laser))
    write = write_stage_folder if given.rig == "stage" else write_sweep_folder
    _check_output(given.out)
    bodies, rng = cell_of(session, library).true_scene(), np.random.default_rng(given.seed)
    made = write(given.out, session.workcell.finder, bodies, options, rng, _Lines())
    true = given.out / "true-range-finder.json"
    print(f"{given.stripes} stripes for each of {len(made.cameras)} cameras in {given.out / 'stripes'}; now try")
    if given.rig == "stage":
        steps = f"--moved-steps {moved_steps(made)}"
        print(f"  handey scan calibrate {given.out / 'boards'} --board 9x6 --square-mm 20 {steps} --out finder.json")
    print(f"  handey scan {given.out / 'stripes'} --calibration {'finder.json' if given.rig == 'stage' else true} --cloud cloud.ply")
    return DONE


def _keep_map(path: Path, view: "DepthView") -> None:
    from handey_studio.cell.recorded import write_depth_map
    from handey_studio.sensing.view_map import depth_map_of

    try:
        write_depth_map(path, depth_map_of(view))
    except OSError as error:
        raise BadInput(f'"{path}" cannot be written: {error.strerror}.') from None


def _move(given: argparse.Namespace) -> int:
    return _run_moves(given, execute=True)


def _plan(given: argparse.Namespace) -> int:
    return _run_moves(given, execute=False)


def _run_moves(given: argparse.Namespace, execute: bool) -> int:
    from handey_studio.session import find_session, read_session, write_session
    from handey_studio.session.run import cell_of, station_of
    from handey_studio.task import MoveOptions, run_move
    from handey_studio.task.report import move_report

    for output in (given.json, given.save):
        _check_output(output)
    library = Library.choose(given.library)
    session = read_session(find_session(library, given.session))
    commands = _commands(given, session)
    seed = session.seed if given.seed is None else given.seed
    station, cell = station_of(session, library), cell_of(session, library)
    results, scene = [], None
    for command in commands:
        scene, result = run_move(station, cell, command, MoveOptions(seed=seed), execute, _Lines())
        results.append(result)
        _tell(result)
        if result.status == "failed":
            break
    if given.json:
        _write_json(given.json, move_report(results, station.robot))
    if given.save:
        now = cell.setup_now() if execute else session.cell_now
        write_session(given.save, replace(session, commands=commands, seed=seed, scene=scene, results=tuple(results), cell_now=now))
    return DONE if len(results) == len(commands) and all(result.status != "failed" for result in results) else FAILED


def _commands(given: argparse.Namespace, session: "Session") -> "tuple[MoveCommand, ...]":
    from handey_studio.task import MoveCommand

    if (given.part is None) != (given.to is None):
        raise BadInput("--part and --to go together: MOVE part TO destination.")
    if given.part is not None:
        return (MoveCommand(given.part, given.to),)
    if not session.commands:
        raise BadInput(f'session "{session.name}" has no commands; give --part and --to.')
    return session.commands


def _tell(result: "MoveResult") -> None:
    stages = ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in result.timing_s.items())
    print(f"MOVE {result.command.part} TO {result.command.to}: {result.status}{': ' + result.reason if result.reason else ''}")
    print(f"  {stages}")
    if result.plan is not None:
        certificate = result.plan.certificate
        clearance = f"{1e3 * certificate.least_clearance:.1f} mm ({' and '.join(certificate.bodies)})"
        print(f"  grasp: {result.plan.grasp.group}; least clearance {clearance}")
    elif result.ledger:
        print(f"  {len(result.ledger)} options in the ledger; the last: {_last_reason(result.ledger)}")


def _last_reason(entries: tuple[Entry, ...]) -> str:
    return next((f"{entry.stage} {entry.option}: {describe(entry)}" for entry in reversed(entries) if entry.reason), "none fell")


class _Lines:
    """Progress as lines on standard error when a person watches."""

    cancelled = False

    def report(self, fraction: float, message: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\033[K{100 * fraction:3.0f} % {message[:90]}", end="", file=sys.stderr, flush=True)


def _bench(given: argparse.Namespace) -> int:
    _check_output(given.json)
    report = _bench_piles(given) if given.what == "piles" else _bench_locate(given)
    if given.json:
        _write_json(given.json, report)
    return DONE


def _bench_piles(given: argparse.Namespace) -> dict[str, Any]:
    from handey_studio.task.bench import bench_piles

    return bench_piles(given.seeds or range(20), Library.choose(given.library), tell=print)


def _bench_locate(given: argparse.Namespace) -> dict[str, Any]:
    from handey_studio.task.bench_locate import run_bench

    _check_output(given.plot)
    return run_bench(
        Library.choose(given.library),
        tell=lambda line: print(f"\r\033[K{line}" if sys.stderr.isatty() else line, flush=True),
        progress=_Lines(),
        seeds=given.seeds,
        scenes=given.scenes,
        sensor=given.sensor,
        peers=given.peers,
        peer_python=given.peer_python,
        peer_poses=given.peer_poses,
        plot_to=given.plot,
    )


def _write_json(path: Path, content: dict[str, Any]) -> None:
    try:
        replace_file(path, (json.dumps(content, allow_nan=False) + "\n").encode())
    except OSError as error:
        raise BadInput(f'"{path}" cannot be written: {error.strerror}.') from None


def _check_output(path: Path | None) -> None:
    """Raises BadInput before any work is done when there is no folder to write into."""
    if path is not None and not path.parent.is_dir():
        raise BadInput(f'"{path}" cannot be written: the folder "{path.parent}" does not exist.')


def _check_suffix(path: Path | None, *allowed: str) -> None:
    """Raises BadInput before any work is done for a file that would be of no known kind."""
    if path is not None and path.suffix.lower() not in allowed:
        raise BadInput(f'"{path}" has the suffix "{path.suffix}"; it must be one of {", ".join(allowed)}.')


def _board_size(text: str) -> tuple[int, int]:
    columns, _, rows = text.lower().partition("x")
    if not (columns.isdigit() and rows.isdigit()):
        raise argparse.ArgumentTypeError(f'"{text}" is not COLSxROWS, the numbers of inner corners, such as 9x6')
    return int(columns), int(rows)


def _three(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f'"{text}" is not X,Y,Z, three numbers') from None
    return x, y, z


def _port(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f'"{text}" is not a port from 1 to 65535')
    return int(text)


def _positive(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 1000:
        raise argparse.ArgumentTypeError(f'"{text}" is not a whole number from 1 to 1000')
    return int(text)


def _seeds(text: str) -> range:
    first, colon, end = text.partition(":")
    if not (first.isdigit() and (end.isdigit() or not colon)):
        raise argparse.ArgumentTypeError(f'"{text}" is not FIRST:END')
    return range(int(first), int(end) if colon else int(first) + 1)


if __name__ == "__main__":
    raise SystemExit(main())
