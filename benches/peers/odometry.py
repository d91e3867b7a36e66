#!/usr/bin/env python3
"""Run several LiDAR odometries on the very same scans and score them the same way.

  python3 -m venv venv && venv/bin/pip install kiss-icp==1.3.0 small_gicp==1.0.1 genz-icp==0.3.2 numpy
  cargo build --release -p registration --examples
  target/release/examples/sweeps_of_drive --simulate urban 201 40 /tmp/u201        (or: sweeps_of_drive DRIVE FOLDER)
  venv/bin/python benches/peers/odometry.py /tmp/u201 --methods kiss-1,vgicp-1,gicp-1,genz-1 \
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
  genz     GenZ-ICP (pip install genz-icp)
EXTERNAL (REPLICA's own odometry, same table)
  --external NAME=POSES.txt[:MS_PER_SCAN]           score poses already computed
  --external-cmd 'NAME=CMD {scans} {out}'            run CMD pinned to --ext-cores cores (default 1); it must write KITTI
                                                     poses to {out} and may print "ms/scan: <x>" (else wall/scan is used)
OUTPUT  OUT/<method>.txt (KITTI poses), OUT/<method>.json, OUT/summary.json, OUT/summary.md and a table on stdout.

Timing covers deskew + preprocessing + registration + map update, not file reading. 'wall' is elapsed, 'cpu' is process CPU
time over all threads: on a shared machine compare the -1 runs by cpu. Python-binding copies are inside both and also shown
alone in 'copy' (estimated on the same arrays), so native cost ~ cpu - copy.
"""
import argparse, glob, json, os, re, resource, shlex, subprocess, sys, time
import numpy as np


# ------------------------------------------------------------------ input
def load_list(d):
    for pat in ("velodyne/*.bin", "*.bin", "*.npz", "scans/*.npz"):
        f = sorted(glob.glob(os.path.join(d, pat)))
        if f:
            return f
    sys.exit(f"no scans in {d}")


def load_scan(d, f):
    if f.endswith(".npz"):
        z = np.load(f)
        p = z["xyz"] if "xyz" in z else z["points"][:, :3]
        t = z["t"] if "t" in z else (z["times"] if "times" in z else None)
    else:
        p = np.fromfile(f, np.float32).reshape(-1, 4)[:, :3]
        tf = os.path.join(d, "times", os.path.basename(f)[:-4] + ".npy")
        t = np.load(tf) if os.path.exists(tf) else None
    p = np.ascontiguousarray(p, np.float64)
    ok = np.isfinite(p).all(1)
    if not ok.all():
        p, t = p[ok], (t[ok] if t is not None else None)
    if t is not None:
        t = np.asarray(t, np.float64)
        t = (t - t.min()) / max(1e-12, t.max() - t.min())
    return p, t


def read_kitti(fn, n=None):
    M = np.loadtxt(fn).reshape(-1, 3, 4)
    T = np.tile(np.eye(4), (len(M), 1, 1)); T[:, :3, :] = M
    return T[:n] if n else T


def write_kitti(fn, T):
    np.savetxt(fn, np.asarray(T)[:, :3, :].reshape(len(T), 12), fmt="%.9e")


# ------------------------------------------------------------------ SE3 helpers
def so3_log(R):
    c = np.clip((np.trace(R) - 1) / 2, -1, 1); a = np.arccos(c)
    if a < 1e-9:
        return np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    return a / (2 * np.sin(a)) * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])


def deskew(p, t, delta):
    """constant velocity, to the END of the scan: x_end = exp((t-1) xi) x  (rotation vector + linear translation, small motion)"""
    if t is None:
        return p
    s = (t - 1.0)[:, None]
    w = so3_log(delta[:3, :3])[None, :] * s
    # second-order Rodrigues is exact to 1e-6 for < 5 deg per scan
    wp = np.cross(w, p)
    return p + wp + 0.5 * np.cross(w, wp) + s * delta[:3, 3]


