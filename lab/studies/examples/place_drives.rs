//! Scores the placement of simulated drives without sweeps: true motion with the drift of the odometry, fixes of the simulated
//! receiver, inertial samples. A drive of a minute takes a second.
//!
//! `cargo run --release -p studies --example place_drives -- FIRST_SEED LAST_SEED SECONDS [FAULT]`
//!
//! Faults: `white` (independent errors of 0.97 m), `jump` (30 m east and north during a third of the drive), `late` (stamps 0.2 s late),
//! `few` (a fix every 15 s).

#[path = "../../../shared/georeference/tests/suite/matched.rs"]
mod matched;

use acquisition::rows::gnss_row;
use geometry::{Geodetic, Isometry3, LocalFrame, Point3, Pose, Vector3};
use georeference::{GeoreferenceSettings, Georeferencer, Placed};
use messages::{GnssRow, ImuRow};
use random::{gauss, hash};
use registration::{Registered, SweepMotion};
use simulation::sensors::gnss::{Epoch, ORIGIN};
use simulation::{DriveSpec, RigSpec, Simulation};
use std::error::Error;

const SWEEP_NANOS: i64 = 100_000_000;
/// Drift of the odometry with gyroscopes: random walks per square root of the path and a wrong scale, as measured with LiDAR
/// (`lab/notebook/odometry.md`): rad and m over 1 m.
/// Gyroscopes and gravity hold the tilt better than the heading.
const WALK_RAD: [f64; 3] = [3e-5, 3e-5, 8e-5];
const WALK_M: f64 = 1.5e-3;
const SCALE: f64 = 3e-4;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [first, last, seconds, fault @ ..] = &arguments[..] else {
        return Err("arguments: FIRST_SEED LAST_SEED SECONDS [white | jump | late | few]".into());
    };
    let fault = fault.first().map_or("", String::as_str);
    let mut across = 0.0;
    let mut up = 0.0;
    let mut heading = 0.0;
    let mut nees = [0.0; 2];
    let mut n = 0.0;
    println!("seed    across    up  heading   stated: across    up  heading   NEES: across    up   fixes used");
    for seed in first.parse::<u64>()?..=last.parse()? {
        let Some(score) = place(seed, seconds.parse()?, fault)? else {
            println!("{seed:4}  not placed");
            continue;
        };
        println!("{seed:4}{score}");
        across += score.across_m.powi(2);
        up += score.up_m.powi(2);
        heading += score.heading_deg.powi(2);
        nees = [nees[0] + score.nees[0], nees[1] + score.nees[1]];
        n += 1.0;
    }
    let rms = |sum: f64| (sum / n).sqrt();
    println!(
        "RMS of {n} drives: {:.2} m across, {:.2} m up, {:.3} degrees; mean NEES {:.2} across (2 expected), {:.2} up (1 expected)",
        rms(across),
        rms(up),
        rms(heading),
        nees[0] / n,
        nees[1] / n
    );
    Ok(())
}

struct Score {
    across_m: f64,
    up_m: f64,
    heading_deg: f64,
    stated: [f64; 3],
    /// NEES of the submap in the middle: horizontal with two degrees of freedom, height with one.
    nees: [f64; 2],
    summary: String,
    fixes: [usize; 2],
}

impl std::fmt::Display for Score {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { across_m, up_m, heading_deg, stated: [a, u, h], nees, fixes, .. } = self;
        write!(
            f,
            "{across_m:9.2}{up_m:7.2}{heading_deg:8.2}{a:18.2}{u:7.2}{h:8.2}{:16.2}{:7.2}{:8}/{}  {}",
            nees[0], nees[1], fixes[1], fixes[0], self.summary
        )
    }
}

fn place(seed: u64, seconds: f64, fault: &str) -> Result<Option<Score>, Box<dyn Error>> {
    let mut spec = DriveSpec::urban(seed, seconds).sparse(1);
    spec.rig = RigSpec::built_in("survey").ok_or("rig survey")?;
    let simulation = Simulation::new(&spec)?;
    let gnss = spec.rig.gnss.ok_or("a receiver")?;
    let imu = spec.rig.imu.ok_or("an inertial unit")?;
    let settings = GeoreferenceSettings {
        gnss: true,
        imu: true,
        loops: false,
        unsmooth_fixes: false,
        antenna_in_body: gnss.antenna_in_body.into(),
        imu_in_body: imu.position_in_body.into(),
        origin: Geodetic::new(ORIGIN.latitude_deg, ORIGIN.longitude_deg, ORIGIN.altitude_m),
        max_keyframes: 10,
    };
    let rows = fixes(&simulation, fault, seed);
    let truth = |nanos: i64| simulation.motion.pose_at(simulation.motion.begin.plus_nanos(nanos));
    let samples = simulation.imu_samples().unwrap_or_default();
    let imu_row = |sample: &drive::imu::ImuSample| ImuRow {
        stamp: sample.stamp.0,
        acceleration: sample.acceleration,
        angular_rate: sample.angular_rate,
    };
    let samples: Vec<ImuRow> = samples.iter().map(imu_row).collect();
    let mut georeferencer = Georeferencer::new(&settings);
    let begin = simulation.motion.begin.0;
    let mut odometry = Isometry3::identity();
    let mut submap: Option<(f64, i64)> = None;
    let mut submaps: Vec<Pose> = Vec::new();
    for k in 0..(seconds * 10.0) as i64 {
        let from = k * SWEEP_NANOS;
        let to = (k + 1) * SWEEP_NANOS;
        let in_tick = |stamp: i64| stamp - begin >= from && stamp - begin < to;
        georeferencer.add_imu(&samples.iter().filter(|s| in_tick(s.stamp)).copied().collect::<Vec<_>>(), &settings);
        georeferencer.add_gnss(&rows.iter().filter(|s| in_tick(s.stamp)).copied().collect::<Vec<_>>(), &settings);
        let end = odometry * drifted(&truth(from).inv_mul(&truth(to)), hash(seed, 1000 + k as u64));
        let path_m = (end.translation.vector - odometry.translation.vector).norm();
        let is_new = submap.is_none_or(|(m, since)| m >= 20.0 || from - since >= 5_000_000_000);
        if is_new {
            let heading = geometry::heading(&odometry.rotation);
            georeferencer.begin_submap(Isometry3::from_parts(odometry.translation, heading), begin + from);
            submaps.push(truth(from) * odometry.inverse() * Isometry3::from_parts(odometry.translation, heading));
            submap = Some((0.0, from));
        }
        georeferencer.add_sweep(&registered(begin + from, &odometry, &end), &odometry, &end);
        submap = submap.map(|(m, since)| (m + path_m, since));
        odometry = end;
        georeferencer.update(&settings);
    }
    Ok(georeferencer.solve(&settings).filter(|placed| placed.header.frame != 0).map(|placed| score(&placed, &submaps)))
}

