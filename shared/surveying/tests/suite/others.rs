//! Path, objects, clouds for CloudCompare, sweeps for training.

use crate::support::{BEGIN_S, street, utm, write_run};
use formats::kitti::{labels_from_bytes, points_from_bin};
use formats::ply::{Kind, Vertices};
use formats::trajectory::{poses_from_kitti, trajectory_from_tum};
use std::path::{Path, PathBuf};
use surveying::objects::write_objects;
use surveying::{RunFolder, TargetFrame, write_cloudcompare, write_semantic_kitti, write_trajectory};

/// A run of two clouds and a folder for deliveries.
fn prepare(folder: &Path) -> (PathBuf, PathBuf) {
    let run = folder.join("run");
    let out = folder.join("out");
    std::fs::create_dir(&out).expect("made");
    write_run(&run, &[(street(600), true), (street(400), true)]);
    (run, out)
}

#[test]
fn path_is_in_coordinates_of_the_delivery_and_turned_to_grid_north() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, out) = prepare(folder.path());
    let run = RunFolder::open(&run).expect("opens");
    let frame = utm(run.georeference.as_ref().expect("is placed"));
    let files = write_trajectory(&run, &frame, &out).expect("writes");
    assert_eq!(files.len(), 6);
    let text = std::fs::read_to_string(out.join("trajectory.txt")).expect("was written");
    let found = trajectory_from_tum(&text).expect("parses");
    for ((stamp, pose), (expected_stamp, expected)) in found.poses().iter().zip(run.trajectory.poses()) {
        let xyz = frame.from_cloud(expected.translation.vector.into()).expect("converts");
        assert_eq!(stamp, expected_stamp);
        assert!((pose.translation.vector - geometry::Vector3::from(xyz)).norm() < 1e-6);
        // Grid north is 0.492 degrees counter-clockwise of true north at the Pantheon.
        let (_, _, yaw) = pose.rotation.euler_angles();
        assert!((yaw.to_degrees() + 0.492).abs() < 1e-3, "{}", yaw.to_degrees());
    }
    let kitti = poses_from_kitti(&std::fs::read_to_string(out.join("trajectory_kitti.txt")).expect("was written"));
    assert_eq!(kitti.expect("parses").len(), 40);
    assert_eq!(std::fs::read(out.join("trajectory.sbet")).expect("was written").len(), 40 * 136);

    let local = TargetFrame::local(run.georeference.as_ref());
    let elsewhere = folder.path().join("local");
    std::fs::create_dir(&elsewhere).expect("made");
    assert_eq!(write_trajectory(&run, &local, &elsewhere).expect("writes").len(), 4, "nothing about the Earth");
    let text = std::fs::read_to_string(elsewhere.join("trajectory.txt")).expect("was written");
    let found = trajectory_from_tum(&text).expect("parses");
    for ((_, pose), (_, expected)) in found.poses().iter().zip(run.trajectory.poses()) {
        assert!((pose.translation.vector - expected.translation.vector).norm() < 1e-9);
        assert!(pose.rotation.angle_to(&expected.rotation) < 1e-7);
    }
}

#[test]
fn objects_have_scores_and_places_on_the_earth() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, out) = prepare(folder.path());
    let run = RunFolder::open(&run).expect("opens");
    let frame = utm(run.georeference.as_ref().expect("is placed"));
    assert_eq!(write_objects(&run, &frame, &out).expect("writes"), Some(3));
    let table = std::fs::read_to_string(out.join("objects.csv")).expect("was written");
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0][11], "score");
    assert_eq!((rows[1][0], rows[1][3], rows[1][11]), ("1", "2", "0.784"));
    let easting: f64 = rows[1][4].parse().expect("a number");
    assert!((easting - 452_048.0).abs() < 100.0, "{table}");
    let geojson: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("objects.geojson")).expect("was written")).expect("JSON");
    assert_eq!(geojson["features"].as_array().map(Vec::len), Some(3));
}

/// Longitudes of all positions of a geometry.
fn longitudes(value: &serde_json::Value) -> Vec<f64> {
    match value.as_array().map(Vec::as_slice) {
        Some([lon, lat, _]) if lon.is_number() && lat.is_number() => vec![lon.as_f64().expect("a number")],
        Some(parts) => parts.iter().flat_map(longitudes).collect(),
        None => Vec::new(),
    }
}

