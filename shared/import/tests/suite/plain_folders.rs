//! Imports of folders of sweeps with stamps, poses and IMU samples beside them.

use super::support::{Import, error, folder, of, write_file};
use formats::cloud::CloudPoint;
use formats::drive::Drive;
use formats::pcd::pcd_from_points;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// ns.
const BEGIN: i64 = 1_583_836_591_182_590_976;

fn points(x: f32) -> Vec<CloudPoint> {
    (0..3).map(|i| CloudPoint { x, y: i as f32, z: 0.5, intensity: 40.0 * (i + 1) as f32 }).collect()
}

/// Sweeps of these names; that of index k is k + 5 m in front.
fn sweeps(folder: &TempDir, names: &[&str]) -> PathBuf {
    let root = folder.path().join("recording/scans");
    for (k, name) in names.iter().enumerate() {
        write_file(&root.join(format!("{name}.pcd")), pcd_from_points(&points(k as f32 + 5.0)));
    }
    root
}

fn imported(import: &Import) -> (Vec<String>, Drive) {
    let report = import.run().expect("imports");
    (report, Drive::open(&import.out).expect("opens"))
}

/// Stamps after the begin, ns, and distances of the first points, m.
fn sweeps_of(drive: &Drive) -> Vec<(i64, f32)> {
    let mut source = drive.sweeps().expect("opens");
    let mut found = Vec::new();
    loop {
        let mut first = None;
        let sweep = source.next_sweep(|returns| first = first.or(returns.first().map(|r| r.x))).expect("reads");
        let Some(sweep) = sweep else { return found };
        found.push((sweep.stamp.0 - BEGIN, first.expect("has points")));
    }
}

#[test]
fn stamps_in_names_give_the_order_of_the_sweeps() {
    let folder = folder();
    // As Newer College names them, and numbers that sort otherwise as text.
    for names in [
        ["cloud_1583836591_182590976", "cloud_1583836591_282590976", "cloud_1583836592_82590976"],
        ["b_1583836591182590976", "c_1583836591282590976", "a_1583836592082590976"],
        ["1583836591.182590976", "1583836591.282590976", "1583836592.082590976"],
    ] {
        let source = sweeps(&folder, &names);
        let import = of(&source, &folder);
        let (report, drive) = imported(&import);
        assert!(report[1].contains("3 sweeps and their times"), "{report:?}");
        assert_eq!(sweeps_of(&drive), [(0, 5.0), (100_000_000, 6.0), (900_000_000, 7.0)]);
        std::fs::remove_dir_all(source).expect("removes");
        std::fs::remove_dir_all(import.out).expect("removes");
    }
}

#[test]
fn stamps_of_a_table_are_those_of_the_lines_or_of_the_names() {
    let by_line = "1583836591.182590976\n1583836591.282590976\n1583836592.082590976\n";
    let by_name =
        "# made by hand\nstamp,file\n1583836592082590976,2.pcd\n1583836591182590976,0.pcd\n1583836591282590976,1.pcd\n";
    let with_spaces = "0 1583836591.182590976\n1 1583836591.282590976\n2 1583836592.082590976\n";
    for (place, text) in [("times.txt", by_line), ("../timestamps.csv", by_name), ("timestamps.txt", with_spaces)] {
        let folder = folder();
        let source = sweeps(&folder, &["0", "1", "2"]);
        write_file(&source.join(place), text);
        let (report, drive) = imported(&of(&source, &folder));
        assert_eq!(sweeps_of(&drive), [(0, 5.0), (100_000_000, 6.0), (900_000_000, 7.0)], "{place}");
        assert!(!report.iter().any(|line| line.starts_with("not imported")), "{report:?}");
    }
}

#[test]
fn poses_and_imu_beside_the_sweeps_are_imported() {
    let folder = folder();
    let source = sweeps(&folder, &["cloud_1583836591_182590976", "cloud_1583836591_282590976"]);
    let poses =
        "#sec,nsec,x,y,z,qx,qy,qz,qw\n1583836591,182590976,1.5,0,0,0,0,0,1\n1583836591,282590976,2.5,0,0,0,0,0,1\n";
    write_file(&source.join("../registered_poses.csv"), poses);
    let imu = "sec,nsec,wx,wy,wz,ax,ay,az\n1583836591,190000000,0.1,0.2,0.3,0.01,-0.02,1.0\n1583836591,200000000,0.1,0.2,0.3,0,0,1\n";
    write_file(&source.join("imu.csv"), imu);
    let (report, drive) = imported(&of(&source, &folder));
    assert!(report.iter().any(|line| line.starts_with("imported: 2 true poses of ")), "{report:?}");
    let line = report.iter().find(|line| line.starts_with("imported: 2 IMU samples")).expect("is reported");
    assert!(line.ends_with("with accelerations in g"), "{line}");
    let truth = drive.true_trajectory().expect("has one").expect("reads");
    assert_eq!((truth.poses()[1].0.0 - BEGIN, truth.poses()[1].1.translation.x), (100_000_000, 2.5));
    let samples: Vec<_> = drive.imu().expect("opens").expect("has one").map(|sample| sample.expect("reads")).collect();
    assert_eq!(samples[0].angular_rate, [0.1, 0.2, 0.3]);
    assert!((samples[0].acceleration[2] - 9.806_65).abs() < 1e-12 && samples[0].stamp.0 == 1_583_836_591_190_000_000);
}

