//! Towns and rides through them.

use messages::ClassId;
use nalgebra::{Point3, UnitQuaternion, Vector3};
use raytrace::{Ray, Vec3};
use simulation::{DriveSpec, Simulation, Town};
use std::collections::{BTreeMap, BTreeSet};

fn town(town: Town, seed: u64, seconds: f64) -> Simulation {
    Simulation::new(&DriveSpec { town, ..DriveSpec::urban(seed, seconds) }.sparse(50)).expect("a town")
}

/// The surface that a ray hits.
fn look(simulation: &Simulation, seconds: f64, from: &Point3<f64>, direction: &Vector3<f64>) -> Option<(f32, ClassId)> {
    let ray = Ray { origin: from.coords.cast(), direction: direction.normalize().cast(), seed: 3 };
    let hit = simulation.scene.cast(&simulation.scene.at(seconds), &ray, 120.0)?;
    Some((hit.range_m, hit.surface.class))
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn wheels_stay_on_road() {
    for (kind, seed) in
        [(Town::Urban, 1), (Town::Suburban, 2), (Town::Rural, 3), (Town::Tunnel, 4), (Town::Motorway, 5)]
    {
        let simulation = town(kind, seed, 30.0);
        for i in 0..300 {
            let seconds = 0.1 * f64::from(i);
            for (x, y) in [(1.4, 0.75), (1.4, -0.75), (-1.4, 0.75), (-1.4, -0.75)] {
                let pose = simulation.motion.pose(seconds);
                let down = pose.rotation * -Vector3::z();
                let (range, class) =
                    look(&simulation, seconds, &(pose * Point3::new(x, y, -0.2)), &down).expect("ground");
                assert!(matches!(class, ClassId::Road | ClassId::RoadLine), "{kind:?}, {seconds} s: {class:?}");
                // The body is 1 m above the road.
                assert!((range - 0.8).abs() < 0.09, "{kind:?}, {seconds} s: {range} m");
            }
        }
    }
}

#[test]
fn no_mover_intersects_ego_vehicle() {
    for (kind, seed) in [(Town::Urban, 1), (Town::Suburban, 5), (Town::Rural, 6), (Town::Motorway, 7)] {
        let simulation = town(kind, seed, 45.0);
        let movers = simulation.scene.movers();
        assert!(movers.len() > 10, "{kind:?}: {} movers", movers.len());
        // Along the outline of the vehicle, at two heights.
        let outline: Vec<Point3<f32>> = (-8..=8)
            .flat_map(|i| [-0.9_f32, 0.0, 0.9].map(|y| [-0.4_f32, 0.4].map(|z| Point3::new(0.29 * i as f32, y, z))))
            .flatten()
            .collect();
        let mut moved = 0;
        for (number, mover) in movers.iter().enumerate() {
            let [low, high] = mover.bounds();
            let begin = mover.pose(0.0).translation.vector;
            moved += usize::from((mover.pose(40.0).translation.vector - begin).norm() > 5.0);
            for i in 0..450 {
                let seconds = 0.1 * f64::from(i);
                let world_from_body = simulation.motion.pose(seconds).cast::<f32>();
                let object_from_body = mover.pose(seconds).inverse() * world_from_body;
                let is_inside = |p: &Point3<f32>| {
                    let p = object_from_body * p;
                    (0..3).all(|axis| p[axis] > low[axis] && p[axis] < high[axis])
                };
                assert!(!outline.iter().any(is_inside), "{kind:?}: mover {number} at {seconds} s");
            }
        }
        assert!(moved > 8, "{kind:?}: {moved} move");
    }
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn rides_are_gentle_and_stop_at_red_lights() {
    for (kind, seed) in [(Town::Urban, 1), (Town::Urban, 7), (Town::Suburban, 2), (Town::Rural, 3), (Town::Motorway, 4)]
    {
        let motion = town(kind, seed, 60.0).motion;
        let mut fastest = 0.0_f64;
        let mut standing = 0;
        for i in 10..580 {
            let seconds = 0.1 * f64::from(i);
            let in_body = motion.pose(seconds).rotation.inverse() * motion.acceleration(seconds);
            assert!(in_body.y.abs() < 2.5, "{kind:?} {seed}: {} m/s^2 sideward at {seconds} s", in_body.y);
            assert!(in_body.x.abs() < 2.2, "{kind:?} {seed}: {} m/s^2 forward at {seconds} s", in_body.x);
            assert!(in_body.z.abs() < 2.5, "{kind:?} {seed}: {} m/s^2 upward at {seconds} s", in_body.z);
            let speed = motion.velocity(seconds).norm();
            fastest = fastest.max(speed);
            standing += usize::from(seconds > 10.0 && speed < 0.05);
        }
        let expected = if kind == Town::Motorway { 20.0..28.0 } else { 8.0..14.0 };
        assert!(expected.contains(&fastest), "{kind:?}: {fastest} m/s");
        assert_eq!(standing > 60, kind == Town::Urban, "{kind:?} {seed}: stood {} s", 0.1 * standing as f64);
    }
}

#[test]
fn integrated_motion_gives_pose_after_turns_and_stops() {
    let motion = town(Town::Urban, 1, 50.0).motion;
    let dt = 0.002;
    let begin = 3.0;
    let end = 48.0;
    let mut rotation = motion.pose(begin).rotation;
    let mut position = motion.pose(begin).translation.vector;
    let mut velocity = motion.velocity(begin);
    let mut turned = 0.0;
    for i in 0..((end - begin) / dt) as usize {
        let middle = begin + (i as f64 + 0.5) * dt;
        let rate = motion.angular_rate(middle);
        turned += rate.z.abs() * dt;
        rotation *= UnitQuaternion::from_scaled_axis(rate * dt);
        position += (velocity + motion.acceleration(middle) * (0.5 * dt)) * dt;
        velocity += motion.acceleration(middle) * dt;
    }
    let off = (position - motion.pose(end).translation.vector).norm();
    assert!(off < 0.05, "{off} m off after {} s", end - begin);
    assert!(rotation.angle_to(&motion.pose(end).rotation) < 1e-3);
    assert!(turned > 1.0, "there are turns: {turned} rad");
}

/// Number of hits of each class by rays from the roof of the vehicle.
fn classes_seen(simulation: &Simulation, step_seconds: f64) -> BTreeMap<ClassId, usize> {
    let mut seen = BTreeMap::new();
    for i in 0..(simulation.spec.seconds / step_seconds) as usize {
        let seconds = i as f64 * step_seconds;
        let pose = simulation.motion.pose(seconds);
        let snapshot = simulation.scene.at(seconds);
        let origin: Vec3 = (pose * Point3::new(-1.0, 0.0, 2.2)).coords.cast();
        for ray in 0..600_u64 {
            // The golden angle spreads directions from 35 degrees down to 12 up.
            let azimuth = ray as f32 * 2.399_963;
            let elevation = -0.61 + 0.82 * ray as f32 / 600.0;
            let (sin, cos) = elevation.sin_cos();
            let direction = Vec3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin);
            let ray = Ray { origin, direction, seed: ray + 1000 * i as u64 };
            if let Some(hit) = simulation.scene.cast(&snapshot, &ray, 100.0) {
                *seen.entry(hit.surface.class).or_insert(0) += 1;
            }
        }
    }
    seen
}

#[test]
fn all_classes_except_sky_occur_in_towns() {
    let mut seen = BTreeMap::new();
    for (kind, seed, seconds, step) in [(Town::Urban, 1, 70.0, 0.3), (Town::Rural, 1, 170.0, 0.5)] {
        for (class, n) in classes_seen(&town(kind, seed, seconds), step) {
            *seen.entry(class).or_insert(0) += n;
        }
    }
    let missing: BTreeSet<&str> = ClassId::ALL
        .iter()
        .filter(|class| **class != ClassId::Sky && !seen.contains_key(class))
        .map(|class| class.name())
        .collect();
    assert!(missing.is_empty(), "{missing:?} missing of {seen:?}");
}

#[test]
fn urban_class_shares_match_real_recordings() {
    // These have the order of magnitude of tables 2.1 and 2.2 of the thesis.
    let simulation = town(Town::Urban, 1, 30.0);
    let lidar = simulation.lidar();
    let mut counts = BTreeMap::new();
    let mut total = 0.0;
    for packet in (0..lidar.model().n_packets(30.0)).step_by(3) {
        for found in lidar.packet(packet).iter().flat_map(|block| block.returns.iter().flatten()) {
            *counts.entry(found.class).or_insert(0.0) += 1.0;
            total += 1.0;
        }
    }
    for (class, low, high) in [
        (ClassId::Road, 0.28, 0.55),
        (ClassId::Building, 0.10, 0.38),
        (ClassId::Sidewalk, 0.04, 0.20),
        (ClassId::Vegetation, 0.02, 0.25),
        (ClassId::Vehicles, 0.01, 0.12),
        (ClassId::RoadLine, 0.003, 0.05),
        (ClassId::Pedestrian, 0.0003, 0.01),
        (ClassId::Pole, 0.001, 0.02),
    ] {
        let rate = counts.get(&class).copied().unwrap_or(0.0) / total;
        assert!((low..high).contains(&rate), "{class:?}: {rate}");
    }
    assert!(total > 5000.0);
}

#[test]
fn fields_are_empty_and_tunnels_are_closed() {
    let seen = |kind, from: f64, to: f64| {
        let simulation = town(kind, 2, to);
        let mut above = 0;
        let mut alongside = 0;
        for i in 0..20 {
            let seconds = from + (to - from) * f64::from(i) / 20.0;
            let pose = simulation.motion.pose(seconds);
            let from = pose * Point3::new(0.0, 0.0, 1.5);
            above += usize::from(look(&simulation, seconds, &from, &Vector3::z()).is_some());
            let left = pose.rotation * Vector3::new(0.0, 1.0, 0.1);
            alongside += usize::from(look(&simulation, seconds, &from, &left).is_some());
        }
        (above, alongside)
    };
    assert_eq!(seen(Town::Field, 2.0, 14.0), (0, 0));
    // The portal is 28 m behind the first mouth.
    assert_eq!(seen(Town::Tunnel, 8.0, 12.0), (20, 20));
}
