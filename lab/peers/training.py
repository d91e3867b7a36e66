"""Training steps per second of the shipped network, PyTorch on the CPU compared with REPLICA:
`python lab/peers/training.py`, with PyTorch (Debian: python3-torch). `THREADS` sets the threads of both, 1 by default."""

import os
import subprocess
import time
from pathlib import Path

import torch
from torch import nn

THREADS = int(os.environ.get("THREADS", "1"))
WIDTHS, HEAD, INPUTS, CLASSES, FOLD = [32, 48, 64, 96], 64, 40, 19, 4
BATCH, HEIGHT, WIDTH, RUNS = 4, 32, 512, 12


class Block(nn.Module):
    """A 3 x 3 convolution, circular along the columns, and a rectifier."""

    def __init__(self, n_in, n_out):
        super().__init__()
        self.convolution = nn.Conv2d(n_in, n_out, 3)

    def forward(self, x):
        x = nn.functional.pad(x, (1, 1, 0, 0), mode="circular")
        return torch.relu(self.convolution(nn.functional.pad(x, (0, 0, 1, 1))))


class UNet(nn.Module):
    def __init__(self):
        super().__init__()
        channels = [INPUTS, *WIDTHS]
        self.down = nn.ModuleList(
            nn.Sequential(Block(n_in, n_out), Block(n_out, n_out)) for n_in, n_out in zip(channels, WIDTHS)
        )
        self.narrow, self.up = nn.ModuleList(), nn.ModuleList()
        n = WIDTHS[-1]
        for level in reversed(range(len(WIDTHS) - 1)):
            self.narrow.append(nn.Conv2d(n, WIDTHS[level], 1))
            n = HEAD if level == 0 else WIDTHS[level]
            self.up.append(Block(2 * WIDTHS[level], n))
        self.classes = nn.Conv2d(n, CLASSES * FOLD, 1)

    def forward(self, x):
        finer = []
        for level, down in enumerate(self.down):
            if level > 0:
                finer.append(x)
                x = nn.functional.max_pool2d(x, 2)
            x = down(x)
        for narrow, up in zip(self.narrow, self.up):
            x = nn.functional.interpolate(torch.relu(narrow(x)), scale_factor=2)
            x = up(torch.cat([finer.pop(), x], 1))
        return self.classes(x)


def main():
    torch.set_num_threads(THREADS)
    torch.manual_seed(1)
    network = UNet()
    optimizer = torch.optim.Adam(network.parameters(), 1e-3)
    x = torch.randn(BATCH, INPUTS, HEIGHT, WIDTH)
    truth = torch.randint(CLASSES, (BATCH, FOLD, HEIGHT, WIDTH))
    fastest = float("inf")
    for _ in range(RUNS):
        begin = time.perf_counter()
        optimizer.zero_grad()
        logits = network(x).reshape(BATCH, FOLD, CLASSES, HEIGHT, WIDTH).transpose(1, 2)
        nn.functional.cross_entropy(logits, truth).backward()
        optimizer.step()
        fastest = min(fastest, time.perf_counter() - begin)
    print(f"{THREADS} threads, {sum(p.numel() for p in network.parameters())} parameters")
    print(f"PyTorch {torch.__version__}, cross-entropy of all pixels: {fastest:.3f} s/step, {1 / fastest:.2f} steps/s")
    root = Path(__file__).resolve().parents[2]
    command = ["cargo", "run", "--quiet", "--release", "--locked", "-p", "training", "--example", "bench_training"]
    subprocess.run(command, cwd=root, env=os.environ | {"RAYON_NUM_THREADS": str(THREADS)}, check=True)


main()