fn drifted(motion: &Pose, seed: u64) -> Pose {
    let root = motion.translation.vector.norm().sqrt();
    let draw = |k: u64, size: f64| f64::from(gauss(hash(seed, k))) * size * root;
    let m = Vector3::new(draw(0, WALK_M), draw(1, WALK_M), draw(2, WALK_M));
    let rad = Vector3::new(draw(3, WALK_RAD[0]), draw(4, WALK_RAD[1]), draw(5, WALK_RAD[2]));
    let scaled = Isometry3::from_parts((motion.translation.vector * (1.0 + SCALE)).into(), motion.rotation);
    scaled * Isometry3::new(m, rad)
}

fn registered(stamp: i64, begin: &Pose, end: &Pose) -> Registered {
    let motion = SweepMotion {
        mid: *begin,
        translation: end.translation.vector - begin.translation.vector,
        rotation: (begin.rotation.inverse() * end.rotation).scaled_axis(),
    };
    matched::registered(stamp, SWEEP_NANOS as u32, motion, 2000, true)
}

fn fixes(simulation: &Simulation, fault: &str, seed: u64) -> Vec<GnssRow> {
    let epochs = simulation.epochs();
    let n = epochs.len();
    let antenna = Point3::from(simulation.rig.gnss.map_or([0.0; 3], |gnss| gnss.antenna_in_body));
    let frame = LocalFrame::new(ORIGIN);
    let row = |(k, epoch): (usize, &Epoch)| {
        let fix = epoch.fix?;
        let place = Geodetic::new(fix.position_deg[0], fix.position_deg[1], fix.altitude_m?)?;
        let mut p = frame.world_from_geodetic(&place);
        let mut stamp = fix.stamp.0;
        match fault {
            "white" => {
                let draw = |axis: u64| f64::from(gauss(hash(hash(seed, 77), 10 * k as u64 + axis)));
                p = simulation.motion.pose_at(fix.stamp) * antenna + Vector3::new(draw(0), draw(1), draw(2)) * 0.97;
            }
            "jump" if (n / 3..2 * n / 3).contains(&k) => p += Vector3::new(30.0, 30.0, 30.0),
            "late" => stamp += 200_000_000,
            "few" if k % 15 != 5 => return None,
            _ => {}
        }
        let place = frame.geodetic_from_world(&p);
        Some(GnssRow {
            stamp,
            latitude_deg: place.latitude_deg,
            longitude_deg: place.longitude_deg,
            altitude_m: place.altitude_m,
            ..gnss_row(&fix)?
        })
    };
    epochs.iter().enumerate().filter_map(row).collect()
}

fn score(placed: &Placed, truth: &[Pose]) -> Score {
    let n = placed.rows.len() as f64;
    let mut across = 0.0;
    let mut up = 0.0;
    let mut turned = 0.0;
    for (row, truth) in placed.rows.iter().zip(truth) {
        let pose: Pose = row.world_from_submap.to_pose().unwrap_or_default();
        let off = pose.translation.vector - truth.translation.vector;
        across += off.xy().norm_squared() / n;
        up += off.z.powi(2) / n;
        turned += (truth.rotation.inverse() * pose.rotation).scaled_axis().z.to_degrees().powi(2) / n;
    }
    let middle = placed.rows.len() / 2;
    let row = &placed.rows[middle];
    let pose: Pose = row.world_from_submap.to_pose().unwrap_or_default();
    let off = pose.rotation.inverse() * (pose.translation.vector - truth[middle].translation.vector);
    let [x, y, z] = row.sigma_m.map(f64::from);
    let deviation = row.deviation();
    Score {
        across_m: across.sqrt(),
        up_m: up.sqrt(),
        heading_deg: turned.sqrt(),
        stated: [deviation.position_m, deviation.height_m, deviation.heading_deg],
        nees: [(off.x / x).powi(2) + (off.y / y).powi(2), (off.z / z).powi(2)],
        summary: format!("mean error {:.2} {:.2} {:.2}", off.x, off.y, off.z),
        fixes: [placed.fixes.n, placed.fixes.n_used],
    }
}
