#!/usr/bin/env python3
"""Graph-based Color Lines compared with scikit-learn, and their scores with scikit-image, SciPy and NumPy.

  pip install numpy scipy scikit-learn scikit-image
  cargo build --release -p studies --example bench_color_lines
  lab/peers/color_lines.py IMAGE|CUBE.hdr|CUBE.tif [...] [--spatial-weight S] [--gaussians N] [--runs R]
  lab/peers/color_lines.py freeze > shared/color_lines/tests/suite/scikit_learn.json

Each fit of a hemisphere starts on both sides from the same weights, means and covariances. Compared: fitted Gaussians, iterations, SLIC
labels, scores of regions. scikit-image has no boundary or overlap scores; those are written here from their definitions. Exit code 1: a
Gaussian differs by more than 1e-6, a score by more than 1e-9, or a SLIC label.
"""
import argparse
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import warnings

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", RAYON_NUM_THREADS="1")

import numpy as np
from scipy import ndimage
from sklearn.exceptions import ConvergenceWarning
from sklearn.metrics.cluster import contingency_matrix
from sklearn.mixture import GaussianMixture

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target/release/examples/bench_color_lines"
UPPER = np.triu_indices(3)


def matrices(gaussians):
    full = np.zeros((len(gaussians), 3, 3))
    for matrix, gaussian in zip(full, gaussians):
        matrix[UPPER] = gaussian["covariance"]
        matrix.T[UPPER] = gaussian["covariance"]
    return full


class Prepared(GaussianMixture):
    """scikit-learn from given parameters. Its own initialization runs k-means first, even if all parameters are given."""

    def _initialize_parameters(self, X, random_state, xp=None):
        self.weights_, self.means_ = self.weights_init, self.means_init
        self.precisions_cholesky_ = np.linalg.cholesky(self.precisions_init)


