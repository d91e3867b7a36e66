#!/usr/bin/env python3
"""Run several LiDAR odometries on the same scans and score them with the same measures.

  python3 -m venv venv && venv/bin/pip install kiss-icp==1.3.0 small_gicp==1.0.1 genz-icp==0.3.2 rko_lio==0.4.0 numpy
  cargo build --release -p studies --examples
  target/release/examples/sweeps_of_drive --simulate urban 201 40 /tmp/u201        (or: sweeps_of_drive DRIVE FOLDER)
  venv/bin/python lab/peers/odometry.py /tmp/u201 --methods kiss-1,vgicp-1,gicp-1,genz-1 \
      --external-cmd 'ours=target/release/examples/odometry {scans} {out}'

INPUT  a folder with
  velodyne/*.bin (float32 x y z i)  |  *.bin in the folder itself  |  *.npz with xyz (or points) and t (or times)
  times/*.npy    optional per-point time (any unit, rising through the scan); no times -> no deskew
  poses.txt      ground truth, KITTI 3x4 sensor->world (or --gt FILE).  Convention here: pose at scan END.
METHODS (each runs in a fresh process, pinned to 1 or 2 cores; the suffix -1 / -2 is the number of cores)
  kiss     KISS-ICP defaults for the given max range (voxel = max_range/100), own deskew
  vgicp    small_gicp, scan-to-model VGICP: 0.25 m downsample, 10-NN covariances, Gaussian voxel map 1.0 m, LRU 100 scans
  gicp     small_gicp, scan-to-scan GICP: 0.25 m downsample, 10-NN covariances, k-d tree of the previous scan
  plane    small_gicp, scan-to-scan point-to-plane ICP, same preprocessing
  genz     GenZ-ICP, defaults for the given max range
  rko      RKO-LIO, defaults; needs imu.csv, mounting.txt and places.txt in the folder
EXTERNAL (REPLICA's own odometry, same table)
  --external NAME=POSES.txt[:MS_PER_SCAN]           score poses already computed
  --external-cmd 'NAME=CMD {scans} {out}'            run CMD pinned to --ext-cores cores (default 1); it must write KITTI
                                                     poses to {out} and may print "ms/scan: <x>" (else wall/scan is used)
OUTPUT  OUT/<method>.txt (KITTI poses), OUT/<method>.json, OUT/summary.json, OUT/summary.md and a table on stdout.

Timing covers deskew + preprocessing + registration + map update, not file reading. 'wall' is elapsed, 'cpu' is process CPU
time over all threads: on a shared machine compare the -1 runs by cpu. Python-binding copies are inside both and also shown
alone in 'copy' (estimated on the same arrays), so native cost ~ cpu - copy.
"""
import argparse, json, os, re, resource, shlex, subprocess, sys, time
import numpy as np
from odometry_methods import METHODS, NotApplicable, Refused, Sweep, at_last_shot, read_kitti, sweep_files, write_kitti
from odometry_scores import score