#[test]
fn poses_without_stamps_are_left_out() {
    let folder = folder();
    let source = sweeps(&folder, &["1583836591.182590976"]);
    write_file(&source.join("poses.txt"), "1 0 0 0 0 1 0 0 0 0 1 0\n");
    let (report, drive) = imported(&of(&source, &folder));
    assert!(report.iter().any(|line| line.ends_with("poses.txt, poses without stamps")), "{report:?}");
    assert!(drive.manifest().truth.is_none());
}

#[test]
fn ply_sweeps_are_converted_with_their_intensities() {
    let folder = folder();
    let source = folder.path().join("recording");
    for (k, name) in ["scan_1583836591182590976", "scan_1583836591282590976"].into_iter().enumerate() {
        let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty float y\nproperty float z\n\
                      property uchar red\nproperty float scalar_intensity\nend_header\n";
        write_file(&source.join(format!("{name}.ply")), format!("{header}{}.5 1 2 9 7\n3 -1 2 9 200\n", k + 5));
    }
    let (report, drive) = imported(&of(&source, &folder));
    assert!(report.iter().any(|line| line.starts_with("the files are converted")), "{report:?}");
    assert!(!report.iter().any(|line| line.starts_with("not imported")), "{report:?}");
    assert_eq!(sweeps_of(&drive), [(0, 5.5), (100_000_000, 6.5)]);
    let mut intensities = Vec::new();
    drive
        .sweeps()
        .expect("opens")
        .next_sweep(|found| intensities.extend(found.iter().map(|r| r.intensity)))
        .expect("reads");
    assert_eq!(intensities, [7, 200]);
}

#[test]
fn damaged_plain_folders_are_refused_with_file_and_rule() {
    for (file, text, rule) in [
        ("times.txt", "1583836591.1\n", "times.txt: 1 stamps for 2 sweeps"),
        ("times.txt", "0\n100000000\n", "times.txt:1: \"0\" must be a stamp: seconds with decimals"),
        ("times.txt", "0.5\n0.5\n", "1.pcd: has the stamp of 0.pcd"),
        ("times.csv", "0.pcd,1583836591.1\n1583836591.2\n", "must have a line with the name of each sweep, as 1.pcd"),
        ("times.csv", "file,time\n0,x\n", "times.csv:2: \"0,x\" must be a stamp"),
        ("imu.csv", "1,2,3\n", "imu.csv:1: the first line must name the columns"),
        (
            "imu.csv",
            "t,ax,ay,az,wx,wy,wz\n1.0,0,0,9.8,0,0\n",
            "imu.csv:2: \"1.0,0,0,9.8,0,0\": must have finite numbers",
        ),
        ("imu.csv", "t,ax,ay,az,wx,wy,wz\n1.0,0,0,nan,0,0,0\n", "imu.csv:2"),
        ("imu.csv", "t,ax,ay,az,wx,wy,wz\n2.0,0,0,9.8,0,0,0\n1.0,0,0,9.8,0,0,0\n", "imu.csv:3"),
        ("imu.csv", "t,ax,ay,az,wx,wy,wz\n2.0,0,0,980,0,0,0\n", "imu.csv: accelerations have a median of 980"),
        ("trajectory.txt", "0.5 0 0 0 0 0 0 2\n", "trajectory.txt:1: quaternion"),
        ("registered_poses.csv", "sec,nsec,x\n1,x,3\n", "registered_poses.csv:2: \"1,x,3\" must be sec,nsec,x,y,z"),
    ] {
        let folder = folder();
        let source = sweeps(&folder, &["0", "1"]);
        write_file(&source.join(file), text);
        let found = error(&of(&source, &folder));
        assert!(found.contains(rule), "{rule}: {found}");
    }
    let folder = folder();
    let source = sweeps(&folder, &["1583836591.2", "1583836591.3"]);
    write_file(&source.join("trajectory.txt"), "99.5 0 0 0 0 0 0 1\n");
    assert!(error(&of(&source, &folder)).contains("no pose lies between the first and the last sweep"));
    let cut = folder.path().join("cut");
    write_file(&cut.join("0.ply"), "ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\n");
    assert!(error(&of(&cut, &folder)).contains("0.ply: "), "{}", error(&of(&cut, &folder)));
}

/// Real sweeps under names with stamps.
#[real_data::test("kitti_raw_0048")]
fn real_sweeps_with_stamps_in_their_names_are_imported() {
    let folder = folder();
    let source = folder.path().join("recording");
    std::fs::create_dir_all(&source).expect("makes");
    for k in 0..3 {
        let original = real_data::path(&format!("kitti_raw_0048/{k:010}.pcd"));
        let link: PathBuf = source.join(format!("{}.pcd", BEGIN + k * 100_000_000));
        std::os::unix::fs::symlink(absolute(&original), link).expect("links");
    }
    let (_, drive) = imported(&of(&source, &folder));
    assert_eq!(sweeps_of(&drive).iter().map(|(stamp, _)| *stamp).collect::<Vec<_>>(), [0, 100_000_000, 200_000_000]);
}

fn absolute(path: &Path) -> PathBuf {
    path.canonicalize().expect("exists")
}