def fit(points, start):
    weights = np.array([gaussian["weight"] for gaussian in start])
    # scikit-learn checks that the weights sum to 1 in double precision.
    model = Prepared(len(start), weights_init=weights / weights.sum(), means_init=np.array([g["mean"] for g in start]),
                     precisions_init=np.linalg.inv(matrices(start)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        begin = time.process_time()
        model.fit(points)
        return model, time.process_time() - begin


def difference(model, gaussians):
    ours = (np.array([g["weight"] for g in gaussians]), np.array([g["mean"] for g in gaussians]), matrices(gaussians))
    return max(abs(a - b).max() for a, b in zip(ours, (model.weights_, model.means_, model.covariances_)))


def image_scores(labels, values):
    from skimage.measure import regionprops
    regions = regionprops(labels)
    padded = np.pad(labels, 1, constant_values=-1)
    sides = sum((np.roll(padded, shift, axis)[1:-1, 1:-1] != labels).astype(float) for axis in (0, 1) for shift in (1, -1))
    perimeters, areas = np.bincount(labels.ravel(), sides.ravel()), np.bincount(labels.ravel())
    seen = areas > 0
    compactness = (areas[seen] * 4 * np.pi * areas[seen] / perimeters[seen] ** 2).sum() / labels.size
    one = np.zeros(labels.shape, bool)
    one[:, :-1] |= labels[:, 1:] != labels[:, :-1]
    one[:-1] |= labels[1:] != labels[:-1]
    between = total = 0
    for band in values:
        means = np.bincount(labels.ravel(), band.ravel()) / np.maximum(areas, 1)
        between += ((means[labels] - band.mean()) ** 2).sum()
        total += ((band - band.mean()) ** 2).sum()
    return [np.mean([r.extent for r in regions]), np.mean([r.solidity for r in regions]), compactness, boundary(labels).mean(), one.mean(),
            between / total]


def boundary(labels):
    from skimage.segmentation import find_boundaries
    return find_boundaries(labels, connectivity=1, mode="thick")


def boundary_scores(superpixels, segmentation, distance):
    found, truth = boundary(superpixels), boundary(segmentation)
    near = lambda marks: ndimage.maximum_filter(marks, 2 * distance + 1)
    recalled, false = (truth & near(found)).sum(), (found & ~near(truth)).sum()
    return [recalled / truth.sum(), 1 - false / found.sum(), recalled / (recalled + (found & ~truth & ~near(truth)).sum())]


def overlap(superpixels, segmentation):
    counts = contingency_matrix(segmentation.ravel(), superpixels.ravel())
    sizes = counts.sum(0)
    bergh = (sizes - counts.max(0)).sum() / superpixels.size
    return [bergh, np.minimum(counts, sizes - counts).sum() / superpixels.size, 1 - bergh]


def compare(path, arguments):
    """Whether everything is equal."""
    with tempfile.TemporaryDirectory() as folder:
        command = [PROGRAM, path, str(arguments.spatial_weight), str(arguments.gaussians), str(arguments.runs), folder]
        printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        ours_ms = float(re.search(r"fits ([0-9.]+) ms", printed)[1])
        theirs_s, worst, same_iterations = 0, 0, True
        for file in sorted(pathlib.Path(folder).glob("*.points")):
            start, fitted, iterations = json.loads(file.with_suffix(".json").read_text())
            points = np.ascontiguousarray(np.fromfile(file).reshape(3, -1).T)
            model, seconds = min((fit(points, start) for _ in range(min(arguments.runs, 3))), key=lambda found: found[1])
            theirs_s += seconds
            worst = max(worst, difference(model, fitted))
            same_iterations &= model.n_iter_ == iterations
        print(f"{pathlib.Path(path).name}: {printed.strip()}")
        print(f"  scikit-learn {theirs_s * 1e3:.0f} ms, {theirs_s * 1e3 / ours_ms:.1f} times; largest difference {worst:.1e}, "
              f"iterations {'equal' if same_iterations else 'differ'}")
        good = worst < 1e-6
        if not (pathlib.Path(folder) / "scores.json").exists():
            return good
        import skimage.io
        from skimage.segmentation import slic
        # Only the size: decoders of JPEG differ by a level here and there.
        shape = skimage.io.imread(path).shape[:2]
        image = np.fromfile(f"{folder}/rgb", "u1").reshape(*shape, 3)
        labels, superpixels = (np.fromfile(f"{folder}/{name}", "<u4").reshape(shape).astype(int) for name in ("labels", "slic"))
        values = np.moveaxis(image.astype(float), 2, 0)
        expected = [image_scores(superpixels, values), image_scores(labels, values), boundary_scores(superpixels, labels, 1),
                    boundary_scores(superpixels, labels, 2), overlap(superpixels, labels)]
        found = json.loads(pathlib.Path(folder, "scores.json").read_text())
        scores = max(abs(a - b) for mine, theirs in zip(found, expected) for a, b in zip(mine, theirs))
        begin = time.process_time()
        theirs = slic(image, n_segments=200, compactness=10)
        other = (theirs != superpixels).mean()
        print(f"  scores: largest difference {scores:.1e}; SLIC: {other:.2%} of the labels differ from scikit-image "
              f"({(time.process_time() - begin) * 1e3:.0f} ms)")
        return good and scores < 1e-9 and other == 0


def freeze():
    """Points of a formula, and what scikit-learn fits to them."""
    index = np.arange(600)
    # The same in Rust: three groups of points by fractional parts.
    points = np.stack([np.modf(index * factor)[0] * 0.2 + 0.3 * (index % 3 == k) for k, factor in enumerate((0.754877, 0.569840, 0.330598))], 1)
    start = [{"weight": 1 / 3, "mean": mean, "covariance": [0.01, 0, 0, 0.01, 0, 0.01]}
             for mean in ([0.3, 0.1, 0.1], [0.1, 0.3, 0.1], [0.2, 0.2, 0.3])]
    model, _ = fit(points, start)
    fitted = [{"weight": weight, "mean": list(mean), "covariance": list(covariance[UPPER])}
              for weight, mean, covariance in zip(model.weights_, model.means_, model.covariances_)]
    print(json.dumps({"start": start, "fitted": fitted, "iterations": int(model.n_iter_)}))


def main():
    if sys.argv[1:] == ["freeze"]:
        return freeze()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("inputs", nargs="+")
    parser.add_argument("--spatial-weight", type=float, default=0)
    parser.add_argument("--gaussians", type=int, default=150)
    parser.add_argument("--runs", type=int, default=5)
    arguments = parser.parse_args()
    print(f"{time.strftime('%Y-%m-%d')}, one thread, load {os.getloadavg()[0]:.1f}, fastest of {arguments.runs} runs")
    results = [compare(path, arguments) for path in arguments.inputs]
    sys.exit(0 if all(results) else 1)


if __name__ == "__main__":
    main()
