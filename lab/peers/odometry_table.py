#!/usr/bin/env python3
"""REPLICA's odometry and others on the same sweeps of simulated and real drives: one markdown table, and all numbers as JSON.

  python3 -m venv venv && venv/bin/pip install kiss-icp==1.3.0 small_gicp==1.0.1 genz-icp==0.3.2 rko_lio==0.4.0 numpy scipy pillow
  cargo build --release -p studies --examples && cargo build --release -p replica_lab
  venv/bin/python lab/peers/odometry_table.py                        everything
  venv/bin/python lab/peers/odometry_table.py --seconds 12           short drives, to try it
  venv/bin/python lab/peers/odometry_table.py --drives durlacher,muehlburger_0_340 --methods replica --no-map

Each method runs on one core, with the same settings on all drives: KISS-ICP, GenZ-ICP and RKO-LIO with the defaults that they have
for a range of 100 m, small_gicp's VGICP tuned (voxels of 0.5 m, 20 neighbors), REPLICA with its defaults ("replica") and as
the paper's IMLS-SLAM ("imls"). Drives: see odometry_drives.py; simulated ones are TOWN_RIG_SEED_SECONDSs, with _poor (or _typical) behind it for
a LiDAR with errors. They are kept in
--cache; a second run does not simulate again. Nor does it run other programs again whose results --out has.

drift        translation and rotation over segments of 100, 200, ... 800 m (KITTI), or of 1/4, 1/2, 3/4 of a path below 100 m
1 s          error of the motion over ten sweeps, root mean square
wall         median thickness of facades in a map of the last 100 sweeps (`replica-lab evaluate map`, range 30 m)
CPU          ms a sweep, all threads, without reading
answered     share of the sweeps that were matched (others: a pose was returned)
end, ypr     end point and angles, in the frame of the first pose; for drives without ground truth
against      INS: difference of the distance from first to last pose; delay of the poses behind the stamps of the INS with which the
             distances fit best, and what then remains (root mean square); peers: distance from the mean end point of the recording's
             references; flat road: height and inclination of the last sweep's road over the first's, both 0 without drift
"""
import argparse, json, os, pathlib, subprocess, sys, tempfile
import numpy as np
import odometry_drives as drives
from odometry_methods import Sweep, read_kitti, sweep_files
from odometry_scores import against_track, end_of, flat_road

HERE = pathlib.Path(__file__).resolve().parent
RIGS = [("urban", "nuscenes"), ("rural", "nuscenes"), ("urban", "kitti"), ("rural", "kitti"), ("urban", "l3d2"), ("rural", "l3d2")]
PEERS = ["kiss", "genz", "vgicp", "rko"]
OURS = {"replica": "", "imls": " --algorithm imls"}
NAMES = dict(replica="REPLICA", imls="IMLS-SLAM (paper)", kiss="KISS-ICP 1.3.0", genz="GenZ-ICP 0.3.2", vgicp="VGICP (small_gicp 1.0.1)",
             rko="RKO-LIO 0.4.0 (with IMU)")


def run(name, folder, methods, args):
    """Rows by method: scores and costs of one drive. Rows of other programs that --out already has are kept."""
    out = args.out / name
    out.mkdir(parents=True, exist_ok=True)
    kept_path = out / "rows.json"
    kept = json.loads(kept_path.read_text()) if kept_path.exists() and not args.again else {}
    rows = {m: row for m, row in kept.items() if m in PEERS}
    command = [sys.executable, HERE / "odometry.py", folder, "--out", out, "--max-range", "100", "--sg-voxel", "0.5", "--sg-k", "20",
               "--methods", ",".join(f"{m}-1" for m in methods if m in PEERS and m not in rows)]
    for m in [m for m in methods if m in OURS]:
        options = OURS[m] + "".join(f" --set {pair}" for pair in args.set)
        command += ["--external-cmd", f"{m}={args.odometry} {{scans}} {{out}}{options}"]
    found = subprocess.run(command, stdout=subprocess.PIPE, text=True)
    if found.returncode:
        sys.exit(f"{name}: odometry.py failed")
    rows |= {row["method"].removesuffix("-1"): row for row in json.loads((out / "summary.json").read_text())}
    kept_path.write_text(json.dumps(kept | rows, indent=1))
    has_truth = (folder / "poses.txt").exists()
    files = sweep_files(folder)
    for method, row in rows.items():
        path = out / (f"{method}-1.txt" if method in PEERS else f"{method}.txt")
        if "absent" in row or not path.exists():
            continue
        row["poses"] = str(path)
        if not has_truth:
            row |= without_truth(name, folder, files, read_kitti(path))
    if args.map:
        for method, thickness in wall_thickness(folder, {m: r["poses"] for m, r in rows.items() if "poses" in r}, args.replica_lab).items():
            rows[method]["wall_cm"] = thickness
    return rows


def without_truth(name, folder, files, poses):
    row = end_of(poses)
    if (track := drives.ins_track(name)) is not None:
        row |= against_track(poses, *track)
    if (end := drives.reference_end(name)) is not None:
        row["references_m"] = float(np.linalg.norm(np.array(row["end_m"]) - end))
    if name.startswith(tuple(drives.FLAT_ROAD)):
        row |= flat_road(poses, *(Sweep(folder, file).points for file in (files[0], files[len(poses) - 1])))
    return row


