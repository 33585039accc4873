#!/usr/bin/env python3
"""Measures the program and what else does the same work, in one run, and prints one table.

    python3 tests/benches/peers.py --peers ../shared/peers [--environment DIR] [WORD ...]

Installs NumPy, SciPy, numba, scikit-learn, faiss and ssqueezepy into a virtual environment (DIR,
target/peers by default) unless they are there, runs every peer on one thread, then
`cargo bench -p tracktwin-benches --bench table`, and puts both side by side; with WORDs only the
groups of rows whose name holds one of them. Times are CPU times.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ["numpy", "scipy", "numba", "scikit-learn", "faiss-cpu", "ssqueezepy"]

# Work, our row, and for every peer: its name, its script and arguments, and how its figure in ms is
# found in what it prints.
CPU_MIN = r"cpu med +[\d.]+ +min +([\d.]+)"


def json_field(field, factor):
    return lambda text: factor * json.loads(text.strip().splitlines()[-1])[field]


def line_with(words):
    def find(text):
        for line in text.splitlines():
            if words in line:
                return float(re.search(CPU_MIN, line).group(1))
        raise ValueError(f"no line with '{words}'")

    return find


NUMBA = ("numba", ["numba_vti.py", "8", "8", "2"], json_field("us_per_step_cpu", 1e-3))
SCIPY = ("SciPy", ["numpy_vti.py", "--n-el", "8", "--spans", "1"], json_field("us_per_step", 1e-3))
SSQUEEZEPY = (
    "ssqueezepy",
    ["ml/sswt_bench_ssqueezepy.py"],
    line_with("ssq_cwt morlet6 nv48 529sc float64 P=4096 cache=True"),
)
SKLEARN = ("scikit-learn", ["ml/bench_gp_sklearn.py"], line_with("sklearn X300 LML+grad"))
SKLEARN_ONE = (
    "scikit-learn",
    ["ml/bench_gp_sklearn.py"],
    line_with("sklearn X300 predict 1 mean+std"),
)
LEAN = ("LAPACK", ["ml/gp_lean.py"], line_with("lean X300 NLML+grad"))
LEAN_ONE = ("LAPACK", ["ml/gp_lean.py"], line_with("lean X300 predict 1 mean+var"))
FAISS = ("faiss, f32", ["ml/bench_knn.py"], line_with("faiss IndexFlatL2 1 query"))
NUMPY_TEN = ("NumPy", ["ml/bench_knn.py"], line_with("numpy gemv + argpartition"))
ROWS = [
    ("time step, 25 spans of 8 elements", [NUMBA, SCIPY]),
    ("transform as features take it", [SSQUEEZEPY]),
    ("transform, every instant", [SSQUEEZEPY]),
    ("regression: likelihood and gradient, 5000", [LEAN, SKLEARN]),
    ("prediction of one", [LEAN_ONE, SKLEARN_ONE]),
    ("selector: ten of 10,000 x 304", [FAISS, NUMPY_TEN]),
]


def environment(folder):
    """The interpreter of a virtual environment that has the packages."""
    python = folder / "bin" / "python"
    if not python.exists():
        venv.create(folder, with_pip=True)
    install = [python, "-m", "pip", "install", "--quiet", *PACKAGES]
    subprocess.run(install, check=True)
    return python


def run_peer(python, peers, work, arguments):
    """What a peer prints; it works in `work`, where its data lie."""
    one_thread = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    cores = {"OPENBLAS_CORETYPE": "SKYLAKEX", "SSQ_PARALLEL": "0"}
    # What numba compiles is kept beside the data, for the peers' own folder may be read-only.
    cache = {"NUMBA_CACHE_DIR": str(work / "numba")}
    script = [python, peers / arguments[0], *arguments[1:]]
    done = subprocess.run(
        script,
        cwd=work,
        env={**os.environ, **one_thread, **cores, **cache},
        stdout=subprocess.PIPE,
        text=True,
    )
    return done.stdout


def ours(words):
    """Our rows: least and median CPU time in ms, and accuracy."""
    command = ["cargo", "bench", "--quiet", "-p", "tracktwin-benches", "--bench", "table"]
    command += ["--", *words]
    text = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    rows = [line.split("\t") for line in text.splitlines()[1:]]
    return {name: (float(least), float(median), accuracy) for name, least, median, accuracy in rows}


def peer_times(python, peers, work, words):
    """Every peer's figure in ms, by its name and script; a peer that fails has none."""
    if not (work / "X300.npy").exists():
        run_peer(python, peers, work, ["ml/gp_data.py"])
    printed, times = {}, {}
    wanted = [others for row, others in ROWS if not words or any(word in row for word in words)]
    for others in wanted:
        for name, arguments, find in others:
            key = " ".join(arguments)
            if key not in printed:
                print(f"running {key} ...", file=sys.stderr)
                printed[key] = run_peer(python, peers, work, arguments)
            try:
                times[name, find] = find(printed[key])
            except (ValueError, IndexError, KeyError) as error:
                print(f"{key}: no figure ({error})", file=sys.stderr)
    return times


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peers", type=Path, required=True, help="folder of the peers' scripts")
    parser.add_argument("--environment", type=Path, default=ROOT / "target" / "peers")
    parser.add_argument("words", nargs="*", metavar="WORD", help="groups of rows to measure")
    arguments = parser.parse_args()
    folder = arguments.environment.resolve()
    python = environment(folder)
    times = peer_times(python, arguments.peers.resolve(), folder, arguments.words)
    rows = ours(arguments.words)
    compared = dict(ROWS)
    print("| work | least (median) | accuracy | peers, and how many times as long they take |")
    print("|---|---|---|---|")
    for name, (least, median, accuracy) in rows.items():
        found = [(peer, times.get((peer, find))) for peer, _, find in compared.get(name, [])]
        cells = [f"{peer} {show(ms)}: {ms / least:.1f}" for peer, ms in found if ms]
        print(f"| {name} | {show(least)} ({show(median)}) | {accuracy} | {'; '.join(cells)} |")


def show(ms):
    """A time with its unit, to three digits."""
    for unit, factor in (("s", 1e-3), ("ms", 1.0), ("us", 1e3)):
        if ms * factor >= 1.0 or unit == "us":
            return f"{ms * factor:.3g} {unit}"
    return ""


if __name__ == "__main__":
    main()
