//! Imports of a sequence of KITTI odometry with the labels of SemanticKITTI, in the published format.

use super::support::{Import, error, first_label, folder, import_from, png, write_file};
use drive::{Drive, NoLabel};
use formats::cloud::CloudPoint;
use formats::kitti::{Label, bin_from_points, bytes_from_labels, labels_from_bytes};
use formats::trajectory::poses_from_kitti;
use geometry::{Point3, Pose};
use messages::ClassId;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Sequence 00.
const CALIB: &str = "P0: 7.188560e+02 0.000000e+00 6.071928e+02 0.000000e+00 0.000000e+00 7.188560e+02 1.852157e+02 0.000000e+00 0.000000e+00 0.000000e+00 1.000000e+00 0.000000e+00
P1: 7.188560e+02 0.000000e+00 6.071928e+02 -3.861448e+02 0.000000e+00 7.188560e+02 1.852157e+02 0.000000e+00 0.000000e+00 0.000000e+00 1.000000e+00 0.000000e+00
P2: 7.188560e+02 0.000000e+00 6.071928e+02 4.538225e+01 0.000000e+00 7.188560e+02 1.852157e+02 -1.130887e-01 0.000000e+00 0.000000e+00 1.000000e+00 3.779761e-03
P3: 7.188560e+02 0.000000e+00 6.071928e+02 -3.372877e+02 0.000000e+00 7.188560e+02 1.852157e+02 2.369057e+00 0.000000e+00 0.000000e+00 1.000000e+00 4.915215e-03
Tr: 4.276802385584e-04 -9.999672484946e-01 -8.084491683471e-03 -1.198459927713e-02 -7.210626507497e-03 8.081198471645e-03 -9.999413164504e-01 -5.403984729748e-02 9.999738645903e-01 4.859485810390e-04 -7.206933692422e-03 -2.921968648686e-01
";
const POSES: &str = "1 0 0 0 0 1 0 0 0 0 1 0
9.999978e-01 5.272628e-04 -2.066935e-03 -4.690294e-02 -5.296506e-04 9.999992e-01 -1.154865e-03 -2.839928e-02 2.066324e-03 1.155958e-03 9.999971e-01 8.586941e-01
9.999910e-01 1.048972e-03 -4.131348e-03 -9.374345e-02 -1.058514e-03 9.999968e-01 -2.308104e-03 -5.676064e-02 4.128913e-03 2.312456e-03 9.999887e-01 1.716275e+00
";

/// A name, a function that damages the sequence, and words of the error.
type Fault = (&'static str, Box<dyn Fn(&Path)>, &'static str);

/// Points of a sweep: the second and the fourth are not returns.
fn points() -> Vec<CloudPoint> {
    let at = |x: f32| CloudPoint { x, y: 0.0, z: 0.0, intensity: 0.5 };
    vec![at(9.0), CloudPoint::default(), at(8.0), at(0.05), at(7.0)]
}

/// The instance is the hundreds of the class.
fn labels(classes: &[u16]) -> Vec<u8> {
    let label = |&class: &u16| Label { class, instance: class / 100 };
    bytes_from_labels(&classes.iter().map(label).collect::<Vec<_>>())
}

/// Three sweeps, images, poses and labels.
fn sequence(folder: &TempDir) -> PathBuf {
    let root = folder.path().join("dataset");
    let sequence = root.join("sequences/00");
    write_file(&sequence.join("calib.txt"), CALIB);
    write_file(&sequence.join("times.txt"), "0.000000e+00\n1.037359e-01\n2.073343e-01\n");
    write_file(&root.join("poses/00.txt"), POSES);
    for k in 0..3 {
        write_file(&sequence.join(format!("velodyne/{k:06}.bin")), bin_from_points(&points()));
        write_file(&sequence.join(format!("image_2/{k:06}.png")), png(1241, 376));
    }
    sequence
}

fn imported(import: &Import) -> (Vec<String>, Drive) {
    let report = import.run().expect("imports");
    (report, Drive::open(&import.out).expect("opens"))
}