def worker(a):
    """Runs one method in this process: poses to OUT/METHOD.txt, costs to OUT/METHOD.json."""
    name, threads = a.worker.rsplit("-", 1)
    files = sweep_files(a.folder)[: a.max_scans or None]
    try:
        method = METHODS[name](a, int(threads))
    except (NotApplicable, ImportError) as problem:
        json.dump(dict(method=a.worker, absent=str(problem)), open(f"{a.out}/{a.worker}.json", "w"))
        return
    poses, wall, cpu, copies, n_points, n_answered = [], [], [], [], 0, 0
    for file in files:
        sweep = Sweep(a.folder, file)
        if a.no_deskew:
            sweep.share = sweep.seconds = None
        cpu_begin, wall_begin = time.process_time(), time.perf_counter()
        try:
            pose = np.array(method.step(sweep))
        except Refused:
            pose = np.full((4, 4), np.nan)
        wall.append((time.perf_counter() - wall_begin) * 1e3)
        cpu.append((time.process_time() - cpu_begin) * 1e3)
        answered = bool(np.isfinite(pose).all())
        n_answered += answered
        poses.append(pose if answered else (poses[-1] if poses else np.eye(4)))
        n_points += len(sweep.points)
        if len(wall) % 10 == 5:
            copies.append(method.copy_cost(sweep.points))
    write_kitti(f"{a.out}/{a.worker}.txt", at_last_shot(poses) if method.poses_at_middle else poses)
    first = min(5, len(wall) - 1)                        # without the first sweeps, which warm caches
    w, c = wall[first:], cpu[first:]
    json.dump(dict(method=a.worker, ms_mean=float(np.mean(w)), cpu_ms=float(np.mean(c)), cpu_median=float(np.median(c)),
                   cpu_p95=float(np.percentile(c, 95)), copy_ms=float(np.median(copies)) if copies else 0.0, pts=n_points / len(files),
                   answered=n_answered / len(files), scans=len(files), rss_mb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
              open(f"{a.out}/{a.worker}.json", "w"))


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("folder"); ap.add_argument("--gt"); ap.add_argument("--out")
    ap.add_argument("--methods", default="kiss-1,kiss-2,vgicp-1,vgicp-2")
    ap.add_argument("--max-scans", type=int, default=0)
    ap.add_argument("--max-range", type=float, default=80.0); ap.add_argument("--min-range", type=float, default=1.5)
    ap.add_argument("--voxel", type=float, default=0.0, help="KISS/GenZ voxel, 0 = max_range/100")
    ap.add_argument("--sg-leaf", type=float, default=0.25); ap.add_argument("--sg-voxel", type=float, default=1.0)
    ap.add_argument("--sg-k", type=int, default=10); ap.add_argument("--sg-dist", type=float, default=1.0)
    ap.add_argument("--skip", type=int, default=0, help="leave the first N poses out of the scores (start-up transient)")
    ap.add_argument("--segments", default="", help="e.g. 100,200 ; default KITTI 100..800 that fit, else fractions of the path")
    ap.add_argument("--rko-voxel", type=float, default=1.0, help="RKO-LIO's voxel, m")
    ap.add_argument("--no-deskew", action="store_true")
    ap.add_argument("--external", action="append", default=[]); ap.add_argument("--external-cmd", action="append", default=[])
    ap.add_argument("--ext-cores", type=int, default=1); ap.add_argument("--worker")
    a = ap.parse_args()
    a.out = a.out or os.path.join(a.folder, "odometry")
    os.makedirs(a.out, exist_ok=True)
    if a.worker:
        return worker(a)
    cores = sorted(os.sched_getaffinity(0))
    gtf = a.gt or os.path.join(a.folder, "poses.txt")
    files = sweep_files(a.folder)[: a.max_scans or None]
    gt = read_kitti(gtf, len(files)) if os.path.exists(gtf) else None
    segs = [float(s) for s in a.segments.split(",") if s]
    rows = []

    def pin(n):
        n = min(n, len(cores)); sel = cores[:n] if n > 1 else cores[-1:]
        env = dict(os.environ, OMP_NUM_THREADS=str(n), TBB_NUM_THREADS=str(n), OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", RAYON_NUM_THREADS=str(n))
        return (lambda: os.sched_setaffinity(0, sel)), env

    def add(name, info, poses):
        r = dict(info, method=name)
        if gt is not None:
            r.update(score(gt, read_kitti(poses, len(files)), segs, a.skip))
        rows.append(r)

    for m in [x for x in a.methods.split(",") if x]:
        if "-" not in m:
            m += "-1"
        pre, env = pin(int(m.rsplit("-", 1)[1]))
        cmd = [sys.executable, os.path.abspath(__file__)] + sys.argv[1:] + ["--worker", m]
        p = subprocess.run(cmd, preexec_fn=pre, env=env, capture_output=True, text=True)
        if p.returncode:
            print(f"{m}: FAILED\n{p.stderr[-800:]}", file=sys.stderr); continue
        info = json.load(open(f"{a.out}/{m}.json"))
        if "absent" in info:
            print(f"{m}: {info['absent']}", file=sys.stderr)
            rows.append(info)
        else:
            add(m, info, f"{a.out}/{m}.txt")
    for e in a.external:
        name, rest = e.split("=", 1); fn, _, ms = rest.partition(":")
        add(name, dict(ms_mean=float(ms) if ms else float("nan")), fn)
    for e in a.external_cmd:
        name, cmd = e.split("=", 1); out = f"{a.out}/{name}.txt"
        pre, env = pin(a.ext_cores)
        t0 = time.perf_counter()
        p = subprocess.run(shlex.split(cmd.format(scans=a.folder, out=out)), preexec_fn=pre, env=env, capture_output=True, text=True)
        wall = (time.perf_counter() - t0) * 1e3 / len(files)
        if p.returncode:
            print(f"{name}: FAILED\n{p.stderr[-800:]}", file=sys.stderr); continue
        said = lambda pattern: (found := re.search(pattern, p.stdout + p.stderr)) and float(found.group(1))
        ms, n_bridged = said(r"ms/scan[:= ]+([0-9.]+)"), said(r"([0-9]+) bridged")
        add(name, dict(ms_mean=wall if ms is None else ms, cpu_ms=ms, wall_ms=wall, scans=len(files), answered=None if n_bridged is None else 1 - n_bridged / len(files),
                       said=p.stdout), out)
    load = os.getloadavg()[0]
    head = f"{'method':<12}{'wall ms':>9}{'cpu ms':>8}{'median':>8}{'p95':>8}{'copy':>6}{'MB':>6}{'ATE m':>9}{'end m':>8}{'RPE %':>8}{'deg/100m':>10}{'frame cm':>10}{'frame deg':>10}"
    lines = [f"{a.folder}: {len(files)} scans, {rows[0].get('path_m', 0) if rows else 0:.0f} m, segments {rows[0].get('segments') if rows else None}, skip {a.skip}, load {load:.1f}", head]
    g = lambda r, k, f: format(r[k], f) if r.get(k) is not None and r.get(k) == r.get(k) else "-"
    for r in rows:
        if r.get("rpe_rot_deg_per_m") is not None:
            r["rpe_rot_deg_per_100m"] = 100 * r["rpe_rot_deg_per_m"]
        lines.append(f"{r['method']:<12}{g(r,'ms_mean','.1f'):>9}{g(r,'cpu_ms','.1f'):>8}{g(r,'cpu_median','.1f'):>8}{g(r,'cpu_p95','.1f'):>8}{g(r,'copy_ms','.1f'):>6}{g(r,'rss_mb','.0f'):>6}"
                     f"{g(r,'ate_rmse_m','.3f'):>9}{g(r,'end_err_m','.3f'):>8}{g(r,'rpe_trans_pct','.3f'):>8}{g(r,'rpe_rot_deg_per_100m','.3f'):>10}"
                     f"{g(r,'frame_rpe_cm','.2f'):>10}{g(r,'frame_rpe_deg','.3f'):>10}")
    print("\n".join(lines))
    open(f"{a.out}/summary.md", "w").write("```\n" + "\n".join(lines) + "\n```\n")
    json.dump(rows, open(f"{a.out}/summary.json", "w"), indent=1)


if __name__ == "__main__":
    main()
