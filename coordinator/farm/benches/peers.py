"""The farm beside Dask and Ray in one run: 12 kB jobs that compute nothing, on two workers.

    python3 -m venv peers && peers/bin/pip install "dask[distributed]" ray numpy
    peers/bin/python coordinator/farm/benches/peers.py [CASES]

The farm hands out every case under a lease and is done when the last result is durable in the
library; Dask and Ray keep their jobs and results in memory. CPU time is that of all processes, the
PostgreSQL server's included.
"""

import os
import subprocess
import sys
import time

import numpy
import psutil

WORKERS = 2
# Three passes of 500 frequency bins, as a case of a campaign has them.
FEATURES = numpy.sin(numpy.arange(1500.0))
# Jobs handed over at a time: peers slow down where all are submitted at once.
AT_A_TIME = 2000


def cpu_s(processes):
    """CPU time so far of these processes, in s."""
    total = 0.0
    for process in processes:
        try:
            times = process.cpu_times()
            total += times.user + times.system
        except psutil.NoSuchProcess:
            pass
    return total


def family():
    """This process and all it has started."""
    me = psutil.Process()
    return [me, *me.children(recursive=True)]


def measured(name, cases, work):
    """Runs `work` on so many cases; answers (name, cases a second, CPU in ms a case)."""
    work(200)
    processes = family()
    cpu, begun = cpu_s(processes), time.perf_counter()
    done = 0
    while done < cases:
        batch = min(AT_A_TIME, cases - done)
        assert work(batch) == batch
        done += batch
    seconds, cpu = time.perf_counter() - begun, cpu_s(processes) - cpu
    return name, cases / seconds, 1e3 * cpu / cases


def no_op(_index):
    """A case."""
    return FEATURES.copy()


def of_dask(cases):
    """Dask: a scheduler and two worker processes."""
    import dask.distributed as dask

    with dask.LocalCluster(
        n_workers=WORKERS, threads_per_worker=1, dashboard_address=None
    ) as cluster, dask.Client(cluster) as client:

        def work(count):
            futures = client.map(no_op, range(count), pure=False)
            return sum(it.size == FEATURES.size for it in client.gather(futures))

        return measured("Dask " + dask.__version__, cases, work)


def of_ray(cases):
    """Ray: two worker processes."""
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    os.environ["RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO"] = "0"
    import ray

    ray.init(num_cpus=WORKERS, include_dashboard=False, logging_level="error")
    remote = ray.remote(no_op)

    def work(count):
        results = ray.get([remote.remote(index) for index in range(count)])
        return sum(it.size == FEATURES.size for it in results)

    try:
        return measured("Ray " + ray.__version__, cases, work)
    finally:
        ray.shutdown()


def of_farm(cases):
    """The farm's own benchmark: rows of a table `| name | ... | cases a second | CPU in ms |`."""
    command = ["cargo", "bench", "-q", "-p", "tracktwin", "--bench", "farm", "--"]
    said = subprocess.run(
        [*command, "throughput", "--cases", str(cases)], check=True, stdout=subprocess.PIPE, text=True
    )
    for line in said.stdout.splitlines():
        fields = [field.strip() for field in line.strip("| \n").split("|")]
        if len(fields) == 7 and fields[1].isdigit():
            yield fields[0], float(fields[3]), float(fields[4])


def main():
    """Prints the table."""
    cases = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    rows = list(of_farm(10 * cases))
    slowest = min(row[1] for row in rows)
    print("| 12 kB cases, 2 workers | cases a second | CPU in ms a case | the slower farm is |")
    print("|---|---|---|---|")
    for name, rate, cpu_ms in rows:
        print(f"| {name} | {rate:.0f} | {cpu_ms:.3f} | |")
    for peer in (of_dask, of_ray):
        name, rate, cpu_ms = peer(cases)
        print(f"| {name}, in memory | {rate:.0f} | {cpu_ms:.3f} | {slowest / rate:.1f} times |")


if __name__ == "__main__":
    main()
