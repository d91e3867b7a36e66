#!/usr/bin/env python3
"""Cost of a stage in Python beside the same stage in Rust: CPU time for each submap of a recording, reading it included.

  cargo build --release && pip install ./tools/python
  python3 benches/peers/python_stage.py SUBMAPS.mcap

The third row, a step that does nothing, has what Python, numpy and the reading of the recording cost by themselves.
"""
import json
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
STAGES = {
    "height_segmenter in Rust": [ROOT / "target/release/height-segmenter"],
    "height_segmenter in Python": [sys.executable, ROOT / "examples/python/height_segmenter.py"],
    "a step in Python that does nothing": [sys.executable, ROOT / "tools/python/tests/stages/misbehaving.py"],
}

print("| stage | CPU ms per submap | million points per submap | MiB |\n|---|---|---|---|")
for name, command in STAGES.items():
    runs = []
    for _ in range(5):
        ended = subprocess.run([*command, "run", "--recording", sys.argv[1], "--json"], capture_output=True, check=True)
        runs.append(json.loads(ended.stdout))
    report = min(runs, key=lambda run: run["cpu_s"])
    n = report["inputs"]["submap"]["messages"]
    print(f"| {name} | {1e3 * report['cpu_s'] / n:.0f} | {report['points'] / n * 1e-6:.2f} | {report['peak_rss_bytes'] >> 20} |")
    step_ms = min(run["step"]["p50_ms"] for run in runs)
print(f"\nA step that does nothing: {step_ms:.2f} ms")
