"""Third-party odometries behind one interface, for odometry.py: `step(sweep)` returns odom_from_lidar at the LAST shot.

KISS-ICP 1.3 and small_gicp (with the deskew below) deskew to the last shot. GenZ-ICP 0.3 deskews to the middle one; its poses
are interpolated afterwards (`at_last_shot`). RKO-LIO needs an inertial unit: imu.csv, mounting.txt and places.txt of the folder.
"""
import csv, glob, os, sys, time
import numpy as np


class NotApplicable(Exception):
    """The folder lacks data that the method needs."""


class Refused(Exception):
    """The method gives no pose for this sweep."""


# ------------------------------------------------------------------ input
class Sweep:
    """`points` (n x 3, m), `seconds` after the first shot and their `share` of the sweep (0 to 1); None without point times."""

    def __init__(self, folder, file):
        if file.endswith(".npz"):
            z = np.load(file)
            p = z["xyz"] if "xyz" in z else z["points"][:, :3]
            t = z["t"] if "t" in z else (z["times"] if "times" in z else None)
        else:
            p = np.fromfile(file, np.float32).reshape(-1, 4)[:, :3]
            times = os.path.join(folder, "times", os.path.basename(file)[:-4] + ".npy")
            t = np.load(times) if os.path.exists(times) else None
        p = np.ascontiguousarray(p, np.float64)
        ok = np.isfinite(p).all(1)
        if not ok.all():
            p, t = p[ok], (t[ok] if t is not None else None)
        self.points = p
        self.seconds = None if t is None else np.asarray(t, np.float64)
        self.share = None if t is None else (self.seconds - self.seconds.min()) / max(1e-12, np.ptp(self.seconds))


def sweep_files(folder):
    for pattern in ("velodyne/*.bin", "*.bin", "*.npz", "scans/*.npz"):
        found = sorted(glob.glob(os.path.join(folder, pattern)))
        if found:
            return found
    sys.exit(f"{folder}: no sweeps (velodyne/*.bin, *.bin, *.npz)")


def read_kitti(path, n=None):
    rows = np.loadtxt(path).reshape(-1, 3, 4)
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :] = rows
    return poses[:n] if n else poses


def write_kitti(path, poses):
    np.savetxt(path, np.asarray(poses)[:, :3, :].reshape(len(poses), 12), fmt="%.9e")


# ------------------------------------------------------------------ motion
def so3_log(R):
    angle = np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return axis / 2 if angle < 1e-9 else angle / (2 * np.sin(angle)) * axis


def deskew(p, share, step):
    """Constant velocity, to the END of the sweep: exp((share - 1) step) p, to second order: 1e-6 for 5 degrees a sweep."""
    if share is None:
        return p
    s = (share - 1.0)[:, None]
    w = so3_log(step[:3, :3])[None, :] * s
    wp = np.cross(w, p)
    return p + wp + 0.5 * np.cross(w, wp) + s * step[:3, 3]


def at_last_shot(poses):
    """Poses at the last shots from poses at the middle ones: half way to the next pose."""
    found = []
    for i, pose in enumerate(poses):
        a, b = (i, i + 1) if i + 1 < len(poses) else (i - 1, i)
        step = np.linalg.inv(poses[a]) @ poses[b]
        x, y, z = so3_log(step[:3, :3]) / 2
        k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        half = np.eye(4)
        half[:3, :3], half[:3, 3] = np.eye(3) + k + k @ k / 2, step[:3, 3] / 2
        found.append(pose @ half)
    return found


# ------------------------------------------------------------------ methods
class Method:
    """`a`: options of odometry.py."""
    poses_at_middle = False

    def copy_cost(self, p):
        """ms of Python copies within `step`."""
        return 0.0


class Kiss(Method):
    def __init__(self, a, threads):
        from kiss_icp.config.parser import KISSConfig
        from kiss_icp.kiss_icp import KissICP
        from kiss_icp.pybind import kiss_icp_pybind
        self.native = kiss_icp_pybind
        c = KISSConfig()
        c.data.max_range, c.data.min_range, c.data.deskew = a.max_range, a.min_range, True
        c.mapping.voxel_size = a.voxel or a.max_range / 100.0
        c.registration.max_num_threads = threads
        self.odometry = KissICP(c)

    def step(self, sweep):
        self.odometry.config.data.deskew = sweep.share is not None
        self.odometry.register_frame(sweep.points, sweep.share if sweep.share is not None else np.zeros(0))
        return self.odometry.last_pose

    def copy_cost(self, p):
        begin = time.perf_counter()
        for _ in range(2):                                     # the raw sweep in, the deskewed one out and in again
            np.asarray(self.native._Vector3dVector(p))
        return (time.perf_counter() - begin) * 1e3


