#!/usr/bin/env python3
"""Kernels compared with other libraries: one table, made in one run.

  python3 -m venv venv && venv/bin/pip install numpy kiss-icp==1.3.0 small_gicp==1.0.1 genz-icp==0.3.2 velodyne-decoder \
      opencv-python-headless scikit-image onnx onnxruntime plyfile open3d
  cargo build --release -p studies --examples
  venv/bin/python lab/peers/all.py [--runs 7] [--only morphology ...]

All on one core and one thread. Ours and theirs run in turn, so that other load on the machine affects both alike. Each cell is
the median of CPU times, with the smallest and the largest behind it; ratio is the other's median by ours. A package that is not
installed leaves its rows out, with a line on how to install it. Captures are in $REPLICA_DATA (../shared/data).
LAS and LAZ are not written by REPLICA, so there is no row for them.
"""
import argparse
import contextlib
import importlib
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
from statistics import median

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "target/release/examples"
DATA = pathlib.Path(os.environ.get("REPLICA_DATA", ROOT / "../shared/data"))
PACKAGES = {"cv2": "opencv-python-headless", "skimage": "scikit-image", "velodyne_decoder": "velodyne-decoder",
            "kiss_icp": "kiss-icp==1.3.0", "genz_icp": "genz-icp==0.3.2", "small_gicp": "small_gicp==1.0.1"}
# Runs below this are preceded by one that is not counted, s.
SHORT_S = 0.1
LINE = "{:<36}{:<28}{:>24}  {:<17}{:>26}{:>7}  {}"


class Skipped(Exception):
    """Rows that cannot be made, and why."""


def needs(module):
    try:
        return importlib.import_module(module)
    except ImportError:
        raise Skipped(f"pip install {PACKAGES.get(module, module)}") from None


def in_turn(sides, runs):
    """Seconds of each run by name. The first run of each side fetches memory and is not counted."""
    last = {name: run() for name, run in sides.items()}
    found = {name: [] for name in sides}
    for _ in range(runs):
        for name, run in sides.items():
            # Libraries in this process share an image in the cache; ours has its own, which they evict.
            if last[name] < SHORT_S:
                run()
            last[name] = run()
            found[name].append(last[name])
    return found


def timed(compute):
    """A function of a library in this process, as CPU seconds of one call."""
    def run():
        begun = time.process_time()
        result = compute()
        spent = time.process_time() - begun
        del result
        return spent
    return run


def cell(seconds):
    low, high = min(seconds), max(seconds)
    return f"{median(seconds) * 1e3:.2f} ({low * 1e3:.2f}-{high * 1e3:.2f})"


def rows(kernel, what, found):
    """Prints a row for each library."""
    ours = found.pop("ours")
    for peer, theirs in found.items():
        ratio = median(theirs) / median(ours)
        # If the ranges overlap, neither is ahead.
        is_clear = max(ours) < min(theirs) or max(theirs) < min(ours)
        ahead = "even" if not is_clear else "REPLICA" if ratio > 1 else peer
        print(LINE.format(kernel, what, cell(ours), peer, cell(theirs), f"{ratio:.2f}", ahead), flush=True)


@contextlib.contextmanager
def served(*command):
    """An example that prints the CPU ns of a run for each line `run`."""
    environment = dict(os.environ, RAYON_NUM_THREADS="1")
    with subprocess.Popen([str(part) for part in command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment) as process:
        def run():
            print("run", file=process.stdin, flush=True)
            return int(process.stdout.readline() or sys.exit(f"{command[0]} failed")) * 1e-9
        yield run
        process.stdin.close()


def odometry(runs):
    """CPU a sweep. Each run is the whole drive, so there are fewer."""
    import odometry_drives
    names = {"kiss": "KISS-ICP", "genz": "GenZ-ICP", "vgicp": "small_gicp"}
    for module in ("kiss_icp", "genz_icp", "small_gicp"):
        needs(module)
    folder = odometry_drives.prepared("urban_nuscenes_841_3s")
    ours = f"ours={EXAMPLES}/odometry {{scans}} {{out}}"
    found = {name: [] for name in ["ours", *names.values()]}
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, ROOT / "lab/peers/odometry.py", folder, "--out", out, "--max-range", "100", "--sg-voxel", "0.5",
                   "--sg-k", "20", "--methods", ",".join(f"{name}-1" for name in names), "--external-cmd", ours]
        for _ in range(min(runs, 3)):
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            for row in json.loads(pathlib.Path(out, "summary.json").read_text()):
                method = row["method"].removesuffix("-1")
                found[names.get(method, method)].append(row["cpu_ms"] * 1e-3)
    rows("odometry, a sweep", "HDL-32E, 3 s of a town", found)


def decoding(runs):
    """File to sweeps, a million points. A run is the best of several passes on both sides."""
    needs("velodyne_decoder")
    import decode
    for capture, model in [("hdl32e_outdoor.pcap", "HDL32E"), ("vlp16_moving_car.pcap", "VLP16")]:
        path = DATA / "velodyne" / capture
        if not path.exists():
            raise Skipped(f"{path} is absent")

        def ours():
            text = subprocess.run([EXAMPLES / "decode_bench", path], check=True, capture_output=True, text=True).stdout
            return 1 / float(re.search(r"file to sweeps: .* ([0-9.]+) million", text)[1])
        found = in_turn({"ours": ours, "velodyne-decoder": lambda: 1 / decode.peer(str(path), model)[1]}, runs)
        rows("decoding, a million points", capture, found)


