#!/usr/bin/env python3
"""Cost of stages in Python compared with the same stages in Rust: CPU time for each submap of a recording, reading it included, on one thread
(THREADS sets others). Without PyTorch, its row is missing.

  cargo build --release -p height_segmenter && pip install ./tools/python onnx onnxruntime safetensors torch
  python3 lab/peers/python_stage.py SUBMAPS.mcap

The step that does nothing shows the cost of Python, numpy and reading the recording.
"""
import importlib.util
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import replica

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAMS, EXAMPLES, MODEL = ROOT / "target/release", ROOT / "examples/python", ROOT / "models/street.safetensors"
THREADS = os.environ.get("THREADS", "1")
STREET = ["--set", f"infer.model={MODEL}"]
n_sweeps = sum(int(submap.header["n_sweeps"]) for submap in replica.open_recording(sys.argv[1]).messages("submap"))


def stages(onnx):
    yield "height_segmenter in Rust", [PROGRAMS / "height-segmenter"], []
    yield "height_segmenter in Python", [sys.executable, EXAMPLES / "height_segmenter.py"], []
    yield "a step in Python that does nothing", [sys.executable, ROOT / "tools/python/tests/stages/misbehaving.py"], []
    yield "`infer` in Rust", [PROGRAMS / "replica-infer"], STREET
    network = [*STREET, "--set", f"infer.network={onnx}"]
    yield "its U-Net in ONNX Runtime", [sys.executable, EXAMPLES / "unet_onnx.py"], network
    if importlib.util.find_spec("torch"):
        yield "its U-Net in PyTorch", [sys.executable, EXAMPLES / "unet_torch.py"], STREET


def cheapest(program, settings):
    """The report of the run with the least CPU time of some."""
    command = [*program, "run", "--recording", sys.argv[1], "--json", *settings]
    threads = {"RAYON_NUM_THREADS": THREADS, "OMP_NUM_THREADS": THREADS}
    runs = [subprocess.run(command, capture_output=True, check=True, env={**os.environ, **threads}) for _ in range(5)]
    return min((json.loads(run.stdout) for run in runs), key=lambda report: report["cpu_s"])


print(f"threads: {THREADS}, load before: {os.getloadavg()[0]:.1f}\n")
print("| stage | CPU ms per submap | per sweep | million points per submap | MiB |\n|---|---|---|---|---|")
with tempfile.TemporaryDirectory() as folder:
    onnx = pathlib.Path(folder) / "street.onnx"
    subprocess.run([sys.executable, EXAMPLES / "unet_to_onnx.py", MODEL, onnx], check=True)
    for name, program, settings in stages(onnx):
        report = cheapest(program, settings)
        n, cpu_ms = report["inputs"]["submap"]["messages"], 1e3 * report["cpu_s"]
        points, mib = report["points"] / n * 1e-6, report["peak_rss_bytes"] >> 20
        print(f"| {name} | {cpu_ms / n:.0f} | {cpu_ms / n_sweeps:.1f} | {points:.2f} | {mib} |", flush=True)
        if "nothing" in name:
            step_ms = report["step"]["p50_ms"]
print(f"\nA step that does nothing: {step_ms:.2f} ms")
