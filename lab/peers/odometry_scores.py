"""Scores of trajectories against ground truth, and of drives without one, for odometry.py and odometry_table.py."""
import numpy as np
from odometry_methods import so3_log


def angle(R):
    return np.linalg.norm(so3_log(R))


def umeyama(source, target):
    ms, mt = source.mean(0), target.mean(0)
    U, _, Vt = np.linalg.svd((target - mt).T @ (source - ms))
    R = U @ np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return R, mt - R @ ms


def relative_errors(truth, poses, pairs):
    """Translation (m) and rotation (rad) errors of the steps between the poses `pairs`."""
    found = []
    for i, j in pairs:
        error = np.linalg.inv(np.linalg.inv(poses[i]) @ poses[j]) @ (np.linalg.inv(truth[i]) @ truth[j])
        found.append((np.linalg.norm(error[:3, 3]), angle(error[:3, :3])))
    return np.array(found).reshape(-1, 2)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def score(truth, poses, segments=(), skip=0, window=10):
    """Scores against the ground truth: KITTI segments (m), windows of sweeps, sweep to sweep, absolute after a rigid fit."""
    n = min(len(truth), len(poses))
    truth, poses = truth[skip:n], poses[skip:n]
    n -= skip
    truth, poses = np.linalg.inv(truth[0]) @ truth, np.linalg.inv(poses[0]) @ poses
    steps = np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1)
    along = np.concatenate([[0], np.cumsum(steps)])
    R, t = umeyama(poses[:, :3, 3], truth[:, :3, 3])
    lengths = list(segments) or [s for s in range(100, 900, 100) if s < along[-1]]
    if not lengths:
        lengths = [max(1.0, round(along[-1] * share)) for share in (0.25, 0.5, 0.75)]
    step = 10 if lengths[0] >= 100 and n > 200 else 1
    ends = {(i, L): int(np.searchsorted(along, along[i] + L, side="right")) for i in range(0, n, step) for L in lengths}
    pairs = [(i, j, L) for (i, L), j in ends.items() if j < n]
    errors = relative_errors(truth, poses, [pair[:2] for pair in pairs])
    by_length = np.array([pair[2] for pair in pairs])
    windows = relative_errors(truth, poses, [(i, i + window) for i in range(0, n - window, window)])
    singles = relative_errors(truth, poses, [(i, i + 1) for i in range(n - 1)])
    found = dict(path_m=float(along[-1]), segments=[float(L) for L in lengths],
                 ate_rmse_m=rms(np.linalg.norm(poses[:, :3, 3] @ R.T + t - truth[:, :3, 3], axis=1)),
                 end_err_m=float(np.linalg.norm(poses[-1, :3, 3] - truth[-1, :3, 3])),
                 frame_rpe_cm=100 * rms(singles[:, 0]), frame_rpe_deg=float(np.rad2deg(rms(singles[:, 1]))))
    if len(pairs):
        found |= dict(rpe_trans_pct=float(100 * np.mean(errors[:, 0] / by_length)),
                      rpe_rot_deg_per_m=float(np.rad2deg(np.mean(errors[:, 1] / by_length))))
    if len(windows):
        found |= dict(window_cm=100 * rms(windows[:, 0]), window_deg=float(np.rad2deg(rms(windows[:, 1]))))
    return found


def yaw_pitch_roll(R):
    return np.rad2deg([np.arctan2(R[1, 0], R[0, 0]), -np.arcsin(np.clip(R[2, 0], -1, 1)), np.arctan2(R[2, 1], R[2, 2])])


def road_normal(points, height_m=1.73):
    """Normal of the road around an upright LiDAR, in its frame: planes by least squares, each time without the points off it."""
    flat = np.linalg.norm(points[:, :2], axis=1)
    near = points[(flat > 3) & (flat < 20) & (np.abs(points[:, 2] + height_m) < 0.6)]
    for gate_m in (0.3, 0.15, 0.08, 0.08, 0.08):
        center = near.mean(0)
        normal = np.linalg.svd(near - center, full_matrices=False)[2][2]
        normal *= np.sign(normal[2])
        off = np.abs((near - center) @ normal)
        near = near[off < gate_m]
    return normal


def level(poses, first_points):
    """The same poses in a frame whose z axis is the normal of the road below the first one: mounting and road removed."""
    normal = road_normal(first_points)
    x = np.array([1.0, 0, 0]) - normal[0] * normal
    x /= np.linalg.norm(x)
    level_from_first = np.eye(4)
    level_from_first[:3, :3] = np.stack([x, np.cross(normal, x), normal])
    return level_from_first @ np.linalg.inv(poses[0]) @ poses


def end_of(poses):
    """The end of a drive without ground truth: path, end point and angles in the frame of the first pose."""
    moved = np.linalg.inv(poses[0]) @ poses
    place = moved[:, :3, 3]
    return dict(path_m=float(np.linalg.norm(np.diff(place, axis=0), axis=1).sum()), end_m=place[-1].tolist(),
                distance_m=float(np.linalg.norm(place[-1])), ypr_deg=yaw_pitch_roll(moved[-1, :3, :3]).tolist())


def against_track(poses, stamps, distances, margin=4):
    """Scores against distances from the first place by another system, whose stamps may differ from the stamps of the poses: the difference at
    the end, the delay with which the poses fit best, and the remaining error. Fast vehicles move by a meter in a revolution."""
    place = poses[:, :3, 3] - poses[0, :3, 3]
    found = np.linalg.norm(place, axis=1)
    inner = slice(margin, len(found) - margin)

    def remaining(delay_s):
        at = np.interp(stamps + delay_s, stamps, distances)
        return found[inner] - (at[inner] - at[0])

    delays_s = np.arange(-0.2, 0.2005, 0.001)
    errors_m = [rms(remaining(delay_s)) for delay_s in delays_s]
    best = int(np.argmin(errors_m))
    return dict(ins_m=float(found[-1] - distances[-1]), ins_delay_s=float(delays_s[best]), ins_remaining_m=errors_m[best])


def flat_road(poses, first_points, last_points):
    """On a flat road: the height of the last pose above the road plane of the first, and the inclination of the last sweep's road to it
    along the direction of travel (pitch, up positive) and across. Both are 0 without drift; mounting and suspension cancel."""
    leveled = level(poses, first_points)
    heading = leveled[-1, :3, 0] * [1, 1, 0]
    heading /= np.linalg.norm(heading)
    normal = leveled[-1, :3, :3] @ road_normal(last_points)
    along, across = -normal @ heading, normal @ np.cross([0, 0, 1.0], heading)
    return dict(height_m=float(leveled[-1, 2, 3]), sideways_m=float(leveled[-1, 1, 3]),
                road_pitch_deg=float(np.rad2deg(np.arcsin(along))), road_roll_deg=float(np.rad2deg(np.arcsin(across))))