# ------------------------------------------------------------------ methods
class Kiss:
    def __init__(self, a, thr):
        from kiss_icp.config.parser import KISSConfig as KC
        from kiss_icp.kiss_icp import KissICP
        from kiss_icp.pybind import kiss_icp_pybind as pb
        self.pb = pb
        c = KC()
        c.data.max_range, c.data.min_range, c.data.deskew = a.max_range, a.min_range, True
        c.mapping.voxel_size = a.voxel or a.max_range / 100.0
        c.registration.max_num_threads = thr
        self.o = KissICP(c)

    def step(self, p, t):
        self.o.config.data.deskew = t is not None
        self.o.register_frame(p, t if t is not None else np.zeros(0))
        return self.o.last_pose

    def copy_cost(self, p, frame_n):
        t0 = time.perf_counter()
        v = self.pb._Vector3dVector(p); np.asarray(v)          # raw frame in, deskewed frame out
        v = self.pb._Vector3dVector(p); np.asarray(v)          # deskewed in to voxel filter
        return (time.perf_counter() - t0) * 1e3


class Genz:
    def __init__(self, a, thr):
        from genz_icp.config.parser import GenZConfig
        from genz_icp.genz_icp import GenZICP
        from genz_icp.pybind import genz_icp_pybind as pb
        self.pb = pb
        c = GenZConfig()
        c.data.max_range, c.data.min_range, c.data.deskew = a.max_range, a.min_range, True
        if getattr(c.mapping, "voxel_size", None) is None or a.voxel:
            c.mapping.voxel_size = a.voxel or a.max_range / 100.0
        self.o = GenZICP(c)

    def step(self, p, t):
        tt = np.zeros(0) if t is None else t
        self.o._odometry._register_frame(self.pb._Vector3dVector(p), tt)
        self.o.last_pose = np.asarray(self.o._odometry._last_pose())
        return self.o.last_pose

    def copy_cost(self, p, n):
        t0 = time.perf_counter(); self.pb._Vector3dVector(p)
        return (time.perf_counter() - t0) * 1e3


class _SG:
    def __init__(self, a, thr):
        import small_gicp
        self.g, self.a, self.thr = small_gicp, a, thr
        self.T, self.D, self.k = np.eye(4), np.eye(4), 0
        self.m = None

    def prep(self, p, t):
        r2 = (p * p).sum(1)
        ok = (r2 > self.a.min_range ** 2) & (r2 < self.a.max_range ** 2)
        return p[ok] if t is None else deskew(p[ok], t[ok], self.D)

    def copy_cost(self, p, n):
        t0 = time.perf_counter(); self.g.PointCloud(p)
        return (time.perf_counter() - t0) * 1e3


class Vgicp(_SG):
    def step(self, p, t):
        g, a = self.g, self.a
        q = self.prep(p, t)
        pts = g.voxelgrid_sampling(g.PointCloud(q), a.sg_leaf, num_threads=self.thr)
        tree = g.KdTree(pts, num_threads=self.thr)
        g.estimate_covariances(pts, tree, num_neighbors=a.sg_k, num_threads=self.thr)
        if self.m is None:
            self.m = g.GaussianVoxelMap(a.sg_voxel); self.m.set_lru(horizon=100, clear_cycle=10)
            self.m.insert(pts)
            return self.T
        r = g.align(self.m, pts, init_T_target_source=self.T @ self.D, max_correspondence_distance=a.sg_dist, num_threads=self.thr)
        Tn = r.T_target_source
        self.D = np.linalg.inv(self.T) @ Tn
        self.T = Tn
        self.m.insert(pts, Tn)
        return self.T


class Gicp(_SG):
    kind = "GICP"

    def step(self, p, t):
        g, a = self.g, self.a
        q = self.prep(p, t)
        pts, tree = g.preprocess_points(q, downsampling_resolution=a.sg_leaf, num_neighbors=a.sg_k, num_threads=self.thr)
        if self.m is None:
            self.m = (pts, tree)
            return self.T
        r = g.align(self.m[0], pts, self.m[1], init_T_target_source=self.D, registration_type=self.kind,
                    max_correspondence_distance=a.sg_dist, num_threads=self.thr)
        self.D = r.T_target_source
        self.T = self.T @ self.D
        self.m = (pts, tree)
        return self.T


class Plane(Gicp):
    kind = "PLANE_ICP"


METHODS = dict(kiss=Kiss, vgicp=Vgicp, gicp=Gicp, plane=Plane, genz=Genz)