#[test]
fn images_and_poses_of_kitti_odometry_are_imported() {
    let folder = folder();
    let (report, drive) = imported(&import_from(sequence(&folder), &folder));
    assert_eq!(report[2], "imported: 3 images of camera image_2", "{report:?}");
    assert!(report[3].starts_with("imported: 3 true poses of ") && report[3].ends_with("poses/00.txt"), "{report:?}");
    assert_eq!(report.len(), 4, "nothing is left: {report:?}");
    let stamps: Vec<i64> = drive.camera_frames().iter().map(|frame| frame.stamp.0).collect();
    assert_eq!(stamps, [0, 103_735_900, 207_334_300]);

    // P2 Tr p, as in the devkit.
    let p = Point3::new(15.0, -4.0, 0.5);
    let camera = &drive.rig().cameras[0];
    let pixel = camera.model.pixel_from_camera(&(camera.body_from_camera.inverse() * p)).expect("is inside");
    let in_rectified = tr() * p;
    let [u, v, w] = [
        718.8560 * in_rectified.x + 607.1928 * in_rectified.z + 45.382_25,
        718.8560 * in_rectified.y + 185.2157 * in_rectified.z - 0.113_088_7,
        in_rectified.z + 3.779_761e-3,
    ];
    assert!((pixel.x - u / w).abs() < 0.01 && (pixel.y - v / w).abs() < 0.01, "{pixel:?}: {u} {v} {w}");
    assert_eq!(camera.model.size(), (1241, 376));
}

fn tr() -> Pose {
    let line = CALIB.lines().find_map(|line| line.strip_prefix("Tr: ")).expect("is there");
    poses_from_kitti(line).expect("parses")[0]
}

/// A static point has the same world coordinates from all poses: its coordinates in the first LiDAR frame.
#[test]
fn true_poses_of_kitti_odometry_are_those_of_the_lidar() {
    let folder = folder();
    let (_, drive) = imported(&import_from(sequence(&folder), &folder));
    let truth = drive.true_trajectory().expect("has one").expect("reads");
    let cameras = poses_from_kitti(POSES).expect("parses");
    let still = Point3::new(20.0, 5.0, 1.0);
    for ((_, world_from_lidar), first_from_camera) in truth.poses().iter().zip(&cameras) {
        let in_camera = first_from_camera.inverse() * (tr() * still);
        let in_lidar = tr().inverse() * in_camera;
        assert!((world_from_lidar * in_lidar - still).norm() < 1e-9);
    }
    // The vehicle drives forward: x of the LiDAR.
    let moved = truth.poses()[2].1.translation.vector;
    assert!(moved.x > 1.7 && moved.y.abs() < 0.15 && moved.z.abs() < 0.1, "{moved:?}");
}

#[test]
fn labels_of_semantic_kitti_become_true_classes_of_the_returns() {
    let folder = folder();
    let sequence = sequence(&folder);
    write_file(&sequence.join("labels/000001.label"), labels(&[10, 40, 252, 70, 80]));
    write_file(&sequence.join("labels/000002.label"), labels(&[254, 40, 99, 99, 48]));
    let (report, drive) = imported(&import_from(sequence, &folder));
    assert!(report.contains(&"imported: 2 label files, in the classes of this project".to_owned()), "{report:?}");
    let bytes = |seq: usize| std::fs::read(drive.folder().join(format!("truth/labels/{seq:06}.label"))).expect("reads");
    let classes = |seq: usize| -> Vec<(u16, u16)> {
        labels_from_bytes(&bytes(seq)).expect("reads").iter().map(|label| (label.class, label.instance)).collect()
    };
    let of_class = |class: ClassId, instance: u16| (class as u16, instance);
    // The moving car has the class of a car and keeps its instance; points that are not returns have no label.
    assert_eq!(
        classes(1),
        [of_class(ClassId::Vehicles, 0), of_class(ClassId::Vehicles, 2), of_class(ClassId::Pole, 0)]
    );
    assert_eq!(
        classes(2),
        [of_class(ClassId::Pedestrian, 2), of_class(ClassId::Unlabeled, 0), of_class(ClassId::Sidewalk, 0)]
    );
    assert_eq!(first_label(&drive, 0), Err(NoLabel::NoSweep), "the first sweep has no labels");
    assert_eq!(first_label(&drive, 1).map(|label| label.class), Ok(ClassId::Vehicles as u8));
    for seq in 1..3 {
        remove(&drive.folder().join(format!("truth/labels/{seq:06}.label")));
    }
    let problem = drive.true_labels().expect_err("has no labels").to_string();
    assert!(problem.contains("truth/labels: contains no label file"), "{problem}");
}

