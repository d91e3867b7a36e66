//! Scores the placement of a recorded city drive of 3.7 km (KITTI `2011_10_03_0027`) by its recorded fixes. The odometry is made from
//! the reference poses, with seeded drift; the inertial samples are recorded.
//!
//! `cargo run --release -p studies --example place_recorded_drive -- QUALITY SECONDS...`
//!
//! QUALITY: GGA quality of the fixes (1 single, 2 differential, 4 RTK fixed). SECONDS: lengths of the parts into which the drive is cut.

#[path = "../../../shared/georeference/tests/suite/kitti_drive.rs"]
mod kitti_drive;
#[path = "../../../shared/georeference/tests/suite/matched.rs"]
mod matched;
#[path = "../../../shared/georeference/tests/suite/scored.rs"]
mod scored;

use anyhow::Context;
use geometry::Pose;
use kitti_drive::{FIXES, KittiDrive, POSES, SAMPLES, settings};
use scored::{SWEEP_NANOS, Score, ScoredDrive, print_mean};

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [quality, lengths @ ..] = &arguments[..] else { anyhow::bail!("arguments: QUALITY SECONDS...") };
    let mut paths = Vec::new();
    for name in [POSES, FIXES, SAMPLES] {
        paths.push(real_data::find(name).with_context(|| format!("{name} is absent; set REPLICA_DATA"))?);
    }
    let drive = KittiDrive::read([&paths[0], &paths[1], &paths[2]], quality.parse()?);
    let settings = settings();
    let [first, last] = drive.span();
    for length in lengths {
        let n_sweeps = length.parse::<i64>()? * 1_000_000_000 / SWEEP_NANOS;
        println!("{length} s  {}", Score::HEADER);
        let mut scores = Vec::new();
        for number in 0..(last - first) / (n_sweeps * SWEEP_NANOS) {
            let begin = first + number * n_sweeps * SWEEP_NANOS;
            let truth = |nanos: i64| -> Pose { drive.truth_at(begin + nanos) };
            let KittiDrive { fixes, samples, .. } = &drive;
            let part = ScoredDrive { truth: &truth, begin, n_sweeps, fixes, samples, seed: 4000 + number as u64 };
            match part.place(&settings) {
                None => println!("{number:3}  not placed"),
                Some(score) => {
                    println!("{number:3}{score}");
                    scores.push(score);
                }
            }
        }
        print_mean(&scores);
    }
    Ok(())
}