def worker(a):
    name, thr = a.worker.rsplit("-", 1); thr = int(thr)
    files = load_list(a.folder)[: a.max_scans or None]
    o = METHODS[name](a, thr)
    T, ms, cpu, copy, npts = [], [], [], [], []
    for f in files:
        p, t = load_scan(a.folder, f)
        c0, t0 = time.process_time(), time.perf_counter()
        pose = o.step(p, None if a.no_deskew else t)
        ms.append((time.perf_counter() - t0) * 1e3); cpu.append((time.process_time() - c0) * 1e3)
        T.append(np.array(pose)); npts.append(len(p))
        if len(ms) % 10 == 5:
            copy.append(o.copy_cost(p, len(p)))
    write_kitti(f"{a.out}/{a.worker}.txt", T)
    k = min(5, len(ms) - 1)                              # skip warm-up frames
    w, c = ms[k:], cpu[k:]
    json.dump(dict(method=a.worker, ms_mean=float(np.mean(w)), ms_median=float(np.median(w)), ms_p95=float(np.percentile(w, 95)),
                   ms_max=float(np.max(w)), cpu_ms=float(np.mean(c)), cpu_median=float(np.median(c)), cpu_p95=float(np.percentile(c, 95)), copy_ms=float(np.median(copy)) if copy else 0.0, pts=float(np.mean(npts)), scans=len(T), cores=len(os.sched_getaffinity(0)), threads=len(os.listdir("/proc/self/task")),
                   rss_mb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024), open(f"{a.out}/{a.worker}.json", "w"))


# ------------------------------------------------------------------ scores
def umeyama(src, dst):
    ms, md = src.mean(0), dst.mean(0)
    U, _, Vt = np.linalg.svd((dst - md).T @ (src - ms))
    S = np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))])
    R = U @ S @ Vt
    return R, md - R @ ms


def ang(R):
    return np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))


def score(gt, est, segs, skip=0):
    n = min(len(gt), len(est)); gt, est = gt[skip:n], est[skip:n]; n -= skip
    gt = np.linalg.inv(gt[0]) @ gt; est = np.linalg.inv(est[0]) @ est
    dist = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(gt[:, :3, 3], axis=0), axis=1))])
    R, t = umeyama(est[:, :3, 3], gt[:, :3, 3])
    ate = np.sqrt((np.linalg.norm(est[:, :3, 3] @ R.T + t - gt[:, :3, 3], axis=1) ** 2).mean())
    end = np.linalg.norm(est[-1, :3, 3] - gt[-1, :3, 3])
    if not segs:
        segs = [s for s in (100, 200, 300, 400, 500, 600, 700, 800) if s < dist[-1]]
        if not segs:
            segs = [max(1.0, round(dist[-1] * f)) for f in (0.25, 0.5, 0.75)]
    step = 10 if segs[0] >= 100 and n > 200 else 1
    te, re_ = [], []
    for i in range(0, n, step):
        for L in segs:
            j = np.searchsorted(dist, dist[i] + L, side="right")
            if j >= n:
                continue
            E = np.linalg.inv(np.linalg.inv(est[i]) @ est[j]) @ (np.linalg.inv(gt[i]) @ gt[j])
            te.append(np.linalg.norm(E[:3, 3]) / L); re_.append(ang(E[:3, :3]) / L)
    f_t, f_r = [], []
    for i in range(n - 1):
        E = np.linalg.inv(np.linalg.inv(est[i]) @ est[i + 1]) @ (np.linalg.inv(gt[i]) @ gt[i + 1])
        f_t.append(np.linalg.norm(E[:3, 3])); f_r.append(ang(E[:3, :3]))
    return dict(path_m=float(dist[-1]), ate_rmse_m=float(ate), end_err_m=float(end), segments=[float(s) for s in segs],
                rpe_trans_pct=float(100 * np.mean(te)) if te else None, rpe_rot_deg_per_m=float(np.rad2deg(np.mean(re_))) if re_ else None,
                frame_rpe_cm=float(100 * np.sqrt(np.mean(np.square(f_t)))), frame_rpe_deg=float(np.rad2deg(np.sqrt(np.mean(np.square(f_r))))))


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
    files = load_list(a.folder)[: a.max_scans or None]
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
        add(m, json.load(open(f"{a.out}/{m}.json")), f"{a.out}/{m}.txt")
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
        g = re.search(r"ms/scan[:= ]+([0-9.]+)", p.stdout + p.stderr)
        add(name, dict(ms_mean=float(g.group(1)) if g else wall, wall_ms=wall), out)
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