def wall_thickness(folder, poses_by_method, replica_lab, count=100):
    """Median thickness of facades, cm."""
    import map_quality
    if not os.path.exists(replica_lab) or not poses_by_method:
        return {}
    truth_path = folder / "poses.txt"
    with tempfile.TemporaryDirectory() as out:
        for method, path in poses_by_method.items():
            rotations, positions = map_quality.poses(path)
            n = len(positions)
            first = max(0, n - count)
            if truth_path.exists():
                truth = map_quality.poses(truth_path)
                part = slice(first, n)
                moved = map_quality.fitted(rotations[part], positions[part], (truth[0][part], truth[1][part]))
                matrices = rotations.as_matrix()
                matrices[part], positions[part] = moved[0].as_matrix(), moved[1]
                rotations = map_quality.Rotation.from_matrix(matrices)
            points = map_quality.cloud(folder, rotations, positions, first + 1, n - first, 30.0)
            map_quality.write_ply(f"{out}/{method}.ply", points)
        command = [replica_lab, "evaluate", "map", *(f"{out}/{m}.ply" for m in poses_by_method), "--out", f"{out}/report"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        report = json.loads(pathlib.Path(f"{out}/report/map.json").read_text())
        return {m: 100 * found["facade_thickness_m"]["median"] for m, found in zip(poses_by_method, report) if found.get("facade_thickness_m")}


def table(results):
    head = ["drive", "method", "drift %", "deg per 100 m", "1 s: cm", "deg", "wall cm", "CPU ms", "answered %", "end m", "ypr deg", "against"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    number = lambda row, key, form, factor=1: "–" if row.get(key) is None else format(factor * row[key], form)
    triple = lambda row, key, form: "–" if key not in row else " ".join(format(v, form) for v in row[key])
    for drive, rows in results.items():
        for method, row in rows.items():
            if "absent" in row:
                lines.append(f"| {drive} | {NAMES[method]} | {row['absent']} |" + " |" * (len(head) - 3))
                continue
            against = []
            if "ins_m" in row:
                against.append(f"INS {row['ins_m']:+.2f} m, {1e3 * row['ins_delay_s']:+.0f} ms: {100 * row['ins_remaining_m']:.1f} cm")
            if "references_m" in row:
                against.append(f"peers {row['references_m']:.3f} m")
            if "height_m" in row:
                against.append(f"flat road {row['height_m']:+.1f} m, {row['road_pitch_deg']:+.1f} {row['road_roll_deg']:+.1f} deg")
            if "frame_rpe_cm" in row and row["scans"] == 2:
                against.append(f"truth {row['frame_rpe_cm']:.2f} cm, {row['frame_rpe_deg']:.3f} deg")
            cells = [drive, NAMES[method], number(row, "rpe_trans_pct", ".3f"), number(row, "rpe_rot_deg_per_m", ".3f", 100),
                     number(row, "window_cm", ".2f"), number(row, "window_deg", ".3f"), number(row, "wall_cm", ".2f"),
                     number(row, "cpu_ms", ".1f"), number(row, "answered", ".1f", 100), triple(row, "end_m", ".2f"),
                     triple(row, "ypr_deg", ".2f"), "; ".join(against) or "–"]
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", help="names, separated by commas; default: all")
    parser.add_argument("--methods", default=",".join([*OURS, *PEERS]))
    parser.add_argument("--seconds", type=int, default=40, help="of the default simulated drives")
    parser.add_argument("--seed", type=int, default=501, help="of the default simulated drives")
    parser.add_argument("--odometry", default=str(drives.ROOT / "target/release/examples/odometry"), help="REPLICA's program to score")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="passed to it")
    parser.add_argument("--replica-lab", default=str(drives.ROOT / "target/release/replica-lab"), help="for the thickness of walls")
    parser.add_argument("--no-map", dest="map", action="store_false", help="without the thickness of walls")
    parser.add_argument("--again", action="store_true", help="run other programs again on drives of which --out has their results")
    parser.add_argument("--cache", type=pathlib.Path, default=drives.cache)
    parser.add_argument("--out", type=pathlib.Path, default=drives.ROOT / "target/odometry_table", help="poses, table.md, table.json")
    args = parser.parse_args()
    drives.cache = args.cache.resolve()
    names = args.drives.split(",") if args.drives else [f"{town}_{rig}_{args.seed}_{args.seconds}s" for town, rig in RIGS] + list(drives.REAL)
    methods = args.methods.split(",")
    if unknown := [m for m in methods if m not in NAMES]:
        sys.exit(f"--methods: {unknown[0]} is not one of {', '.join(NAMES)}")
    args.out.mkdir(parents=True, exist_ok=True)
    results = {}
    for name in names:
        folder = drives.prepared(name)
        if folder is None:
            print(f"{name}: skipped, its recording is not in {drives.DATA}", file=sys.stderr)
            continue
        found = run(name, folder, methods, args)
        results[name] = {m: found[m] for m in methods if m in found}
        print(f"{name}: done", file=sys.stderr, flush=True)
        # After each drive, so that a stopped run has written its results so far.
        (args.out / "table.json").write_text(json.dumps(results, indent=1))
        (args.out / "table.md").write_text(table(results))
    print(table(results), end="")


if __name__ == "__main__":
    main()
