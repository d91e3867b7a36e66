#!/usr/bin/env python3
"""Checks `replica-lab evaluate trajectory` against evo and KITTI's development kit on the same files.

  python3 -m venv venv && venv/bin/pip install evo==1.38.1 numpy
  cargo build --release -p replica_lab
  venv/bin/python lab/peers/trajectory.py TRUTH ESTIMATE [options of replica-lab evaluate trajectory, as --of lidar]
  venv/bin/python lab/peers/trajectory.py --frozen      the numbers of the test in the tool

evo is asked for APE (translation, rotation angle) and RPE (1 pose, 10 m; consecutive intervals) with each alignment; the
kit's evaluate_odometry.cpp is written out below in numpy. Association differs by intent (evo takes the nearest stamp within
10 ms, replica interpolates the truth), so evo gets the pairs that replica wrote. Exit code 1 if a number differs by 1e-6.
"""
import argparse, json, os, subprocess, sys, tempfile
import numpy as np
from evo.core import metrics, trajectory
from evo.core.metrics import PoseRelation, Unit
from evo.tools import file_interface

RELATIONS = dict(m=PoseRelation.translation_part, deg=PoseRelation.rotation_angle_deg)
NAMES = ["rmse", "mean", "median", "max", "min", "std"]
OURS = dict(std="deviation")


def evo_numbers(truth, estimate, align):
    """{(error, unit): {name: value}} in replica's order"""
    moved = trajectory.PoseTrajectory3D(estimate.positions_xyz.copy(), estimate.orientations_quat_wxyz.copy(), estimate.timestamps.copy())
    if align in ("se3", "sim3"):
        moved.align(truth, correct_scale=align == "sim3")
    elif align == "first":
        moved.align_origin(truth)
    found = []
    for relation in RELATIONS.values():
        ape = metrics.APE(relation)
        ape.process_data((truth, moved))
        found.append(ape.get_all_statistics())
    for delta, unit in ((1, Unit.frames), (10, Unit.meters)):
        for relation in RELATIONS.values():
            rpe = metrics.RPE(relation, delta, unit, all_pairs=False)
            rpe.process_data((truth, moved))
            found.append(rpe.get_all_statistics())
    return found


def kit(gt, est, lengths=(100, 200, 300, 400, 500, 600, 700, 800), step=10):
    """devkit/cpp/evaluate_odometry.cpp: trajectoryDistances, lastFrameFromSegmentLength, calcSequenceErrors"""
    dist = [0.0]
    for a, b in zip(gt, gt[1:]):
        dist.append(dist[-1] + np.sqrt(((a[:3, 3] - b[:3, 3]) ** 2).sum()))
    errors = []
    for first in range(0, len(gt), step):
        for length in lengths:
            last = next((i for i in range(first, len(dist)) if dist[i] > dist[first] + length), -1)
            if last == -1:
                continue
            delta_gt = np.linalg.inv(gt[first]) @ gt[last]
            delta_est = np.linalg.inv(est[first]) @ est[last]
            error = np.linalg.inv(delta_est) @ delta_gt
            angle = np.arccos(np.clip(0.5 * (np.trace(error[:3, :3]) - 1.0), -1.0, 1.0))
            errors.append((length, np.linalg.norm(error[:3, 3]) / length, angle / length))
    return errors


def compare(files, options, replica_lab):
    truth, estimate = (file_interface.read_tum_trajectory_file(f) for f in files)
    worst = 0.0
    # The last one's segments are compared: without a scale.
    for align in ("sim3", "first", "se3", "none"):
        with tempfile.TemporaryDirectory() as out:
            subprocess.run([replica_lab, "evaluate", "trajectory", *files, "--align", align, "--out", out, *options],
                           check=True, stdout=subprocess.DEVNULL)
            ours = json.load(open(os.path.join(out, "evaluation.json")))
        print(f"\naligned: {align}\n{'':28}" + "".join(f"{name:>26}" for name in NAMES))
        for theirs, error in zip(evo_numbers(truth, estimate, align), ours["errors"]):
            row = [(error["of"][OURS.get(name, name)], theirs[name]) for name in NAMES]
            worst = max([worst, *(abs(a - b) for a, b in row)])
            cells = (f"{a:.9f} ({a - b:+.1e})" for a, b in row)
            print(f"{error['error'] + ', ' + error['unit']:28}" + "".join(f"{cell:>26}" for cell in cells))
    theirs = kit(truth.poses_se3, estimate.poses_se3)
    print("\nsegments                translation %      deg per 100 m")
    for segment in ours["segments"]:
        some = [e for e in theirs if segment["length_m"] in (None, e[0])]
        t, r = 100 * np.mean([e[1] for e in some]), 100 * np.rad2deg(np.mean([e[2] for e in some]))
        assert len(some) == segment["n"], (len(some), segment)
        off = segment["translation_percent"] - t, segment["rotation_deg_per_100_m"] - r
        worst = max(worst, *map(abs, off))
        print(f"{segment['length_m'] or 'all'!s:6}{segment['n']:6}{t:16.9f} ({off[0]:+.1e}){r:16.9f} ({off[1]:+.1e})")
    print(f"\nlargest difference {worst:.1e}")
    return worst < 1e-6


def exp(w):
    a = np.linalg.norm(w)
    if a == 0:
        return np.eye(3)
    k = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]) / a
    return np.eye(3) + np.sin(a) * k + (1 - np.cos(a)) * k @ k


def pose(t, w):
    p = np.eye(4)
    p[:3, :3], p[:3, 3] = exp(np.array(w, float)), t
    return p


def frozen():
    """the trajectories of tools/replica_lab/src/evaluate/trajectory/reference_tests.rs"""
    elsewhere, gt, est = pose([100, -20, 3], [0, 0, 0.7]), [], []
    for i in range(300):
        s = i * 1.2
        place = [s, 15 * np.sin(s / 40), 0.4 * np.cos(s / 25)]
        turn = [0.01 * np.sin(s / 10), 0.02 * np.cos(s / 15), np.arctan(0.375 * np.cos(s / 40))]
        drift = pose([0.004 * s, 0.3 * np.sin(s / 70), 0.001 * s], [0, 0, 0.0001 * s])
        gt.append(pose(place, turn))
        est.append(np.linalg.inv(elsewhere) @ gt[-1] @ drift)
    stamps = 0.1 * np.arange(300)
    truth, estimate = (trajectory.PoseTrajectory3D(poses_se3=p, timestamps=stamps) for p in (gt, est))
    for i, theirs in enumerate(evo_numbers(truth, estimate, "se3")):
        for name in NAMES[:4]:
            print(f'    ({i}, "{name}", {theirs[name]:.9f}),')
    errors = kit(gt, est)
    print([round(100 * np.mean([e[1] for e in errors]), 9), round(100 * np.rad2deg(np.mean([e[2] for e in errors])), 9)])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*")
    parser.add_argument("--replica-lab", default="target/release/replica-lab")
    parser.add_argument("--frozen", action="store_true")
    args, options = parser.parse_known_args()
    if args.frozen:
        return frozen()
    truth, estimate = args.files
    with tempfile.TemporaryDirectory() as pairs:
        subprocess.run([args.replica_lab, "evaluate", "trajectory", truth, estimate, "--align", "none", "--write", "tum", "--out", pairs,
                        *options], check=True, stdout=subprocess.DEVNULL)
        files = [os.path.join(pairs, name) for name in ("truth.txt", "estimate.txt")]
        sys.exit(0 if compare(files, [], args.replica_lab) else 1)


if __name__ == "__main__":
    main()
