//! Errors of a survey of simulated drives: each drive against its true path, and the drives against each other.
//!
//! `survey_errors SURVEY DRIVE...`: the folder of `replica survey`, and the drive folder of each of its drives in the same order.

use anyhow::{Context, ensure};
use drive::Drive;
use geometry::Vector3;
use std::path::Path;
use surveying::open_survey;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (survey, drives) = arguments.split_first().context("SURVEY DRIVE...")?;
    let (file, runs) = open_survey(Path::new(survey))?;
    ensure!(drives.len() == runs.len(), "the survey has {} drives", runs.len());
    let mut all: Vec<Vec<(Vector3<f64>, Vector3<f64>)>> = Vec::new();
    for ((named, run), folder) in file.drives.iter().zip(&runs).zip(drives) {
        let truth = Drive::open(Path::new(folder))?.true_trajectory().context("has no truth")?;
        let truth = truth.map_err(|problem| anyhow::anyhow!("{problem}"))?;
        let errors: Vec<(Vector3<f64>, Vector3<f64>)> = run
            .index
            .clouds
            .iter()
            .filter_map(|cloud| {
                let middle = geometry::Stamp(cloud.stamp_begin.midpoint(cloud.stamp_end));
                let true_p = truth.at(middle)?.translation.vector;
                Some((true_p, run.trajectory.at(middle)?.translation.vector - true_p))
            })
            .collect();
        println!(
            "{}: {} submaps, RMS east, north, up {}",
            named.name,
            errors.len(),
            rms(errors.iter().map(|(_, error)| *error))
        );
        all.push(errors);
    }
    for later in 1..all.len() {
        for earlier in 0..later {
            let pairs = all[later].iter().filter_map(|(p, error)| {
                let distance = |other: &&(Vector3<f64>, Vector3<f64>)| (other.0 - p).norm();
                let nearest = all[earlier].iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
                (distance(&nearest) < 20.0).then(|| error - nearest.1)
            });
            println!("{earlier} and {later}: apart RMS east, north, up {}", rms(pairs));
        }
    }
    Ok(())
}

/// Root mean square by axis, m.
fn rms(errors: impl Iterator<Item = Vector3<f64>>) -> String {
    let errors: Vec<Vector3<f64>> = errors.collect();
    let squares =
        errors.iter().map(|error| error.component_mul(error)).sum::<Vector3<f64>>() / errors.len().max(1) as f64;
    let [east, north, up]: [f64; 3] = squares.map(f64::sqrt).into();
    format!("{east:.3}, {north:.3}, {up:.3} m")
}
