"""Drives for odometry_table.py as folders of sweeps (layout: lab/studies/src/sweep_folder.rs), in a cache.

Real drives are converted from $REPLICA_DATA (default: ../shared/data next to the checkout). Simulated drives are made by the example
`sweeps_of_drive` and remade if the simulator has changed since (git trees of its crates).
"""
import glob, os, pathlib, shutil, subprocess, sys
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
DATA = pathlib.Path(os.environ.get("REPLICA_DATA", ROOT / "../shared/data"))
SIMULATOR = ["shared/simulation", "shared/town", "shared/raytrace", "lab/studies/examples/sweeps_of_drive.rs"]


def annieway(name, timed=False):
    def make(folder):
        subprocess.run([sys.executable, DATA / "annieway/to_bin.py", name, folder] + ["--times"] * timed, check=True)
        for times in (folder / "times").glob("*.npy"):
            np.save(times, np.load(times).astype(np.float64))
    return DATA / "annieway" / name, make


def part(of, first, last):
    """Sweeps `first` to `last` of another drive, as links."""
    def make(folder):
        whole, kinds = prepared(of), ["velodyne", "times"]
        for kind in [kind for kind in kinds if (whole / kind).is_dir()]:
            (folder / kind).mkdir()
            for number, file in enumerate(sorted((whole / kind).iterdir())[first:last + 1]):
                (folder / kind / f"{number:06}{file.suffix}").symlink_to(file)
    return REAL[of][0], make


def kitti_0048():
    def make(folder):
        (folder / "velodyne").mkdir()
        for number, file in enumerate(sorted((DATA / "kitti_raw_0048").glob("*.pcd"))):
            header, rows = file.read_bytes().split(b"DATA binary\n", 1)
            assert b"FIELDS x y z intensity" in header, file
            n_points = int(header.split(b"POINTS ")[1].split()[0])
            (folder / f"velodyne/{number:06}.bin").write_bytes(rows[:16 * n_points])
    return DATA / "kitti_raw_0048", make


def kitti_00():
    def make(folder):
        (folder / "velodyne").mkdir()
        lines = (DATA / "kitti00/poses_00_velodyne_frame.txt").read_text().splitlines()
        numbers = [94, 95]
        for to, number in enumerate(numbers):
            shutil.copy(DATA / f"kitti00/{number:06}.bin", folder / f"velodyne/{to:06}.bin")
        (folder / "poses.txt").write_text("".join(lines[number] + "\n" for number in numbers))
    return DATA / "kitti00", make


# Name: source, and what makes the folder. `_timed`: point times from the columns; peers and REPLICA deskew.
REAL = {}
REAL["muehlburger"] = annieway("muehlburger")
REAL["muehlburger_0_340"] = part("muehlburger", 0, 340)
REAL["muehlburger_timed"] = annieway("muehlburger", timed=True)
REAL["muehlburger_timed_0_340"] = part("muehlburger_timed", 0, 340)
REAL["durlacher"] = annieway("durlacher")
REAL["durlacher_timed"] = annieway("durlacher", timed=True)
REAL["kitti_0048"] = kitti_0048()
REAL["kitti_00"] = kitti_00()

FLAT_ROAD = ["muehlburger"]


GRADES = ["typical", "poor"]


def simulated(name):
    """TOWN_RIG_SEED_SECONDSs, or TOWN_RIG_SEED_SECONDSs_GRADE for a unit with errors: arguments of `sweeps_of_drive`, with OUT as "{}".
    None if the name is not of this form."""
    town, rig, seed, seconds, *grade = name.split("_") + [""] * 4
    grade = [grade for grade in grade if grade]
    if not (seconds.endswith("s") and seed.isdigit() and seconds[:-1].isdigit() and (not grade or grade[0] in GRADES and not grade[1:])):
        return None
    return ["--simulate", town, seed, seconds[:-1], "{}", "--rig", rig] + [part for grade in grade for part in ("--lidar-errors", grade)]


def simulator_version():
    found = subprocess.run(["git", "-C", ROOT, "rev-parse", *(f"HEAD:{path}" for path in SIMULATOR)], capture_output=True, text=True)
    return found.stdout


cache = ROOT / "target/odometry_drives"


def prepared(name):
    """The folder of a drive; None if its source is absent."""
    folder, partial = cache / name, cache / f"{name}.partial"
    drive = simulated(name)
    version = simulator_version() if drive else "1"
    marker = folder / "version.txt"
    if marker.exists() and marker.read_text() == version:
        return folder
    for old in (folder, partial):
        shutil.rmtree(old, ignore_errors=True)
    partial.mkdir(parents=True)
    if drive:
        program = ROOT / "target/release/examples/sweeps_of_drive"
        subprocess.run([program, *(str(partial) if part == "{}" else part for part in drive)], check=True)
    else:
        if name not in REAL:
            sys.exit(f"{name}: neither TOWN_RIG_SEED_SECONDSs[_GRADE] nor one of {', '.join(REAL)}")
        source, make = REAL[name]
        if not source.is_dir():
            return None
        make(partial)
    (partial / "version.txt").write_text(version)
    partial.rename(folder)
    return folder


def ins_track(name):
    """Stamps (s after the first one) and distances from the first place (m) of the INS, one for each sweep; None without INS."""
    path = DATA / "annieway" / name.removesuffix("_timed") / "ins.csv"
    if not path.exists():
        return None
    rows = [line.split(";") for line in path.read_text().splitlines() if line[:4].isdigit()]
    stamps = np.array([row[0] for row in rows], "datetime64[ns]")
    place = np.array([row[-4:-1] for row in rows], float)
    return (stamps - stamps[0]) / np.timedelta64(1, "s"), np.linalg.norm(place - place[0], axis=1)


def reference_end(name):
    """Mean end point of the reference trajectories of a recording without ground truth; None without them."""
    if name != "kitti_0048":
        return None
    ends = [np.loadtxt(path).reshape(-1, 3, 4)[-1, :, 3] for path in sorted(glob.glob(str(DATA / "kitti_raw_0048/ref_traj_*.txt")))]
    return np.mean(ends, axis=0) if ends else None
