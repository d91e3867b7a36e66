#!/usr/bin/env python3
"""Scores of `replica-lab evaluate classes` compared with scikit-learn, on random labels.

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install numpy scikit-learn
    cargo build --release -p replica_lab
    /tmp/venv/bin/python lab/peers/scores.py

`scores.py frozen` needs no build and writes the figures of the unit test `scores_match_scikit_learn` in shared/scores.
Exit code 1: a figure differs by 1e-12 or more.
"""
import json, os, subprocess, sys, tempfile
import numpy as np
from sklearn.metrics import accuracy_score, confusion_matrix, jaccard_score, precision_score, recall_score

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
RELEASE = os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target")), "release")


def peer(truth, predicted, n_classes):
    """Precision, recall and IoU by class, NaN for 0 / 0; mean IoU of the classes of truth; accuracy; confusion."""
    labels = list(range(n_classes))
    args = dict(labels=labels, average=None)
    iou = jaccard_score(truth, predicted, zero_division=0, **args)
    iou[~np.isin(labels, np.union1d(truth, predicted))] = np.nan
    return {
        "precision": precision_score(truth, predicted, zero_division=np.nan, **args),
        "recall": recall_score(truth, predicted, zero_division=np.nan, **args),
        "iou": iou,
        "mean_iou": iou[np.unique(truth)].mean(),
        "overall_accuracy": accuracy_score(truth, predicted),
        "confusion": confusion_matrix(truth, predicted, labels=labels),
    }


def compare():
    random = np.random.default_rng(5)
    truth = random.integers(1, 23, 200_000).astype(np.uint32)
    predicted = np.where(random.random(truth.size) < 0.6, truth, random.integers(0, 23, truth.size)).astype(np.uint32)
    with tempfile.TemporaryDirectory() as folder:
        files = [os.path.join(folder, name) for name in ["truth.label", "predicted.label"]]
        truth.tofile(files[0])
        (predicted | np.uint32(7 << 16)).tofile(files[1])
        command = [f"{RELEASE}/replica-lab", "evaluate", "classes", *files, "--format", "json"]
        ours = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)[0]
    theirs = peer(truth, predicted, 23)
    same = lambda a, b: (a is None and np.isnan(b)) or (a is not None and abs(a - b) < 1e-12)
    for i, scores in enumerate(ours["classes"]):
        for name in ["precision", "recall", "iou"]:
            assert same(scores[name], theirs[name][i]), (i, name, scores[name], theirs[name][i])
    for name in ["mean_iou", "overall_accuracy"]:
        assert same(ours[name], theirs[name]), (name, ours[name], theirs[name])
    assert (np.array(ours["confusion"]) == theirs["confusion"]).all()
    print(f"scores equal scikit-learn on {truth.size} random labels of 23 classes: mIoU {ours['mean_iou']:.6f}")


def frozen():
    """The labels of the unit test: SplitMix64 as `random::Random::for_stream(5, 0)` has it."""
    mask = (1 << 64) - 1
    state = 5

    def bits():
        nonlocal state
        state = (state + 0x9E3779B97F4A7C15) & mask
        z = state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        return z ^ (z >> 31)

    state = bits()
    labels = [(t, t if bits() % 3 else bits() % 7) for t in (bits() % 6 for _ in range(2000))]
    theirs = peer(*np.array(labels).T, 8)
    for name in ["precision", "recall", "iou"]:
        print(name, [None if np.isnan(v) else float(v) for v in theirs[name]])
    print(float(theirs["mean_iou"]), float(theirs["overall_accuracy"]))


if __name__ == "__main__":
    frozen() if sys.argv[1:] == ["frozen"] else compare()
