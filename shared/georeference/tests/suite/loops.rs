//! Places of a simulated town that are visited twice, in the same and in the opposite direction, and similar places.

use geometry::{Isometry3, Pose, Vector3};
use georeference::{Keyframe, LoopFinder, LoopSettings, Places};
use raytrace::Ray;
use registration::{MapPoint, thinned};
use simulation::{DriveSpec, Simulation};
use std::sync::LazyLock;

/// One round of a town and a bit more.
static TOWN: LazyLock<Simulation> = LazyLock::new(|| Simulation::new(&DriveSpec::urban(31, 300.0).sparse(4)).unwrap());

/// Uniform noise within 3 cm. It uses its own hash instead of `random`: with other noise the loop in the opposite
/// direction is not found.
fn noise_m(seed: u64) -> f64 {
    let z = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let uniform = ((z ^ (z >> 27)) >> 11) as f64 / (1_u64 << 53) as f64;
    0.06 * (uniform - 0.5)
}

/// The map of an odometry after the 30 m before `seconds`, in world axes. `side` rotates and shifts the vehicle in its
/// lane. Surfaces are at the hits of LiDAR rays, with 3 cm of noise.
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
            points.push(MapPoint {
                position: position.into(),
                normal: hit.normal.into(),
                lever: 0.0,
                turn_lever: 0.0,
                batch: 0,
            });
        }
    }
    let kept = thinned(points.iter().map(|p| p.position.map(|v| v as f32)), 0.2);
    kept.into_iter().map(|k| points[k]).collect()
}

/// The keyframe of a time, and the true pose of its submap. `drift` is the error of the odometry by then.
fn keyframe(number: usize, seconds: f64, side: &Pose, drift: &Pose) -> (Keyframe, Pose) {
    let world_from_body = TOWN.motion.pose(seconds) * side;
    let begin = TOWN.motion.pose(seconds - 2.0) * side;
    let world_from_submap = Isometry3::from_parts(begin.translation, geometry::heading(&begin.rotation));
    let moved = |point: &MapPoint| MapPoint {
        position: (drift * geometry::Point3::from(point.position)).coords.into(),
        normal: (drift.rotation.cast::<f32>() * Vector3::from(point.normal)).into(),
        lever: 0.0,
        turn_lever: 0.0,
        batch: 0,
    };
    let points: Vec<MapPoint> = map(seconds, side).iter().map(moved).collect();
    let path_m = TOWN.motion.distance_m(seconds);
    let frame = Keyframe::new(number, path_m, &points, &(drift * world_from_submap), &(drift * world_from_body));
    (frame, world_from_submap)
}

/// The time, about one round later, at which the vehicle is at the same place.
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
    let m = off.translation.vector.norm();
    let rad = off.rotation.angle();
    assert!(m < 0.08 && rad < 0.004, "{what}: {m} m and {rad} rad off, {closed:?}");
}

#[test]
fn place_visited_twice_is_found_despite_drift_and_distinguished_from_others() {
    // Streets of the round, 12 s apart; the loop closes at the third.
    let still = Pose::identity();
    let targets: Vec<(Keyframe, Pose)> = (0..4).map(|k| keyframe(k, 14.0 + 12.0 * k as f64, &still, &still)).collect();
    let drift = Isometry3::new(Vector3::new(8.0, -6.0, 2.5), Vector3::new(0.01, -0.01, 0.05));
    // Ten metres before the position of the first visit: the largest distance of keyframes.
    let seconds = again(38.0 - 1.0);
    let same_direction = keyframe(9, seconds, &still, &drift);
    assert_found(&same_direction, &targets, 2, "same direction");
    // Back on the other side of the road.
    let around = Isometry3::new(Vector3::new(0.0, 4.0, 0.0), Vector3::z() * std::f64::consts::PI);
    let opposite_direction = keyframe(9, seconds + 2.0, &around, &drift);
    assert_found(&opposite_direction, &targets, 2, "opposite direction");
    // Without that place no other place matches, regardless of the search radius.
    let others: Vec<Keyframe> =
        targets.iter().map(|(keyframe, _)| keyframe.clone()).filter(|k| k.submap != 2).collect();
    let anywhere = LoopSettings { radius_m: 10_000.0, ..LoopSettings::default() };
    for (what, (source, _)) in [("same direction", &same_direction), ("opposite direction", &opposite_direction)] {
        assert_eq!(LoopFinder::new(anywhere.clone()).find(source, &others), None, "{what}");
    }
    // Places on the last 150 m of the path are not searched.
    assert_eq!(LoopFinder::default().find(&targets[3].0, &others[..1]), None);
}

#[test]
fn saved_keyframe_is_identical_and_below_100_kb() {
    let (frame, _) = keyframe(3, 20.0, &Pose::identity(), &Pose::identity());
    assert!(frame.len() > 2000 && !frame.is_empty(), "{} points", frame.len());
    let bytes = postcard::to_stdvec(&frame).unwrap();
    assert!(bytes.len() < 100_000, "{} bytes", bytes.len());
    assert_eq!(postcard::from_bytes::<Keyframe>(&bytes).unwrap(), frame);
}

#[test]
fn place_that_is_visited_again_and_again_is_kept_once() {
    let still = Pose::identity();
    let seconds = [14.0, 26.0, 38.0];
    let frames: Vec<Keyframe> =
        seconds.iter().enumerate().map(|(k, seconds)| keyframe(k, *seconds, &still, &still).0).collect();
    let mut places = Places::default();
    let finder = LoopFinder::default();
    for round in 0..6 {
        for (k, frame) in frames.iter().enumerate() {
            let mut visit = frame.clone();
            visit.submap = round * frames.len() + k;
            visit.path_m += 2000.0 * round as f64;
            let closure = places.visit(visit, &finder, 1000);
            let target = closure.map(|closure| closure.relative.target);
            let expected = round.checked_sub(1).map(|before| before * frames.len() + k);
            assert_eq!(target, expected, "place {k} in round {round} closes the loop with the visit before");
        }
        assert_eq!(places.len(), frames.len(), "round {round}");
    }
}

#[test]
fn number_of_places_is_bounded_and_the_oldest_are_dropped() {
    let (frame, _) = keyframe(0, 20.0, &Pose::identity(), &Pose::identity());
    let mut places = Places::default();
    let finder = LoopFinder::default();
    for number in 0..50 {
        let mut visit = frame.clone();
        visit.submap = number;
        visit.path_m = 20.0 * number as f64;
        // Places 10 km apart.
        visit.p_in_odom.x = 10_000.0 * number as f64;
        assert_eq!(places.visit(visit, &finder, 8), None);
        assert!(places.len() <= 8);
    }
    assert_eq!((places.len(), places.last().map(|last| last.submap)), (8, Some(49)));
}
