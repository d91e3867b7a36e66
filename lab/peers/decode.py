#!/usr/bin/env python3
"""Decoding of Velodyne captures, side by side with velodyne-decoder on one core: points, and million points per CPU second
from file to sweeps, best of seven.

  pip install velodyne-decoder && cargo build --release -p studies --example decode_bench
  taskset -c 0 lab/peers/decode.py CAPTURE.pcap HDL32E|VLP16|HDL64E
"""
import pathlib
import subprocess
import sys
import time

import velodyne_decoder


def peer(capture: str, model: str) -> tuple[int, float]:
    config = velodyne_decoder.Config(model=getattr(velodyne_decoder.Model, model))
    best, n_points = float("inf"), 0
    for _ in range(7):
        begun = time.process_time()
        n_points = sum(len(points) for _, points in velodyne_decoder.read_pcap(capture, config))
        best = min(best, time.process_time() - begun)
    return n_points, n_points / best * 1e-6


def main() -> None:
    capture, model = sys.argv[1:]
    n_points, rate = peer(capture, model)
    print(f"velodyne-decoder file to scans: {n_points} points, {rate:.1f} million points/s", flush=True)
    root = pathlib.Path(__file__).resolve().parents[2]
    subprocess.run([root / "target/release/examples/decode_bench", capture], check=True)


if __name__ == "__main__":
    main()
