#!/usr/bin/env python3
"""Neighborhoods compared with kiddo and SciPy's cKDTree: the same neighbors, and the seconds on one core and on two.

  pip install numpy scipy
  cargo build --release --manifest-path lab/peers/neighbors/Cargo.toml
  lab/peers/neighbors.py OUTPUT_FOLDER_OF_A_RUN [--points 2000000] [--k 16] [--radius 0.5] [--cores 1,2]

The cloud is every n-th point of all submaps. Best of two rounds, of the radius and of SciPy one; wall time and CPU time. The lists of the radius are counted and dropped. SciPy has f64, the others f32.
Exit code 1: the sums of the farthest neighbors' squared distances or the numbers of neighbors differ.
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

import numpy as np
from scipy.spatial import cKDTree

ROOT = pathlib.Path(__file__).resolve().parents[2]
PEER = ROOT / "lab/peers/neighbors/target/release/neighbors_peer"
TYPES = {"char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2", "int": "<i4", "uint": "<u4", "float": "<f4", "double": "<f8"}


def positions(path):
    """x y z of a binary PLY file."""
    with open(path, "rb") as file:
        header = ""
        while not header.endswith("end_header\n"):
            header += file.readline().decode()
        fields = np.dtype([(name, TYPES[kind]) for kind, name in re.findall(r"property (\w+) (\w+)\n", header)])
        rows = np.fromfile(file, fields, int(re.search(r"element vertex (\d+)", header)[1]))
    return np.stack([rows[axis] for axis in "xyz"], 1).astype("<f4")


def ours_and_kiddo(cloud, args, n_cores):
    cores = ",".join(map(str, range(n_cores)))
    command = ["taskset", "-c", cores, PEER, cloud, str(args.k), str(args.radius)]
    text = subprocess.run(command, env={**os.environ, "RAYON_NUM_THREADS": str(n_cores)}, check=True, capture_output=True, text=True).stdout
    return dict(line.split(": ", 1) for line in text.splitlines())


def scipy(points, args, n_cores):
    os.sched_setaffinity(0, range(n_cores))
    figures = {}

    def timed(name, work):
        start, cpu = time.perf_counter(), time.process_time()
        result = work()
        figures[f"scipy {name}"] = f"{time.perf_counter() - start:.3f} s, CPU {time.process_time() - cpu:.3f}"
        return result

    tree = timed("build", lambda: cKDTree(points))
    squared = timed("nearest", lambda: tree.query(points, args.k, workers=n_cores))[0][:, -1] ** 2
    figures["scipy sum"] = f"{squared.sum():.6f}"
    count = timed("within, lists dropped", lambda: tree.query_ball_point(points, args.radius, workers=n_cores, return_length=True)).sum()
    figures["scipy count"] = str(count)
    return figures


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("--points", type=int, default=2_000_000)
    parser.add_argument("--k", type=int, default=16)
    parser.add_argument("--radius", type=float, default=0.5)
    parser.add_argument("--cores", default="1,2")
    args = parser.parse_args()
    files = sorted(p for p in (args.run / "clouds").glob("submap_*.ply") if "spectra" not in p.name)
    n_all = [len(positions(file)) for file in files]
    every = max(1, sum(n_all) // args.points)
    points = np.concatenate([positions(file)[::every] for file in files])[: args.points]
    print(f"{len(points)} points, every {every}th of {sum(n_all)}")
    differs = False
    with tempfile.NamedTemporaryFile(suffix=".f32") as cloud:
        points.tofile(cloud.name)
        for n_cores in map(int, args.cores.split(",")):
            figures = ours_and_kiddo(cloud.name, args, n_cores) | scipy(points, args, n_cores)
            print(f"cores {n_cores}")
            for name, value in figures.items():
                print(f"  {name:32} {value}")
            sums = [float(figures[f"{who} sum"]) for who in ("ours", "kiddo", "scipy")]
            counts = [int(figures[f"{who} count"]) for who in ("ours", "kiddo", "scipy")]
            # Sums of f64 and f32; a point may lie on the sphere by one of them only.
            differs |= max(sums) > min(sums) * (1 + 1e-6) or max(counts) > min(counts) * (1 + 1e-6)
    return 1 if differs else 0


if __name__ == "__main__":
    sys.exit(main())
