//! Places of a simulated town that are passed twice, the same way and the other way, and places that only look alike.
#![allow(clippy::unwrap_used, reason = "tests fail by panicking")]

use geometry::{Isometry3, Pose, UnitQuaternion, Vector3};
use pose_graph::{Keyframe, LoopFinder, LoopSettings};
use registration::{MapPoint, thinned};
use simulation::trace::Ray;
use simulation::{DriveSpec, Simulation};
use std::sync::LazyLock;

/// One round of a town with some way more.
static TOWN: LazyLock<Simulation> = LazyLock::new(|| Simulation::new(&DriveSpec::urban(31, 300.0).sparse(4)).unwrap());

fn noise_m(seed: u64) -> f64 {
    let z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let even = ((z ^ (z >> 27)) >> 11) as f64 / (1_u64 << 53) as f64;
    0.06 * (even - 0.5)
}

/// What an odometry would have in its map after the 30 m before `seconds`, in the world's axes; `side` turns and shifts the
/// vehicle in its lane. Surfaces are those that rays of a lidar meet, with 2 cm of noise.
fn map(seconds: f64, side: &Pose) -> Vec<MapPoint> {
    let mut points = Vec::new();
    for k in 0..12_u64 {
        let at = seconds - 4.0 + k as f64 * 4.0 / 11.0;
        let pose = TOWN.motion.pose(at) * side * Isometry3::translation(0.0, 0.0, 1.0);
        let snapshot = TOWN.scene.at(at);
        for step in 0..5760_u64 {
            let azimuth = (step % 288) as f64 / 288.0 * std::f64::consts::TAU + k as f64 * 0.003;
            let elevation = ((step / 288) as f64 * 2.4 - 28.0).to_radians();
            let (sin, cos) = azimuth.sin_cos();
            let direction = pose.rotation * Vector3::new(cos * elevation.cos(), sin * elevation.cos(), elevation.sin());
            let seed = k << 32 | step;
            let ray = Ray { origin: pose.translation.vector.cast(), direction: direction.cast(), seed };
            let Some(hit) = TOWN.scene.cast(&snapshot, &ray, 60.0) else { continue };
            let position = pose.translation.vector + direction * (f64::from(hit.range_m) + noise_m(seed));
            points.push(MapPoint { position: position.into(), normal: hit.normal.into(), batch: 0 });
        }
    }
    let kept = thinned(points.iter().map(|p| p.position.map(|v| v as f32)), 0.2);
    kept.into_iter().map(|k| points[k]).collect()
}

fn heading(pose: &Pose) -> UnitQuaternion<f64> {
    let forward = pose.rotation * Vector3::x();
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), forward.y.atan2(forward.x))
}

/// The keyframe of a time, and the true place of its submap. `drift` is how far off the odometry is by now.
fn keyframe(number: usize, seconds: f64, side: &Pose, drift: &Pose) -> (Keyframe, Pose) {
    let world_from_body = TOWN.motion.pose(seconds) * side;
    let begin = TOWN.motion.pose(seconds - 2.0) * side;
    let world_from_submap = Isometry3::from_parts(begin.translation, heading(&begin));
    let moved = |point: &MapPoint| MapPoint {
        position: (drift * geometry::Point3::from(point.position)).coords.into(),
        normal: (drift.rotation.cast::<f32>() * Vector3::from(point.normal)).into(),
        batch: 0,
    };
    let points: Vec<MapPoint> = map(seconds, side).iter().map(moved).collect();
    let way_m = TOWN.motion.length_m(seconds);
    let frame = Keyframe::new(number, way_m, &points, &(drift * world_from_submap), &(drift * world_from_body));
    (frame, world_from_submap)
}

/// Seconds, somewhat past a whole round, at which the vehicle is again where it was.
fn again(seconds: f64) -> f64 {
    let place = TOWN.motion.pose(seconds).translation.vector;
    let off = |at: f64| (TOWN.motion.pose(at).translation.vector - place).norm();
    let times = (0..3000).map(|k| f64::from(k) * 0.1).filter(|at| *at > seconds + 100.0);
    let best = times.min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap();
    assert!(off(best) < 2.0, "the drive closes no loop: {} m", off(best));
    best
}

fn assert_found(source: &(Keyframe, Pose), targets: &[(Keyframe, Pose)], expected: usize, what: &str) {
    let earlier: Vec<Keyframe> = targets.iter().map(|(keyframe, _)| keyframe.clone()).collect();
    let closed = LoopFinder::default().find(&source.0, &earlier).unwrap_or_else(|| panic!("{what}: not found"));
    assert_eq!(closed.relative.target, expected, "{what}: {closed:?}");
    let truth = targets[expected].1.inv_mul(&source.1);
    let off = truth.inv_mul(&closed.relative.target_from_source);
    let (m, rad) = (off.translation.vector.norm(), off.rotation.angle());
    assert!(m < 0.08 && rad < 0.004, "{what}: {m} m and {rad} rad off, {closed:?}");
}

#[test]
fn a_place_is_found_again_in_spite_of_drift_and_told_from_others() {
    // Streets of the round, 15 s apart; the third is where the loop closes.
    let still = Pose::identity();
    let targets: Vec<(Keyframe, Pose)> = (0..4).map(|k| keyframe(k, 14.0 + 12.0 * k as f64, &still, &still)).collect();
    let drift = Isometry3::new(Vector3::new(8.0, -6.0, 2.5), Vector3::new(0.01, -0.01, 0.05));
    // Ten metres before the place of the first visit: as far off as keyframes can lie.
    let seconds = again(38.0 - 1.0);
    let same_way = keyframe(9, seconds, &still, &drift);
    assert_found(&same_way, &targets, 2, "the same way");
    // Back on the other side of the road.
    let around = Isometry3::new(Vector3::new(0.0, 4.0, 0.0), Vector3::z() * std::f64::consts::PI);
    let other_way = keyframe(9, seconds + 2.0, &around, &drift);
    assert_found(&other_way, &targets, 2, "the other way");
    // Without that place among them none of the others will do, however far the odometry may have drifted.
    let others: Vec<Keyframe> =
        targets.iter().map(|(keyframe, _)| keyframe.clone()).filter(|k| k.submap != 2).collect();
    let anywhere = LoopSettings { reach_m: 10_000.0, ..LoopSettings::default() };
    for (what, (source, _)) in [("the same way", &same_way), ("the other way", &other_way)] {
        assert_eq!(LoopFinder::new(anywhere.clone()).find(source, &others), None, "{what}");
    }
    // And a place is not looked for on the way that leads to it.
    assert_eq!(LoopFinder::default().find(&targets[3].0, &others[..1]), None);
}

#[test]
fn a_saved_keyframe_is_the_same_and_small() {
    let (frame, _) = keyframe(3, 20.0, &Pose::identity(), &Pose::identity());
    assert!(frame.len() > 2000 && !frame.is_empty(), "{} points", frame.len());
    let bytes = postcard::to_stdvec(&frame).unwrap();
    assert!(bytes.len() < 100_000, "{} bytes", bytes.len());
    assert_eq!(postcard::from_bytes::<Keyframe>(&bytes).unwrap(), frame);
}