class Genz(Method):
    def __init__(self, a, threads):
        from genz_icp.config.parser import GenZConfig
        from genz_icp.genz_icp import GenZICP
        from genz_icp.pybind import genz_icp_pybind
        self.native = genz_icp_pybind
        c = GenZConfig()
        c.data.max_range, c.data.min_range, c.data.deskew = a.max_range, a.min_range, True
        if getattr(c.mapping, "voxel_size", None) is None or a.voxel:
            c.mapping.voxel_size = a.voxel or a.max_range / 100.0
        self.odometry = GenZICP(c)._odometry

    def step(self, sweep):
        self.poses_at_middle = sweep.share is not None
        self.odometry._register_frame(self.native._Vector3dVector(sweep.points), sweep.share if sweep.share is not None else np.zeros(0))
        return np.asarray(self.odometry._last_pose())

    def copy_cost(self, p):
        begin = time.perf_counter()
        self.native._Vector3dVector(p)
        return (time.perf_counter() - begin) * 1e3


class SmallGicp(Method):
    def __init__(self, a, threads):
        import small_gicp
        self.g, self.a, self.threads = small_gicp, a, threads
        self.pose, self.last_step, self.target = np.eye(4), np.eye(4), None

    def prepared(self, sweep):
        square = (sweep.points ** 2).sum(1)
        ok = (square > self.a.min_range ** 2) & (square < self.a.max_range ** 2)
        return deskew(sweep.points[ok], None if sweep.share is None else sweep.share[ok], self.last_step)

    def copy_cost(self, p):
        begin = time.perf_counter()
        self.g.PointCloud(p)
        return (time.perf_counter() - begin) * 1e3


class Vgicp(SmallGicp):
    """Sweep to Gaussian voxel map."""

    def step(self, sweep):
        g, a, threads = self.g, self.a, dict(num_threads=self.threads)
        points = g.voxelgrid_sampling(g.PointCloud(self.prepared(sweep)), a.sg_leaf, **threads)
        g.estimate_covariances(points, g.KdTree(points, **threads), num_neighbors=a.sg_k, **threads)
        if self.target is None:
            self.target = g.GaussianVoxelMap(a.sg_voxel)
            self.target.set_lru(horizon=100, clear_cycle=10)
            self.target.insert(points)
            return self.pose
        found = g.align(self.target, points, init_T_target_source=self.pose @ self.last_step, max_correspondence_distance=a.sg_dist, **threads)
        self.last_step = np.linalg.inv(self.pose) @ found.T_target_source
        self.pose = found.T_target_source
        self.target.insert(points, self.pose)
        return self.pose


class Gicp(SmallGicp):
    """Sweep to sweep."""
    kind = "GICP"

    def step(self, sweep):
        g, a, threads = self.g, self.a, dict(num_threads=self.threads)
        points, tree = g.preprocess_points(self.prepared(sweep), downsampling_resolution=a.sg_leaf, num_neighbors=a.sg_k, **threads)
        if self.target is not None:
            found = g.align(self.target[0], points, self.target[1], init_T_target_source=self.last_step, registration_type=self.kind,
                            max_correspondence_distance=a.sg_dist, **threads)
            self.last_step = found.T_target_source
            self.pose = self.pose @ self.last_step
        self.target = points, tree
        return self.pose


class Plane(Gicp):
    kind = "PLANE_ICP"


class Rko(Method):
    """RKO-LIO: LiDAR and inertial unit. Its base frame is the body, whose axes are the unit's."""

    def __init__(self, a, threads):
        if not os.path.exists(f"{a.folder}/imu.csv") or a.no_deskew:
            raise NotApplicable("needs an inertial unit")
        from rko_lio.config import LIOConfig
        from rko_lio.lio import LIO
        config = LIOConfig(max_range=a.max_range, min_range=a.min_range, max_num_threads=threads)
        config.voxel_size = a.rko_voxel
        config.initialization_phase = True
        self.odometry = LIO(config)
        self.base_from_lidar = read_kitti(f"{a.folder}/mounting.txt")[0]
        self.base_from_imu = np.eye(4)
        self.base_from_imu[:3, 3] = np.loadtxt(f"{a.folder}/places.txt")[0]
        self.stamps = np.loadtxt(f"{a.folder}/stamps.txt", dtype=np.int64, ndmin=1)
        with open(f"{a.folder}/imu.csv") as file:
            rows = [row for row in csv.reader(file) if row and not row[0].startswith("stamp")]
        self.samples = [(int(row[0]), np.array(row[1:4], float), np.array(row[4:7], float)) for row in rows]
        self.number, self.n_added = 0, 0

    def step(self, sweep):
        times = self.stamps[self.number] + np.round(sweep.seconds * 1e9).astype(np.int64)
        self.number += 1
        while self.n_added < len(self.samples) and self.samples[self.n_added][0] <= times.max():
            stamp, force, rate = self.samples[self.n_added]
            self.odometry.add_imu_measurement(force, rate, stamp, self.base_from_imu)
            self.n_added += 1
        try:
            self.odometry.register_scan(sweep.points, times, self.base_from_lidar)
        except Exception as problem:
            raise Refused(str(problem)) from problem
        return self.odometry.pose() @ self.base_from_lidar


METHODS = dict(kiss=Kiss, vgicp=Vgicp, gicp=Gicp, plane=Plane, genz=Genz, rko=Rko)
