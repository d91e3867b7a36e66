//! No reader panics or hangs on damaged bytes.

use damage::attack;
use drive::imu::{ImuReader, ImuSample, csv_from_samples};
use drive::{Drive, returns_from_cloud};
use formats::cloud::CloudPoint;
use formats::pcd::{pcd_from_points, points_from_pcd};
use geometry::Stamp;
use lidar::velodyne::Model;
use std::path::Path;

#[test]
fn damaged_manifests_do_not_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "version = 1\nname = \"x\"\n[lidar]\nmodel = \"hdl64e\"\nformat = \"bin\"\nfolder = \"lidar\"\n\
                body_from_lidar = { translation = [0, 0, 1.9], rotation = [0, 0, 0, 1] }\n\
                [[camera]]\nname = \"front\"\nfolder = \"camera\"\nexposure_nanos = 5000000\n\
                body_from_camera = { translation = [0, 0, 1], rotation = [0, 0, 0, 1] }\n\
                model = { kind = \"pinhole\", width = 64, height = 48, fx = 60, fy = 60, cx = 32, cy = 24 }\n";
    std::fs::create_dir_all(folder.path().join("lidar")).expect("makes");
    std::fs::create_dir_all(folder.path().join("camera")).expect("makes");
    std::fs::write(folder.path().join("lidar/0.bin"), [0; 16]).expect("writes");
    let open = |folder: &Path, bytes: &[u8]| {
        std::fs::write(folder.join("drive.toml"), bytes).expect("writes");
        Drive::open(folder)
    };
    open(folder.path(), text.as_bytes()).expect("is valid");
    attack(11, 2000, text.as_bytes(), |bytes| {
        if let Err(error) = open(folder.path(), bytes) {
            assert!(!error.problems.is_empty() && error.to_string().contains("drive.toml"));
        }
    });
}

#[test]
fn manifest_with_many_problems_is_refused_with_the_first_ones() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("drive.toml");
    let keys = (0..50_000).map(|k| format!("key_{k} = 1\n")).collect::<Vec<_>>().concat();
    let cameras = "[[camera]]\nname = 1\n".repeat(40_000);
    for text in [keys, cameras] {
        std::fs::write(&path, text).expect("writes");
        let error = Drive::open(folder.path()).expect_err("refused");
        assert!(error.problems.len() <= 21, "{} problems", error.problems.len());
        assert!(error.to_string().ends_with("further problems"), "{error}");
    }
    std::fs::write(&path, "# \n".repeat(400_000)).expect("writes");
    let error = Drive::open(folder.path()).expect_err("refused").to_string();
    assert!(error.contains("drive.toml: cannot read the file: has more than 1048576 bytes"), "{error}");
}

#[test]
fn damaged_imu_samples_do_not_panic() {
    let sample = |i: i64| ImuSample { stamp: Stamp(i), acceleration: [0.0, 1.0, 9.81], angular_rate: [0.1; 3] };
    let csv = csv_from_samples(&(0..20).map(sample).collect::<Vec<_>>());
    attack(6, 5000, csv.as_bytes(), |bytes| {
        let samples: Vec<ImuSample> = ImuReader::new(bytes).filter_map(Result::ok).collect();
        assert!(samples.windows(2).all(|pair| pair[0].stamp < pair[1].stamp));
    });
}

#[test]
fn damaged_clouds_do_not_panic() {
    let points: Vec<CloudPoint> = (0..100).map(|i| CloudPoint { x: i as f32, ..CloudPoint::default() }).collect();
    let pcd = pcd_from_points(&points);
    let ascii = b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 3\nDATA ascii\n1 2 3\n4 5 6\n7 8 9\n";
    for (seed, bytes) in [(7, &pcd[..]), (8, &ascii[..])] {
        attack(seed, 5000, bytes, |bytes| {
            if let Ok(points) = points_from_pcd(bytes) {
                let found = returns_from_cloud(&points, &Model::Hdl64e.into());
                assert!(found.iter().all(|one| one.azimuth < 36_000 && one.ring < 64 && one.x.is_finite()));
            }
        });
    }
}
