#!/usr/bin/env python3
"""`replica-lab evaluate instances` compared with panopticapi, the reference of panoptic quality, on the same labels of random clouds.

  pip install numpy pillow git+https://github.com/cocodataset/panopticapi    # or PYTHONPATH=<its checkout>
  cargo build --release -p replica_lab
  lab/peers/panoptic.py

A cloud is an image of one row for panopticapi: a segment for each thing, one for all of a class of stuff, and one marked
`iscrowd` for the points of a class of things that have no number. Exit code 1: a figure differs by 0.01 % or more.
"""
import contextlib
import io
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from panopticapi.evaluation import pq_compute_single_core
from panopticapi.utils import id2rgb
from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parents[2]
VOID, PEDESTRIAN, ROAD, VEHICLES = 0, 4, 7, 10
THINGS = (VEHICLES, PEDESTRIAN)
CATEGORIES = {c: {"id": c, "isthing": int(c in THINGS)} for c in (PEDESTRIAN, ROAD, VEHICLES)}
# Segments of class c are numbered from c * STEP; the first one has no number of its own.
STEP = 1000


def write(path, classes, instances):
    rows = np.zeros(len(classes), [("x", "<f4"), ("semantic", "u1"), ("instance", "<i4")])
    rows["semantic"], rows["instance"] = classes, instances
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n"
            "property float x\nproperty uchar semantic\nproperty int instance\nend_header\n")
    path.write_bytes(head.encode() + rows.tobytes())


def annotation(folder, name, classes, instances, is_truth):
    """The labels in the format of panopticapi: a picture of segments, and their classes."""
    segments = np.where(classes == VOID, VOID, classes.astype(np.int64) * STEP + instances)
    # Points that are predicted as a thing but have no number are not a segment.
    if not is_truth:
        segments[np.isin(classes, THINGS) & (instances == 0)] = VOID
    Image.fromarray(id2rgb(segments[None, :])).save(folder / f"{name}.png")
    ids, areas = np.unique(segments[segments != VOID], return_counts=True)
    info = [{"id": int(i), "category_id": int(i) // STEP, "area": int(n),
             "iscrowd": int(i % STEP == 0 and i // STEP in THINGS)} for i, n in zip(ids, areas)]
    return {"image_id": 0, "file_name": f"{name}.png", "segments_info": info}


def panoptic(folder, truth, found):
    """panopticapi's figures in the order of ours: true, found, SM, PQ, SQ, RQ, mIoU; by class."""
    pair = annotation(folder, "truth", *truth, True), annotation(folder, "found", *found, False)
    with contextlib.redirect_stdout(io.StringIO()):
        stat = pq_compute_single_core(0, [pair], folder, folder, CATEGORIES)
        _, by_class = stat.pq_average(CATEGORIES, isthing=True)
    figures = {}
    for thing in THINGS:
        counts = stat[thing]
        n_true, shares = counts.tp + counts.fn, by_class[thing]
        of_true = lambda n: n / n_true if n_true else np.nan
        percents = of_true(counts.tp), shares["pq"], shares["sq"] if counts.tp else np.nan, shares["rq"], of_true(counts.iou)
        figures[thing] = [n_true, counts.tp + counts.fp, *(100 * share for share in percents)]
    return figures


def labels(random, n):
    """Runs of points with one label, and the same with some of them changed."""
    lengths = random.integers(1, 60, n)
    classes = random.choice([VOID, PEDESTRIAN, ROAD, VEHICLES], n, p=[0.1, 0.2, 0.2, 0.5])
    ids = np.where(np.isin(classes, THINGS), random.integers(0, 30, n), 0)
    truth = np.stack([np.repeat(classes, lengths), np.repeat(ids, lengths)])
    found = truth.copy()
    # Renumbered, and stretches given to another label.
    found[1] = np.where(found[1] > 0, random.permutation(30)[found[1]] + 1, 0)
    for begin in random.integers(0, found.shape[1], n // 2):
        end = begin + random.integers(1, random.choice([20, 60]))
        found[:, begin:end] = found[:, [random.integers(found.shape[1])]]
    return truth, found


def main():
    random = np.random.default_rng(3)
    worst, n_matches = 0.0, 0
    for _ in range(20):
        truth, found = labels(random, 300)
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            paths = [folder / name for name in ("truth.ply", "found.ply")]
            write(paths[0], *truth)
            write(paths[1], *found)
            command = [ROOT / "target/release/replica-lab", "evaluate", "instances", *paths, "--min-points", "1"]
            lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[2:]
            theirs = panoptic(folder, truth, found)
        for line, thing in zip(lines, THINGS, strict=True):
            cells = [cell.strip() for cell in line.strip("| ").split("|")[1:]]
            ours = np.array([float(cell) if cell != "-" else np.nan for cell in cells])
            if not np.array_equal(np.isnan(ours), np.isnan(theirs[thing])):
                sys.exit(f"ours {ours}, theirs {theirs[thing]}")
            worst = max(worst, np.nanmax(np.abs(ours - theirs[thing])))
            n_matches += round(ours[0] * ours[2] / 100)
    print(f"20 clouds, two classes, {n_matches} matches: largest difference {worst:.4f}")
    sys.exit(int(worst >= 0.01))


if __name__ == "__main__":
    main()
