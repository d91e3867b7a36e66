//! Drives like recordings of real vehicles: LiDAR units with errors, and dense traffic.

use lidar::velodyne::Model;
use messages::ClassId;
use nalgebra::{Point3, Vector3};
use simulation::sensors::lidar::{LidarErrors, LidarModel, LidarReturn};
use simulation::{DriveSpec, Simulation, Town, Traffic, write_drive};

/// Returns within this range are near, m.
const NEAR_M: f32 = 20.0;

fn unit(errors: LidarErrors, unit_seed: u64) -> Simulation {
    let lidar_errors = LidarErrors { unit_seed, ..errors };
    Simulation::new(&DriveSpec { lidar_errors, ..DriveSpec::urban(3, 0.3).sparse(1) }).expect("a town")
}

/// The rows of `truth/lidar_errors.csv` by ring: elevation error (degrees), range error (m), gain.
fn table(errors: &LidarErrors, model: Model) -> Vec<[f64; 3]> {
    let text = errors.csv(model).expect("an imperfect unit");
    let row = |line: &str| {
        let mut numbers = line.split(',').skip(1).map(|number| number.parse::<f64>().expect("a number"));
        [(); 3].map(|()| numbers.next().expect("three"))
    };
    text.lines().skip(1).map(row).collect()
}

#[test]
fn beams_of_imperfect_unit_differ_from_nominal_by_its_table() {
    for model in [Model::Hdl32e, Model::Hdl64e] {
        let [perfect, poor] = [unit(LidarErrors::NONE, 1), unit(LidarErrors::POOR, 5)];
        let mounting = perfect.rig.lidar.body_from_lidar;
        let [nominal, real] = [&perfect, &poor].map(|drive| drive.lidar_of(LidarModel::for_model(model), mounting, 1));
        let table = table(&poor.spec.lidar_errors, model);
        let rings = model.rings();
        let world_from_lidar = perfect.motion.pose(0.0) * mounting;
        let elevation = |direction: &Vector3<f32>| {
            (world_from_lidar.rotation.inverse() * direction.cast::<f64>()).z.asin().to_degrees()
        };
        let blocks = real.packet(0);
        let rays = nominal.rays(0).into_iter().zip(real.rays(0));
        for (slot, (nominal, real)) in rays.enumerate() {
            let laser = slot % 32 % model.n_rings() + if blocks[slot / 32].is_lower { 32 } else { 0 };
            let [expected_deg, ..] = table[usize::from(rings[laser])];
            let error_deg = elevation(&real.direction) - elevation(&nominal.direction);
            assert!(
                (error_deg - expected_deg).abs() < 2e-3,
                "{model:?} laser {laser}: {error_deg}, not {expected_deg}"
            );
        }
    }
}

#[test]
fn ranges_and_intensities_of_imperfect_unit_err_by_ring_and_truth_does_not() {
    let errors = LidarErrors { unit_seed: 5, common_elevation_deg: 0.0, ring_elevation_deg: 0.0, ..LidarErrors::POOR };
    let [perfect, poor] = [unit(LidarErrors::NONE, 1), unit(errors, 5)];
    let [nominal, real] = [perfect.lidar(), poor.lidar()];
    let table = table(&errors, Model::Hdl32e);
    let rings = Model::Hdl32e.rings();
    let mut sums = vec![[0.0, 0.0, 0.0, 0.0]; 32];
    for packet in 0..200 {
        let nominal = nominal.packet(packet);
        let real = real.packet(packet);
        for (a, b) in nominal.iter().zip(&real) {
            for (laser, (a, b)) in a.returns.iter().zip(&b.returns).enumerate() {
                // With equal beams, both hit the same surface.
                let (Some(a), Some(b)) = (a, b) else { continue };
                assert_eq!((a.class, a.instance, a.range_m), (b.class, b.instance, b.range_m));
                let sum = &mut sums[usize::from(rings[laser])];
                sum[0] += 1.0;
                sum[1] += (f64::from(b.range_2mm) - f64::from(a.range_2mm)) * 0.002;
                sum[2] += f64::from(a.intensity);
                sum[3] += f64::from(b.intensity);
            }
        }
    }
    for (ring, ([_, range_m, gain], [n, range_sum, before, after])) in table.into_iter().zip(sums).enumerate() {
        assert!(n > 100.0, "ring {ring}: {n} returns");
        assert!((range_sum / n - range_m).abs() < 3e-4, "ring {ring}: {} m, not {range_m} m", range_sum / n);
        // Dark surfaces stay at one count, bright surfaces at their limit.
        assert!((after / before - gain).abs() < 0.2, "ring {ring}: {}, not {gain}", after / before);
    }
}

#[test]
fn drive_of_imperfect_unit_keeps_true_poses_and_states_its_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, simulation: &Simulation| {
        let path = folder.path().join(name);
        write_drive(&DriveSpec { lidar_step: 20, ..simulation.spec.clone() }, &path, &mut |_| ()).expect("a drive");
        path
    };
    let paths = [write("perfect", &unit(LidarErrors::NONE, 1)), write("poor", &unit(LidarErrors::POOR, 5))];
    for file in ["truth/trajectory.txt", "truth/calibration.toml", "drive.toml", "imu.csv", "gnss.nmea"] {
        let [perfect, poor] = paths.each_ref().map(|path| std::fs::read(path.join(file)).expect("a file"));
        assert!(perfect == poor, "{file} differs");
    }
    let [perfect, poor] = paths.each_ref().map(|path| std::fs::read_to_string(path.join("truth/lidar_errors.csv")));
    assert!(perfect.is_err());
    let expected = LidarErrors { unit_seed: 5, ..LidarErrors::POOR }.csv(Model::Hdl32e);
    assert_eq!(poor.ok(), expected);
}

