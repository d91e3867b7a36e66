//! Clouds and trajectory are moved to the final frame by the placement of the submaps.

use crate::support::{Street, context, files};
use delivery::Index;
use export::{Coordinates, Export, Frame, Settings};
use formats::ply::Vertices;
use geometry::{Isometry3, Point3, Pose, Stamp, Vector3};
use messages::{FRAME_EAST_NORTH_UP, PlacementHeader, PlacementRow, PlacementTopic};
use stage::Stage;
use stage::testing::Bench;
use std::path::Path;

const COLUMNS: [&str; 4] = ["color", "spectra", "class", "instance"];
const N: u64 = 3;

/// Correction of each submap. It grows with the number, as after a loop closure.
fn world_from_odom(seq: u64) -> Pose {
    let more = seq as f64;
    Isometry3::new(
        Vector3::new(100.0 + 0.2 * more, -50.0, 3.0 - 0.1 * more),
        Vector3::new(0.01, 0.002 * more, 0.7 + 0.01 * more),
    )
}

fn odom_from_submap(street: &Street, seq: u64) -> Pose {
    street.header(seq).odom_from_submap.to_pose().expect("a pose")
}

fn send_placement(bench: &mut Bench<Export>, street: &Street) {
    let header = PlacementHeader {
        latitude_deg: 48.846_222,
        longitude_deg: 2.346_414,
        altitude_m: 104.6,
        frame: FRAME_EAST_NORTH_UP,
        n_loops: 2,
        n_fixes: 40,
        n_fixes_refused: 3,
        ..PlacementHeader::default()
    };
    let row = |seq: u64| PlacementRow {
        submap: seq,
        stamp: street.sweep_stamp(seq, 0),
        world_from_submap: (world_from_odom(seq) * odom_from_submap(street, seq)).into(),
        odom_from_submap: odom_from_submap(street, seq).into(),
        sigma_m: [0.1, 0.2, 0.3],
        sigma_rad: [0.01, 0.02, 0.03],
    };
    bench.send::<PlacementTopic>(street.sweep_stamp(0, 0), header, (0..N).map(row).collect());
}

/// Runs the drive up to its end.
fn driven(settings: &Settings, folder: &Path, street: &Street) -> Bench<Export> {
    let mut bench = Bench::<Export>::new(settings, &context(folder)).expect("starts");
    for seq in 0..N {
        street.send_submap(&mut bench, seq);
        street.send_columns(&mut bench, seq, &COLUMNS);
        bench.tick().expect("steps");
    }
    send_placement(&mut bench, street);
    bench.tick().expect("steps");
    bench
}

fn index(folder: &Path) -> Index {
    serde_json::from_slice(&std::fs::read(folder.join("clouds/index.json")).expect("is there")).expect("is an index")
}

fn xyz(cloud: &Vertices, names: [&str; 3], point: usize) -> Point3<f64> {
    names.map(|name| cloud.f64s(name).expect(name)[point]).into()
}

fn double(frame: Frame) -> Settings {
    Settings { coordinates: Coordinates::Double, frame, ..Settings::default() }
}

