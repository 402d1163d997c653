"""A Dask cluster for `capsule campaign --scheduler`: SLURM jobs by dask-jobqueue, or with `--local` this machine.

Prints the scheduler's address, then waits until it is interrupted. SLURM needs `pip install dask-jobqueue`; the jobs
need the environment in which the program is installed.
"""

import argparse
import signal
import sys
from typing import Any


def cluster_of(asked: argparse.Namespace) -> Any:
    """The cluster: a worker for each core, one thread each."""
    if asked.local:
        from distributed import LocalCluster

        return LocalCluster(n_workers=asked.jobs, threads_per_worker=1, dashboard_address=None)
    from dask_jobqueue import SLURMCluster

    cluster = SLURMCluster(
        queue=asked.queue,
        cores=asked.cores,
        processes=asked.cores,
        memory=f"{2 * asked.cores} GB",
        walltime=asked.walltime,
        python=sys.executable,
    )
    cluster.scale(jobs=asked.jobs)
    return cluster


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--local", action="store_true", help="on this machine, without SLURM")
    parser.add_argument("--jobs", type=int, default=2, help="SLURM jobs, or local workers")
    parser.add_argument("--cores", type=int, default=16, help="cores, and so workers, of a job")
    parser.add_argument("--queue", default=None, help="partition of SLURM")
    parser.add_argument("--walltime", default="04:00:00", help="longest time of a job")
    with cluster_of(parser.parse_args()) as cluster:
        print(cluster.scheduler_address, flush=True)
        signal.sigwait({signal.SIGINT, signal.SIGTERM})


if __name__ == "__main__":
    main()