#[test]
fn path_and_footprints_are_cut_at_the_antimeridian() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, out) = prepare(folder.path());
    let georeference = r#"{"frame":"local east-north-up","trajectory_frame":"local east-north-up",
        "origin":{"latitude_deg":-16.8,"longitude_deg":179.99999,"altitude_m":10.0}}"#;
    std::fs::write(run.join("georeference.json"), georeference).expect("writes");
    let run = RunFolder::open(&run).expect("opens");
    let frame = utm(run.georeference.as_ref().expect("is placed"));
    write_trajectory(&run, &frame, &out).expect("writes");
    write_objects(&run, &frame, &out).expect("writes");
    let read = |name: &str| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(out.join(name)).expect("was written")).expect("JSON")
    };
    let path = &read("trajectory.geojson")["features"][0]["geometry"];
    assert_eq!(path["type"], "MultiLineString");
    let parts: Vec<Vec<f64>> = path["coordinates"].as_array().expect("parts").iter().map(longitudes).collect();
    assert_eq!(parts.len(), 2);
    assert!(parts[0].iter().all(|lon| (179.9..=180.0).contains(lon)) && parts[0].last() == Some(&180.0), "{parts:?}");
    assert!(parts[1].iter().all(|lon| (-180.0..=-179.9).contains(lon)) && parts[1][0] == -180.0, "{parts:?}");
    assert_eq!(parts.iter().map(Vec::len).sum::<usize>(), 40 + 2);
    for feature in read("objects.geojson")["features"].as_array().expect("a list") {
        let geometry = &feature["geometry"];
        assert_eq!(geometry["type"], "MultiPolygon");
        for polygon in geometry["coordinates"].as_array().expect("polygons") {
            let found = longitudes(polygon);
            assert!(found.iter().all(|lon| *lon > 0.0) || found.iter().all(|lon| *lon < 0.0), "{found:?}");
        }
    }
    // The other files have no jump.
    let text = std::fs::read_to_string(out.join("trajectory.txt")).expect("was written");
    let poses = trajectory_from_tum(&text).expect("parses");
    assert!((poses.length_m() - 39.0).abs() < 0.1, "{}", poses.length_m());
}

#[test]
fn fields_for_cloudcompare_are_floats_with_relative_times() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, out) = prepare(folder.path());
    let run = RunFolder::open(&run).expect("opens");
    let frame = utm(run.georeference.as_ref().expect("is placed"));
    let files = write_cloudcompare(&run, &frame, false, &out).expect("writes");
    assert_eq!(files, ["submap_0000.ply", "submap_0001.ply"]);
    let cloud = Vertices::load(&out.join(&files[1])).expect("loads");
    let scalars = || cloud.properties().iter().filter(|property| property.name.starts_with("scalar_"));
    assert!(scalars().count() >= 9 && scalars().all(|property| property.kind == Kind::Float));
    assert!(cloud.infos().iter().any(|info| info.starts_with(&format!("scalar_time s since {BEGIN_S}.000000000 s"))));
    let times = cloud.f64s("scalar_time").expect("is there");
    assert!((times[100] - 1.001).abs() < 1e-6, "{}", times[100]);
    let x = cloud.f64s("x").expect("is there");
    let classes = cloud.u8s("scalar_class").expect("is there");
    for (i, (xyz, class)) in street(400).iter().enumerate() {
        let expected = frame.from_cloud(*xyz).expect("converts");
        assert!((x[i] - expected[0]).abs() < 1e-5 && classes[i] == *class);
    }
}

#[test]
fn sweeps_and_poses_give_the_points_of_the_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, out) = prepare(folder.path());
    let run = RunFolder::open(&run).expect("opens");
    // 50 points a sweep.
    assert_eq!(write_semantic_kitti(&run, &out).expect("writes"), 12 + 8);
    let poses =
        poses_from_kitti(&std::fs::read_to_string(out.join("poses.txt")).expect("was written")).expect("parses");
    assert_eq!(poses.len(), 20);
    let all = [street(600), street(400)].concat();
    let origin = all[0].0;
    for (number, pose) in poses.iter().enumerate() {
        let read = |folder: &str, extension: &str| {
            std::fs::read(out.join(format!("{folder}/{number:06}.{extension}"))).expect("was written")
        };
        let points = points_from_bin(&read("velodyne", "bin")).expect("decodes");
        let labels = labels_from_bytes(&read("labels", "label")).expect("decodes");
        for (k, (point, label)) in points.iter().zip(&labels).enumerate() {
            let (xyz, class) = all[number * 50 + k];
            // The first frame is at the LiDAR at the first shot, level and facing east like the path.
            let place = pose * geometry::Point3::new(point.x, point.y, point.z).cast::<f64>();
            let expected = [xyz[0] - origin[0], xyz[1], xyz[2] - 1.5];
            assert!((place - geometry::Point3::from(expected)).norm() < 1e-4, "{number} {k}: {place}");
            assert_eq!(label.class, if class == 7 { 40 } else { 50 });
        }
    }
}
