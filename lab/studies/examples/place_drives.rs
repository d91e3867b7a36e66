//! Scores the placement of simulated drives without sweeps: true motion with the drift of the odometry, fixes of the simulated
//! receiver, inertial samples. A drive of a minute takes a second.
//!
//! `cargo run --release -p studies --example place_drives -- FIRST_SEED LAST_SEED SECONDS [FAULT]`
//!
//! Faults: `white` (independent errors of 0.97 m), `jump` (30 m east and north during a third of the drive), `late` (stamps 0.2 s late),
//! `few` (a fix every 15 s), `start` (fixes of the first 15 s only).

#[path = "../../../shared/georeference/tests/suite/matched.rs"]
mod matched;
#[path = "../../../shared/georeference/tests/suite/scored.rs"]
mod scored;

use acquisition::rows::gnss_row;
use geometry::{Geodetic, LocalFrame, Point3, Vector3};
use georeference::GeoreferenceSettings;
use messages::{GnssRow, ImuRow};
use random::{gauss, hash};
use scored::{Score, ScoredDrive, print_mean};
use simulation::sensors::gnss::{Epoch, ORIGIN};
use simulation::{DriveSpec, RigSpec, Simulation};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [first, last, seconds, fault @ ..] = &arguments[..] else {
        return Err("arguments: FIRST_SEED LAST_SEED SECONDS [white | jump | late | few | start]".into());
    };
    let fault = fault.first().map_or("", String::as_str);
    println!("seed {}", Score::HEADER);
    let mut scores = Vec::new();
    for seed in first.parse::<u64>()?..=last.parse()? {
        match place(seed, seconds.parse()?, fault)? {
            None => println!("{seed:4}  not placed"),
            Some(score) => {
                println!("{seed:4}{score}");
                scores.push(score);
            }
        }
    }
    print_mean(&scores);
    Ok(())
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
    let drive = ScoredDrive {
        truth: &truth,
        begin: simulation.motion.begin.0,
        n_sweeps: (seconds * 10.0) as i64,
        fixes: &rows,
        samples: &samples,
        seed,
    };
    Ok(drive.place(&settings))
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
            "start" if k > 15 => return None,
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
