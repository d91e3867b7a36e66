"""Raw mosaic to corrected cube with NumPy and with ours on one thread (processor time), in the same run.

Same frames, same steps: reflectance per pixel, masks, binning, correction.
usage: cargo build --release -p studies --example cube_bench
       OMP_NUM_THREADS=1 python3 cube_numpy.py target/release/examples/cube_bench
"""

import subprocess
import sys
import time

import numpy as np

N_FRAMES = 20


def bench(name, pattern, area, n_virtual):
    x, y, width, height = area
    cols, rows = width // pattern, height // pattern
    ramp = (np.arange(2048 * 1088) * 7 % 61).reshape(1088, 2048)
    window = np.s_[y : y + rows * pattern, x : x + cols * pattern]
    dark = (20 + ramp).astype(np.float32)[window]
    white = (700 + ramp).astype(np.float32)[window]
    gain = np.float32(0.98) / (white - dark)
    raw = (360 + ramp).astype(np.uint16)
    n = pattern * pattern
    weight = np.array([[((j * 7 + k * 3) % 11) / 5 - 1 for k in range(n)] for j in range(n_virtual)])
    matrix = (weight + (1 - weight.sum(1, keepdims=True)) / n).astype(np.float32)

    def frame():
        samples = raw[window]
        valid = (samples < 1023) & ~((samples == 0) & (dark > 0)) & (gain != 0)
        values = np.where(valid, (samples - dark) * gain, np.float32(0))
        split = lambda image: image.reshape(rows, pattern, cols, pattern).transpose(1, 3, 0, 2).reshape(n, -1)
        cube, mask = split(values), split(valid)
        return np.where(mask.all(0), matrix @ cube, np.float32(0))

    corrected = frame()
    assert abs(corrected - 0.49).max() < 1e-3
    start = time.thread_time()
    for _ in range(N_FRAMES):
        frame()
    seconds = (time.thread_time() - start) / N_FRAMES
    print(f"{name} to corrected cube, NumPy {np.__version__}: {1 / seconds:.0f} frames/s, {seconds * 1e3:.2f} ms each")


bench("HS02 5x5", 5, [0, 3, 2045, 1085], 25)
bench("HS03 4x4", 4, [0, 32, 2048, 1024], 15)
for ours in sys.argv[1:]:
    subprocess.run([ours], check=True)
