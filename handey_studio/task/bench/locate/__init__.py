"""`handey bench locate`: recall, precision, pose errors and seconds of localization, beside other libraries on the same inputs."""

from handey_studio.task.bench.locate.command import run_bench
from handey_studio.task.bench.locate.run import bench_locate

__all__ = ["bench_locate", "run_bench"]