#[test]
fn poses_beside_the_labels_are_used_without_those_of_the_data_set() {
    let folder = folder();
    let sequence = sequence(&folder);
    std::fs::rename(folder.path().join("dataset/poses/00.txt"), sequence.join("poses.txt")).expect("moves");
    let (report, drive) = imported(&import_from(sequence, &folder));
    assert!(report[3].ends_with("sequences/00/poses.txt"), "{report:?}");
    assert_eq!(drive.true_trajectory().expect("has one").expect("reads").poses().len(), 3);
}

#[test]
fn damaged_kitti_odometry_is_refused_with_file_and_rule() {
    let cut = |text: &str| text.lines().take(2).collect::<Vec<_>>().join("\n");
    let faults: [Fault; 9] = [
        (
            "no calibration",
            Box::new(|s| remove(&s.join("calib.txt"))),
            "calib.txt: is absent; images and poses need it",
        ),
        (
            "no Tr",
            Box::new(|s| write_file(&s.join("calib.txt"), CALIB.replace("Tr:", "Trr:"))),
            "calib.txt: has no line Tr:",
        ),
        (
            "skew",
            Box::new(|s| {
                write_file(&s.join("calib.txt"), CALIB.replace("P2: 7.188560e+02 0.000000e+00", "P2: 7.188560e+02 1"));
            }),
            "calib.txt:3: P2 must be the projection of a rectified camera",
        ),
        ("poses", Box::new(move |s| write_file(&s.join("../../poses/00.txt"), cut(POSES))), "00.txt: 2 poses, but"),
        (
            "cut pose",
            Box::new(|s| write_file(&s.join("../../poses/00.txt"), "1 0 0 0\n")),
            "00.txt: line 1: 4 numbers, expected 12",
        ),
        ("images", Box::new(|s| write_file(&s.join("image_2/000003.png"), "")), "000003.png: has number 3, but"),
        (
            "label count",
            Box::new(|s| write_file(&s.join("labels/000001.label"), [0; 16])),
            "000001.label: 4 labels, but",
        ),
        (
            "label id",
            Box::new(|s| write_file(&s.join("labels/000001.label"), labels(&[7; 5]))),
            "000001.label: label 0 has id 7, which",
        ),
        (
            "label sweep",
            Box::new(|s| write_file(&s.join("labels/000009.label"), [0; 16])),
            "000009.label: there is no sweep with number 9",
        ),
    ];
    for (name, damage, rule) in faults {
        let folder = folder();
        let sequence = sequence(&folder);
        damage(&sequence);
        let text = error(&import_from(sequence, &folder));
        assert!(text.contains(rule), "{name}: {text}");
    }
}

fn remove(path: &Path) {
    std::fs::remove_file(path).expect("removes");
}

/// Real sweeps and calibration; the published poses of the LiDAR give the poses of camera 0.
#[real_data::test("kitti00")]
fn real_sweeps_calibration_and_poses_become_a_drive() {
    let folder = folder();
    let root = folder.path().join("dataset");
    let sequence = root.join("sequences/00");
    let source = real_data::path("kitti00");
    let read = |name: &str| std::fs::read_to_string(source.join(name)).expect("reads");
    let poses = poses_from_kitti(&read("poses_00_velodyne_frame.txt")).expect("parses");
    write_file(&sequence.join("calib.txt"), read("calib_Tr_velo_to_cam0.txt"));
    write_file(&sequence.join("times.txt"), "0.0\n0.1\n");
    let mut text = String::new();
    for pose in &poses[94..96] {
        let camera = (tr() * pose * tr().inverse()).to_homogeneous();
        let numbers: Vec<String> = (0..12).map(|k| camera[(k / 4, k % 4)].to_string()).collect();
        text += &(numbers.join(" ") + "\n");
    }
    write_file(&root.join("poses/00.txt"), text);
    for k in 0..2 {
        let bytes = std::fs::read(source.join(format!("{:06}.bin", 94 + k))).expect("reads");
        write_file(&sequence.join(format!("velodyne/{k:06}.bin")), bytes);
    }
    let (_, drive) = imported(&import_from(sequence, &folder));
    let truth = drive.true_trajectory().expect("has one").expect("reads");
    let first = truth.poses()[0].1;
    let second = truth.poses()[1].1;
    let expected = poses[94].inverse() * poses[95];
    assert!(((first.inverse() * second).translation.vector - expected.translation.vector).norm() < 1e-6);
}