/// Share of the near returns on vehicles that move during the drive, by second.
fn share_of_movers(simulation: &Simulation, seconds: f64) -> f64 {
    let upright = geometry::Isometry3::translation(0.0, 0.0, 1.9 - simulation.spec.rig.body_height_m);
    let lidar = simulation.lidar_of(LidarModel::HDL32E, upright, 1);
    let moving = moving_instances(simulation);
    let first = lidar.model().n_packets(seconds);
    let blocks = (first..first + 181).step_by(6).flat_map(|packet| lidar.packet(packet));
    let near: Vec<LidarReturn> =
        blocks.flat_map(|block| block.returns).flatten().filter(|found| found.range_m < NEAR_M).collect();
    let n_moving = near.iter().filter(|found| found.class == ClassId::Vehicles && moving.contains(&found.instance));
    n_moving.count() as f64 / near.len() as f64
}

/// Instances of vehicles that move: rays from all sides give the instance of each mover.
fn moving_instances(simulation: &Simulation) -> std::collections::BTreeSet<u16> {
    let snapshot = simulation.scene.at(0.0);
    let mut found = std::collections::BTreeSet::new();
    for mover in simulation.scene.movers() {
        // Just above its roof: below trees and wires.
        let roof = mover.bounds()[1].z + 0.2;
        let above = mover.pose(0.0) * Point3::new(mover.center.x, mover.center.y, roof);
        let ray = raytrace::Ray { origin: above.coords, direction: -Vector3::z(), seed: 0 };
        let hit = simulation.scene.cast(&snapshot, &ray, 4.0);
        found.extend(hit.filter(|hit| hit.surface.instance > 0).map(|hit| hit.surface.instance));
    }
    found
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn near_returns_of_dense_traffic_move_along_with_the_vehicle() {
    for (town, seed) in [(Town::Urban, 1), (Town::Urban, 2), (Town::Urban, 7), (Town::Suburban, 3), (Town::Rural, 4)] {
        let spec = DriveSpec { town, traffic: Traffic::Dense, ..DriveSpec::urban(seed, 20.0) };
        let simulation = Simulation::new(&spec).expect("a town");
        let shares = [0.0, 3.0, 8.0, 14.0].map(|seconds| share_of_movers(&simulation, seconds));
        println!("{town:?} {seed}: {shares:.2?}");
        let least = if town == Town::Urban { 0.4 } else { 0.25 };
        assert!(shares.iter().all(|share| (least..0.8).contains(share)), "{town:?} {seed}: {shares:.2?}");
        let normal = Simulation::new(&DriveSpec { traffic: Traffic::Normal, ..spec }).expect("a town");
        assert!(share_of_movers(&normal, 8.0) < 0.1, "{}", share_of_movers(&normal, 8.0));
    }
}

#[test]
fn queues_of_dense_traffic_stand_in_the_lanes_of_the_street() {
    for (town, left_m) in [(Town::Urban, 3.2), (Town::Motorway, 3.75)] {
        let spec = DriveSpec { town, traffic: Traffic::Dense, ..DriveSpec::urban(2, 5.0) };
        let simulation = Simulation::new(&spec).expect("a town");
        let from_ego = simulation.motion.pose(0.0).inverse();
        // At larger distances, bends of the street move the lanes.
        let near = simulation.scene.movers().iter().filter_map(|mover| {
            let place = from_ego * Point3::from(mover.pose(0.0).cast::<f64>().translation.vector);
            (place.x.abs() < 12.0 && (0.0..5.0).contains(&place.y)).then_some(place.y)
        });
        let alongside: Vec<f64> = near.filter(|left| *left > 1.5).collect();
        assert!(alongside.len() > 1, "{town:?}: {alongside:.2?}");
        assert!(alongside.iter().all(|left| (left - left_m).abs() < 0.35), "{town:?}: {alongside:.2?}");
    }
}

#[test]
fn queue_of_dense_traffic_stands_at_first_and_starts_with_the_vehicle() {
    let spec = DriveSpec { traffic: Traffic::Dense, ..DriveSpec::urban(2, 20.0) };
    let simulation = Simulation::new(&spec).expect("a town");
    let ego = |seconds: f64| simulation.motion.pose(seconds);
    let mut n_along = 0;
    for mover in simulation.scene.movers() {
        let at = |seconds: f64| mover.pose(seconds).cast::<f64>().translation.vector;
        let relative = |seconds: f64| ego(seconds).inverse() * Point3::from(at(seconds));
        if relative(0.0).coords.xy().norm() < 45.0 && (at(6.0) - at(0.0)).norm() > 12.0 {
            n_along += 1;
            assert!((at(0.2) - at(0.0)).norm() < 1.0, "it rolls at the start: {}", (at(0.2) - at(0.0)).norm());
            let gap_m = relative(0.0).coords.norm();
            let off_m = (relative(6.0).coords.norm() - gap_m).abs();
            // Gaps grow by a sixth when the queue starts. Around a corner, a gap is measured across the block.
            let is_same_street = relative(0.0).y.abs() < 2.3;
            let limit_m = if is_same_street { 0.2 * gap_m } else { 12.0 };
            assert!(off_m < limit_m, "it leaves the queue: {off_m} m of {gap_m} m");
        }
    }
    assert!((25..=35).contains(&n_along), "{n_along} vehicles drive in the queue");
}
