"""Sweeps as images for networks in Python, and the classes of the stage `infer` from their scores."""

from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, call

import replica

STREET = ROOT / "models/street.safetensors"
KEYS = ["--set", f"infer.model={STREET}"]
EXAMPLES = ROOT / "examples/python"


@pytest.fixture(scope="module")
def rust_classes(folder, submaps) -> list[replica.Message]:
    """The scores and classes of the stage `infer`."""
    call("replica-infer", "run", "--recording", submaps, "--record", folder / "rust_unet.mcap", *KEYS)
    return list(replica.open_recording(folder / "rust_unet.mcap").messages("class"))


def assert_equal_but_for_ties(expected: list[replica.Message], recording: Path):
    """Sums of float32 in another order move a few probabilities of pixels, which are multiples of 1/255, by one step. That moves
    the scores of their cells by at most one step, and changes the class of a cell only if two classes have as good as equal votes.
    Found with PyTorch and with ONNX Runtime: 2e-5 of the scores, and none of 3 million classes. A cell may have 100 points, and
    other processors other kernels.
    """
    found = list(replica.open_recording(recording).messages("class"))
    n_points = n_scores = n_classes = 0
    for rust, python in zip(expected, found, strict=True):
        by = np.abs(rust["score"].astype(int) - python["score"])
        assert by.max() <= 1
        n_points, n_scores = n_points + len(rust), n_scores + (by > 0).sum()
        n_classes += (rust["class_id"] != python["class_id"]).sum()
    assert n_points > 2_000_000
    assert n_scores <= 2e-4 * n_points, f"{n_scores} of {n_points} points have another score"
    assert n_classes <= 1e-4 * n_points, f"{n_classes} of {n_points} points have another class"


def test_unet_in_onnx_runtime_gives_the_classes_of_infer_but_for_ties(folder, submaps, rust_classes):
    for module in ("onnx", "onnxruntime", "safetensors"):
        pytest.importorskip(module)
    call(EXAMPLES / "unet_to_onnx.py", STREET, folder / "street.onnx")
    keys = [*KEYS, "--set", f"infer.network={folder / 'street.onnx'}"]
    for name in ("onnx", "onnx_again"):
        call(EXAMPLES / "unet_onnx.py", "run", "--recording", submaps, "--record", folder / f"{name}.mcap", *keys)
    assert_equal_but_for_ties(rust_classes, folder / "onnx.mcap")
    assert "0 differ" in call("replica", "compare", folder / "onnx.mcap", folder / "onnx_again.mcap")


def test_unet_in_pytorch_gives_the_classes_of_infer_but_for_ties(folder, submaps, rust_classes):
    for module in ("torch", "safetensors"):
        pytest.importorskip(module)
    for name in ("torch", "torch_again"):
        call(EXAMPLES / "unet_torch.py", "run", "--recording", submaps, "--record", folder / f"{name}.mcap", *KEYS)
    assert_equal_but_for_ties(rust_classes, folder / "torch.mcap")
    assert "0 differ" in call("replica", "compare", folder / "torch.mcap", folder / "torch_again.mcap")


def test_images_have_the_layout_of_the_network_in_batches_of_any_size(submaps):
    images = replica.SweepImages(STREET)
    fold, n_features = images.settings["fold"], 10
    submap = next(replica.open_recording(submaps).messages("submap"))
    sweeps = images.project(submap)
    single, batches = list(sweeps.images()), list(sweeps.images(batch=3))
    assert len(single) == len(sweeps) == submap.header["n_sweeps"] and len(batches) == -(-len(sweeps) // 3)
    every = np.concatenate(batches)
    assert np.array_equal(every, np.concatenate(single))
    assert every.shape[1:] == (fold * n_features, 32, images.settings["columns"] // fold) and every.dtype == np.float32
    # Feature 0 is 1 where the range image has a point; without one, all features are 0.
    features = every.reshape(len(every), fold, n_features, *every.shape[2:])
    is_shown = features[:, :, 0] == 1.0
    assert 0.3 < is_shown.mean() < 1.0
    assert not features.transpose(0, 1, 3, 4, 2)[~is_shown].any()


def test_scores_and_models_that_do_not_fit_are_refused(submaps):
    with pytest.raises(ValueError, match="unknown architecture `points`"):
        replica.SweepImages(ROOT / "models/points.safetensors")
    with pytest.raises(ValueError, match="must be one of auto, normalized, raw, off"):
        replica.SweepImages(STREET, intensity="bright")
    sweeps = replica.SweepImages(STREET).project(next(replica.open_recording(submaps).messages("submap")))
    with pytest.raises(ValueError, match=r"scores of sweep 0 of \d+: shape \(32, 512, 76\), expected \(76, 32, 512\)"):
        sweeps.classes([np.zeros((1, 32, 512, 76), "f4")])
    with pytest.raises(ValueError, match=r"scores of 1 sweeps; the submap has \d+"):
        sweeps.classes([np.zeros((1, 76, 32, 512), "f4")])