#[test]
fn placement_moves_points_trajectory_and_index() {
    let folder = tempfile::tempdir().expect("a folder");
    let street = Street::new(1, 3000);
    driven(&double(Frame::World), folder.path(), &street).finish().expect("finishes");
    let index = index(folder.path());
    assert!(index.frame.starts_with("local east-north-up around 48.846222 2.346414 104.6"), "{}", index.frame);
    for (seq, entry) in (0..N).zip(&index.clouds) {
        let path = folder.path().join(&entry.file);
        let cloud = Vertices::load(&path).expect("reads");
        assert!(cloud.infos().contains(&format!("frame {}", index.frame)));
        let points = street.points(seq);
        for k in (0..points.len()).step_by(271) {
            let point = &points[k];
            let in_odom = Point3::from(street.in_odom(seq, [point.x, point.y, point.z].map(f64::from)));
            let off = xyz(&cloud, ["x", "y", "z"], k) - world_from_odom(seq) * in_odom;
            assert!(off.norm() < 1e-9, "point {k} of submap {seq}: {off}");
            let lidar = world_from_odom(seq) * Point3::from(street.lidar(seq, point));
            let found = xyz(&cloud, ["x_lidar_position", "y_lidar_position", "z_lidar_position"], k);
            assert!((found - lidar).norm() < 1e-6, "lidar of point {k} of submap {seq}");
            assert_eq!(cloud.f64s("ring").expect("is there")[k], f64::from(point.ring), "other columns are unchanged");
        }
        let spectra = Vertices::load(&folder.path().join(&entry.spectra.as_ref().expect("has").file)).expect("reads");
        let row = spectra.i64s("point_idx").expect("is there")[7] as usize;
        assert_eq!(xyz(&spectra, ["x", "y", "z"], 7), xyz(&cloud, ["x", "y", "z"], row));
        let all = |name| cloud.f64s(name).expect("is there");
        let least = |name| all(name).into_iter().fold(f64::MAX, f64::min);
        let lowest = Point3::from(entry.bounds.expect("has points")[0]);
        assert!((lowest - Point3::from(["x", "y", "z"].map(least))).norm() < 1e-9);
        assert_eq!(std::fs::metadata(&path).expect("is there").len(), entry.bytes);
        let expected = world_from_odom(seq) * odom_from_submap(&street, seq);
        assert!((Vector3::from(entry.translation) - expected.translation.vector).norm() < 1e-12);
        assert_eq!((entry.sigma_m, entry.sigma_rad), (Some([0.1, 0.2, 0.3]), Some([0.01, 0.02, 0.03])));
    }
    let text = std::fs::read_to_string(folder.path().join("trajectory.txt")).expect("is there");
    let trajectory = formats::trajectory::trajectory_from_tum(&text).expect("parses");
    for seq in 0..N {
        let row = street.poses(seq)[0];
        let expected = world_from_odom(seq) * row.odom_from_body.to_pose().expect("a pose");
        let off = trajectory.at(Stamp(row.stamp)).expect("there").translation.vector - expected.translation.vector;
        assert!(off.norm() < 1e-6, "{off}");
    }
    let text = std::fs::read_to_string(folder.path().join("georeference.json")).expect("is there");
    let georeference: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(georeference["utm"]["epsg"], 32_631);
    assert_eq!((&georeference["closed_loops"]["used"], &georeference["fixes"]["refused"]), (&2.into(), &3.into()));
    // Meridian convergence by PROJ: the origin is west of the central meridian of zone 31, so grid north is west of true north.
    let convergence = georeference["utm"]["convergence_deg"].as_f64().expect("a number");
    assert!((convergence + 0.4921).abs() < 1e-3, "{convergence}");
}

#[test]
fn run_killed_while_clouds_are_moved_ends_with_equal_files() {
    let street = Street::new(2, 2000);
    let undisturbed = tempfile::tempdir().expect("a folder");
    driven(&Settings::default(), undisturbed.path(), &street).finish().expect("finishes");
    let expected = files(undisturbed.path());
    for n_moved in 0..=2 * N as usize {
        let folder = tempfile::tempdir().expect("a folder");
        let mut bench = driven(&Settings::default(), folder.path(), &street);
        let state = bench.stage.save().expect("saves").to_vec();
        let before = files(folder.path());
        bench.finish().expect("finishes");
        // State after a crash: `n_moved` clouds were moved, the others were not, and the last file is missing.
        for (name, bytes) in before.iter().skip(n_moved) {
            std::fs::write(folder.path().join(name), bytes).expect("writes");
        }
        std::fs::remove_file(folder.path().join("georeference.json")).expect("removes");
        let mut again = Bench::<Export>::new(&Settings::default(), &context(folder.path())).expect("starts");
        again.stage.load(&state).expect("loads");
        again.finish().expect("finishes");
        let found = files(folder.path());
        assert!(found == expected, "{n_moved} clouds had been moved");
    }
}

