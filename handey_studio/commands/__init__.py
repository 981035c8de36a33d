"""The shell's commands, one file each: its name, its one line of help, its arguments, and what it runs.

A command imports the rooms that it needs when it runs: together they take seconds to load.
"""

from handey_studio.commands import (
    bench_act,
    bench_locate,
    bench_motion,
    bench_moves,
    bench_space,
    calibrate,
    export,
    fit_score,
    guide,
    locate,
    model_replay,
    model_suggest,
    move,
    part_import,
    part_list,
    part_show,
    path,
    plan,
    robot_check,
    robot_list,
    scan,
    scan_calibrate,
    scan_simulate,
    studio,
)

COMMANDS = (
    studio,
    locate,
    scan,
    scan_calibrate,
    scan_simulate,
    model_replay,
    model_suggest,
    move,
    plan,
    path,
    calibrate,
    export,
    bench_moves,
    bench_act,
    bench_locate,
    bench_motion,
    bench_space,
    fit_score,
    part_import,
    part_list,
    part_show,
    robot_check,
    robot_list,
    guide,
)

__all__ = ["COMMANDS"]