def morphology_rows(runs, only, kernel):
    for module in ("cv2", "skimage"):
        needs(module)
    import morphology
    with tempfile.TemporaryDirectory() as folder:
        ours = morphology.Ours(folder)
        for operator, images, argument, connectivity, output in morphology.cases(4096, only):
            peers = {name: morphology.Peer(run).time for name, run in morphology.peers_of(operator, images, argument, connectivity).items()}
            ours.start(operator, *images, argument=argument, connectivity=connectivity)
            found = in_turn({"ours": ours.time, **peers}, runs)
            ours.result(output or images[0].dtype, images[0].shape)
            rows(kernel(operator), f"{images[0].dtype} {argument}" if argument != "-" else f"{connectivity} neighbors", found)


def morphology_operators(runs):
    morphology_rows(runs, ["dilate", "erode", "opening", "closing"], lambda operator: f"{operator} 4096x4096")


def components(runs):
    morphology_rows(runs, ["components"], lambda _: "components 4096x4096")


def network(runs):
    """A run is a mean over 50 passes."""
    for module in ("onnx", "onnxruntime"):
        needs(module)
    import segmentation
    path = str(ROOT / "models/street.safetensors")
    theirs = segmentation.network_session(path)
    ours = lambda: float(re.search(r"network ([0-9.]+) ms", segmentation.our_network(path))[1]) * 1e-3
    found = in_turn({"ours": ours, "ONNX Runtime": lambda: segmentation.mean_processor_ms(theirs) * 1e-3}, runs)
    rows("network, a sweep", "street.safetensors", found)


def ply(runs):
    """Writing from columns without waiting for the disk: the files are in memory."""
    np = needs("numpy")
    n = 1_000_000
    random = np.random.default_rng(1)
    points = np.zeros(n, [("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "u1")])
    for name in "xyz":
        points[name] = random.uniform(-50, 50, n)
    points["intensity"] = random.integers(0, 256, n)
    with tempfile.TemporaryDirectory(dir="/dev/shm") as folder:
        points.tofile(f"{folder}/points.raw")
        positions = np.stack([points[name] for name in "xyz"], axis=1)
        intensities = points["intensity"].copy()

        def packed():
            packed = np.empty(n, points.dtype)
            for column, name in enumerate("xyz"):
                packed[name] = positions[:, column]
            packed["intensity"] = intensities
            return packed
        peers = {}
        try:
            plyfile = needs("plyfile")
            peers["plyfile"] = timed(lambda: plyfile.PlyData([plyfile.PlyElement.describe(packed(), "vertex")], byte_order="<").write(f"{folder}/plyfile.ply"))
        except Skipped as reason:
            print(f"ply, plyfile: left out: {reason}")
        try:
            o3d = needs("open3d")
            cloud = o3d.t.geometry.PointCloud(o3d.core.Tensor(positions))
            cloud.point["intensity"] = o3d.core.Tensor(intensities[:, None])
            peers["Open3D"] = timed(lambda: o3d.t.io.write_point_cloud(f"{folder}/open3d.ply", cloud) or sys.exit("Open3D does not write"))
        except Skipped as reason:
            print(f"ply, Open3D: left out: {reason}")
        with served(EXAMPLES / "ply_bench", f"{folder}/points.raw", f"{folder}/ours.ply") as ours:
            found = in_turn({"ours": ours, **peers}, runs)
        ends = {name: pathlib.Path(folder, file).read_bytes()[-points.nbytes:] for name, file in
                [("ours", "ours.ply"), ("plyfile", "plyfile.ply")] if pathlib.Path(folder, file).exists()}
        if any(end != points.tobytes() for end in ends.values()):
            sys.exit("ply: the files differ")
        rows("PLY writing, a million points", "x y z f32, intensity u8", found)


PARTS = {"odometry": odometry, "decoding": decoding, "morphology": morphology_operators, "components": components, "network": network,
         "ply": ply}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--only", nargs="*", choices=PARTS, default=list(PARTS))
    args = parser.parse_args()
    with contextlib.suppress(ImportError):
        import morphology
        morphology.keep_memory()
    os.sched_setaffinity(0, [max(os.sched_getaffinity(0))])
    os.environ.update(RAYON_NUM_THREADS="1", OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    print(f"{time.strftime('%Y-%m-%d')}, one core, load {os.getloadavg()[0]:.1f}, {args.runs} runs in turn, CPU ms: median (smallest-largest)\n")
    print(LINE.format("kernel", "input", "REPLICA", "peer", "", "ratio", "ahead"))
    for name in args.only:
        try:
            PARTS[name](args.runs)
        except Skipped as reason:
            print(f"{name}: left out: {reason}")


if __name__ == "__main__":
    main()
