#!/usr/bin/env python3
"""Maps of the same sweeps with the poses of several odometries, scored by `replica-lab evaluate map`, and its measures again in numpy and
scipy.

  python3 -m venv venv && venv/bin/pip install numpy scipy
  cargo build --release -p replica_lab
  venv/bin/python lab/peers/map_quality.py FOLDER truth=FOLDER/poses.txt ours=FOLDER/odometry/ours.txt ...

FOLDER is what lab/peers/odometry.py reads (its poses.txt and odometry/*.txt are poses at the last shot of each sweep, KITTI).
Every point is placed between the poses of the sweep before and of its own by its time (position linearly, rotation by its
vector); points that move by the truth (moving/*.npy) or are beyond --max-range are left out. The whole trajectory is fitted to
the truth rigidly, so that distances are defined. All clouds have the same returns.

Exit code 1: of a piece of each cloud, thickness or entropy by numpy differ from replica's by 1e-6 or more.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

RADIUS, MIN_POINTS, MIN_FACADE, MAX_THICKNESS = 0.3, 8, 30, 0.1


def poses(path):
    rows = np.loadtxt(path).reshape(-1, 3, 4)
    return Rotation.from_matrix(rows[:, :, :3]), rows[:, :, 3]


def fitted(rotations, positions, to):
    """moved rigidly onto `to` by the least squares of the positions and rotations"""
    to_rotations, to_positions = to
    both = np.einsum("nij,nkj->ik", to_rotations.as_matrix(), rotations.as_matrix())
    u, _, v = np.linalg.svd(both)
    turn = Rotation.from_matrix(u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v)
    return turn * rotations, turn.apply(positions - positions.mean(0)) + to_positions.mean(0)


def cloud(folder, rotations, positions, first, count, max_range):
    parts = []
    for i in range(max(first, 1), min(first + count, len(positions))):
        points = np.fromfile(f"{folder}/velodyne/{i:06}.bin", np.float32).reshape(-1, 4)[:, :3].astype(float)
        times_at = f"{folder}/times/{i:06}.npy"
        # Without point times a sweep is rigid.
        times = np.load(times_at) if os.path.exists(times_at) else np.ones(len(points))
        share = (times / times.max())[:, None]
        keep = np.linalg.norm(points, axis=1) < max_range
        if os.path.exists(f"{folder}/moving/{i:06}.npy"):
            keep &= np.load(f"{folder}/moving/{i:06}.npy") == 0
        points, share = points[keep], share[keep]
        step = (rotations[i - 1].inv() * rotations[i]).as_rotvec()
        turns = rotations[i - 1] * Rotation.from_rotvec(share * step)
        parts.append(turns.apply(points) + positions[i - 1] + share * (positions[i] - positions[i - 1]))
    return np.concatenate(parts)


def write_ply(path, points):
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    with open(path, "wb") as file:
        file.write((header + "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n").encode())
        file.write(np.ascontiguousarray(points, "<f8").tobytes())


def spread(points, tree, centers):
    """number, sorted deviations, normal of the points around each center"""
    for center, idxs in zip(centers, tree.query_ball_point(centers, RADIUS)):
        some = points[idxs] - center
        if len(some) >= MIN_POINTS:
            variances, axes = np.linalg.eigh(np.cov(some.T, bias=True))
            yield len(some), np.maximum(variances, 0), axes[:, 0]


def measures(points):
    """thickness (median, mean), entropy and number of facades as defined in docs/reference/measures.md, over all points"""
    points = (points - np.round(points[0])).astype(np.float32).astype(float)
    tree = cKDTree(points)
    entropies = [0.5 * np.sum(np.log(2 * np.pi * np.e * (v + 1e-6))) for _, v, _ in spread(points, tree, points)]
    cubes = np.floor(points / RADIUS).astype(np.int64)
    off = ((points / RADIUS - cubes - 0.5) ** 2).sum(1)
    order = np.lexsort((off, *cubes.T))
    is_first = np.r_[True, np.any(np.diff(cubes[order], axis=0) != 0, axis=1)]
    thickness = [np.sqrt(v[0]) for n, v, normal in spread(points, tree, points[order[is_first]])
                 if n >= MIN_FACADE and np.sqrt(v[1]) >= 0.3 * RADIUS and abs(normal[2]) <= 0.2588]
    thin = np.array([t for t in thickness if t <= MAX_THICKNESS])
    return np.median(thin), np.mean(thin), np.mean(entropies), len(thin)


def piece(points):
    """what numpy can do in half a minute: every twentieth point around the middle"""
    return points[(np.abs(points - np.median(points, 0)) < 15).all(1)][::20]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("poses", nargs="+", metavar="NAME=POSES")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--max-range", type=float, default=30.0)
    parser.add_argument("--replica-lab", default="target/release/replica-lab")
    parser.add_argument("--out", help="keeps the clouds, and pictures of them from above")
    parser.add_argument("--no-numpy", action="store_true")
    args = parser.parse_args()
    out = args.out or tempfile.mkdtemp()
    os.makedirs(out, exist_ok=True)
    truth = poses(f"{args.folder}/poses.txt")
    clouds = {}
    for name, path in (entry.split("=", 1) for entry in args.poses):
        rotations, positions = poses(path)
        n = min(len(positions), len(truth[1]))
        part = slice(args.first, min(args.first + args.count, n))
        moved = fitted(rotations[part], positions[part], (truth[0][part], truth[1][part]))
        # The fit is of the part that is mapped; the poses before it keep their numbers.
        whole = rotations.as_matrix()[:n].copy(), positions[:n].copy()
        whole[0][part], whole[1][part] = moved[0].as_matrix(), moved[1]
        clouds[name] = cloud(args.folder, Rotation.from_matrix(whole[0]), whole[1], args.first + 1, args.count - 1, args.max_range)
        write_ply(f"{out}/{name}.ply", clouds[name])
    write_ply(f"{out}/right.ply", cloud(args.folder, *truth, args.first + 1, args.count - 1, args.max_range))
    command = [args.replica_lab, "evaluate", "map", *(f"{out}/{name}.ply" for name in clouds), "--truth", f"{out}/right.ply",
               "--out", f"{out}/report"]
    subprocess.run(command, check=True)
    if args.no_numpy:
        return
    pieces = {name: piece(points) for name, points in clouds.items()}
    for name, points in pieces.items():
        write_ply(f"{out}/{name}_piece.ply", points)
    command = [args.replica_lab, "evaluate", "map", *(f"{out}/{name}_piece.ply" for name in pieces), "--samples", "1000000000",
               "--out", f"{out}/report_of_pieces"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    worst = 0.0
    print("\n| piece | points | facades | thickness, cm: median | mean | entropy | largest difference |\n|---|---|---|---|---|---|---|")
    for ours, (name, points) in zip(json.load(open(f"{out}/report_of_pieces/map.json")), pieces.items()):
        median, mean, entropy, n = measures(points)
        thickness = ours["facade_thickness_m"]
        off = max(abs(median - thickness["median"]), abs(mean - thickness["mean"]), abs(entropy - ours["mean_map_entropy"]))
        print(f"| {name} | {len(points)} | {n} | {100 * median:.3f} | {100 * mean:.3f} | {entropy:.4f} | {off:.1e} |")
        worst = max(worst, off, abs(n - thickness["n"]))
    sys.exit(0 if worst < 1e-6 else 1)


if __name__ == "__main__":
    main()
