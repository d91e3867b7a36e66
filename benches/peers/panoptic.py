#!/usr/bin/env python3
"""`replica evaluate instances` beside panopticapi's rule, written out over the same labels, on random clouds.

  pip install numpy && cargo build --release -p replica
  benches/peers/panoptic.py

Exit code 1: a figure differs by 0.01 % or more.
"""
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
VOID, OFFSET = 0, 1 << 32


def write(path, classes, instances):
    rows = np.zeros(len(classes), [("x", "<f4"), ("semantic", "u1"), ("instance", "<i4")])
    rows["semantic"], rows["instance"] = classes, instances
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n"
            "property float x\nproperty uchar semantic\nproperty int instance\nend_header\n")
    path.write_bytes(head.encode() + rows.tobytes())


def panoptic(truth, found, thing):
    """pq_compute_single_core of panopticapi for one class of things; truth without a number is a crowd."""
    (true_class, true_id), (found_class, found_id) = truth, found
    # Segments: 0 is void, a thing has a number of its own, the rest is one segment by class.
    segment = lambda c, i: np.where(c == VOID, 0, c.astype(np.int64) * 1_000_000 + i)
    gt, pred = segment(true_class, true_id), segment(found_class, np.where(found_class == thing, found_id, 0))
    unmatched = (found_class == thing) & (found_id == 0)
    pred = np.where(unmatched, 0, pred)
    gt_areas = dict(zip(*np.unique(gt, return_counts=True)))
    pred_areas = dict(zip(*np.unique(pred, return_counts=True)))
    pairs = dict(zip(*np.unique(gt * OFFSET + pred, return_counts=True)))
    pairs = {(int(k) // OFFSET, int(k) % OFFSET): v for k, v in pairs.items()}
    crowd = thing * 1_000_000
    things = lambda areas: [s for s in areas if s // 1_000_000 == thing and s != crowd]
    tp, iou, matched_gt, matched_pred = 0, 0.0, set(), set()
    for (g, p), n in pairs.items():
        if g in things(gt_areas) and p in things(pred_areas):
            value = n / (pred_areas[p] + gt_areas[g] - n - pairs.get((0, p), 0))
            if value > 0.5:
                tp, iou = tp + 1, iou + value
                matched_gt.add(g)
                matched_pred.add(p)
    fn = len(set(things(gt_areas)) - matched_gt)
    fp = sum(1 for p in things(pred_areas) if p not in matched_pred
             and (pairs.get((0, p), 0) + pairs.get((crowd, p), 0)) / pred_areas[p] <= 0.5)
    return tp + fn, tp + fp, tp / (tp + fn), iou / (tp + fp / 2 + fn / 2), iou / tp if tp else np.nan, tp / (tp + fp / 2 + fn / 2)


def labels(random, n):
    """Runs of points with one label, and the same with some labels changed."""
    lengths = random.integers(1, 60, n)
    classes = random.choice([0, 4, 7, 10], n, p=[0.1, 0.2, 0.2, 0.5])
    ids = np.where(np.isin(classes, (4, 10)), random.integers(0, 30, n), 0)
    truth = [np.repeat(values, lengths) for values in (classes, ids)]
    change = random.random(len(truth[0])) < random.uniform(0.05, 0.4)
    change = np.maximum.accumulate(np.where(change, np.arange(len(change)), 0)) % 3 == 0
    found = [np.where(change, random.permutation(values), values) for values in truth]
    found[1] = np.where(np.isin(found[0], (4, 10)), found[1], 0)
    return truth, found


def main():
    random = np.random.default_rng(3)
    worst = 0.0
    for _ in range(20):
        truth, found = labels(random, 300)
        with tempfile.TemporaryDirectory() as folder:
            paths = [pathlib.Path(folder) / name for name in ("truth.ply", "found.ply")]
            write(paths[0], *truth)
            write(paths[1], *found)
            command = [ROOT / "target/release/replica", "evaluate", "instances", *paths, "--min-points", "1"]
            lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[2:]
        for line, thing in zip(lines, (10, 4)):
            ours = [float(cell) if cell.strip() != "-" else np.nan for cell in line.strip("| ").split("|")[1:7]]
            n_true, n_found, *shares = panoptic(truth, found, thing)
            theirs = [n_true, n_found, *(100 * share for share in shares)]
            worst = max(worst, np.nanmax(np.abs(np.array(ours) - theirs)))
    print(f"20 clouds, two classes: largest difference {worst:.4f}")
    sys.exit(worst >= 0.01)


if __name__ == "__main__":
    main()