#[test]
fn cloud_written_in_the_final_frame_equals_moved_cloud() {
    let street = Street::new(2, 2000);
    let moved = tempfile::tempdir().expect("a folder");
    driven(&Settings::default(), moved.path(), &street).finish().expect("finishes");
    let at_once = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::<Export>::new(&Settings::default(), &context(at_once.path())).expect("starts");
    for seq in 0..N {
        street.send_submap(&mut bench, seq);
        street.send_columns(&mut bench, seq, &COLUMNS);
        if seq == 0 {
            bench.tick().expect("steps");
        }
    }
    // The other submaps arrive in the same tick as the placement.
    send_placement(&mut bench, &street);
    bench.tick().expect("steps");
    let cloud =
        |folder: &Path, seq: u64| std::fs::read(folder.join(format!("clouds/submap_{seq:04}.ply"))).expect("reads");
    assert_ne!(cloud(at_once.path(), 0), cloud(moved.path(), 0), "the first is not moved yet");
    assert_eq!(cloud(at_once.path(), 1), cloud(moved.path(), 1), "the second was written in the final frame");
    // Clouds in the final frame survive a restart.
    let state = bench.stage.save().expect("saves").to_vec();
    let mut again = Bench::<Export>::new(&Settings::default(), &context(at_once.path())).expect("starts");
    again.stage.load(&state).expect("loads");
    again.finish().expect("finishes");
    assert!(files(at_once.path()) == files(moved.path()), "all files are the same");
}

#[test]
fn utm_coordinates_equal_proj() {
    let folder = tempfile::tempdir().expect("a folder");
    let street = Street::new(3, 500);
    driven(&double(Frame::Utm), folder.path(), &street).finish().expect("finishes");
    let local = tempfile::tempdir().expect("a folder");
    driven(&double(Frame::World), local.path(), &street).finish().expect("finishes");
    let file = "clouds/submap_0002.ply";
    let on_map = Vertices::load(&folder.path().join(file)).expect("reads");
    let in_world = Vertices::load(&local.path().join(file)).expect("reads");
    assert!(on_map.infos().contains(&"crs EPSG:32631".to_owned()), "{:?}", on_map.infos());
    // Near the origin UTM is a rotation by the convergence and a scale of 0.9996. PROJ 9.5.1 gives the same 120 m east and 340 m
    // south of the origin.
    let origin = Vector3::<f64>::new(452_048.210_29, 5_410_567.173_59, 104.6);
    let known = Vector3::new(452_165.737_7, 5_410_226.034_09, 112.360_22) - origin;
    let east = Vector3::<f64>::new(120.5, -340.25, 0.0);
    let north = known;
    let turn = north.y.atan2(north.x) - east.y.atan2(east.x);
    let scale = north.xy().norm() / east.xy().norm();
    for k in (0..500).step_by(57) {
        let p = xyz(&in_world, ["x", "y", "z"], k);
        let (sin, cos) = turn.sin_cos();
        let expected = Vector3::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y, 0.0) * scale + origin;
        let found = xyz(&on_map, ["x", "y", "z"], k).coords;
        assert!((found.xy() - expected.xy()).norm() < 0.01, "{found} {expected}");
        assert!((found.z - 104.6 - p.z).abs() < 0.01);
    }
    let context = context(folder.path());
    let float = Settings { frame: Frame::Utm, ..Settings::default() };
    let problems = <Export>::check(&float, &context);
    assert!(problems.len() == 1 && problems[0].text.contains("half a metre"), "{problems:?}");
    assert!(<Export>::check(&double(Frame::Utm), &context).is_empty());
}

#[test]
fn odom_frame_keeps_clouds_unmoved() {
    let street = Street::new(4, 500);
    let kept = tempfile::tempdir().expect("a folder");
    driven(&double(Frame::Odom), kept.path(), &street).finish().expect("finishes");
    assert!(!kept.path().join("georeference.json").exists());
    assert_eq!(index(kept.path()).frame, "odometry, m");
    let cloud = Vertices::load(&kept.path().join("clouds/submap_0001.ply")).expect("reads");
    let point = &street.points(1)[5];
    let expected = Point3::from(street.in_odom(1, [point.x, point.y, point.z].map(f64::from)));
    assert!((xyz(&cloud, ["x", "y", "z"], 5) - expected).norm() < 1e-12);
}
