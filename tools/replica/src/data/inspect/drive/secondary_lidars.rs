//! The secondary LiDARs: the content of their first sweeps, and whether they are on the same clock.

use super::DriveReport;
use super::stream::seconds_between;
use drive::{Drive, DriveLidar, SweepSource};
use lidar::SweepInfo;

/// Sweeps that are decoded.
const N_SWEEPS: usize = 12;
/// Largest lead of a secondary LiDAR on the same clock, s: LiDARs are not switched on at the same moment.
const MAX_APART_S: f64 = 10.0;

/// Adds a section for each of them.
pub fn add(drive: &Drive, report: &mut DriveReport) {
    for (index, lidar) in drive.lidars().enumerate().skip(1) {
        let name = drive.manifest().lidar_name(index).into_owned();
        let n_bytes: u64 = lidar.files.iter().map(|file| file.metadata().map_or(0, |metadata| metadata.len())).sum();
        let mut lines = vec![format!(
            "{}, {}: {} files, {:.1} MB",
            lidar.lidar.model().title(),
            lidar.format,
            lidar.files.len(),
            n_bytes as f64 * 1e-6
        )];
        match sweeps(lidar) {
            Err(reason) => report.doubt(format!("lidar {name}: {reason}")),
            Ok(sweeps) => {
                let whole: Vec<&SweepInfo> = sweeps.iter().filter(|sweep| sweep.turn > 0.9).collect();
                let mut n_returns: Vec<usize> = whole.iter().map(|sweep| sweep.n_returns).collect();
                n_returns.sort_unstable();
                if let ([first, ..], Some(median)) = (&whole[..], n_returns.get(n_returns.len() / 2)) {
                    let hz = 1e9 / f64::from(first.duration_nanos.max(1));
                    lines.push(format!(
                        "sweeps: {hz:.2} per second, {median} returns per sweep (median of {})",
                        whole.len()
                    ));
                }
                let begin = sweeps.first().map(|sweep| sweep.stamp);
                if let (Some(begin), Some([first, last])) = (begin, report.lidar_span()) {
                    let after_s = seconds_between(begin, first);
                    lines.push(format!("begins {after_s:+.3} s after the first LiDAR"));
                    if begin > last || after_s < -MAX_APART_S {
                        report.doubt(format!(
                            "lidar {name} begins {after_s:+.1} s after the first LiDAR and shares no time with it: all LiDARs must be on \
                             one clock"
                        ));
                    }
                }
            }
        }
        report.section(&format!("LiDAR {name}"), lines);
    }
}

fn sweeps(lidar: &DriveLidar) -> Result<Vec<SweepInfo>, String> {
    if lidar.files.is_empty() {
        return Err("its folder is empty".to_owned());
    }
    let mut source = SweepSource::open(lidar).map_err(|error| error.to_string())?;
    let mut sweeps = Vec::new();
    while sweeps.len() < N_SWEEPS
        && let Some(sweep) = source.next_sweep(|_| {}).map_err(|error| error.to_string())?
    {
        sweeps.push(sweep);
    }
    if sweeps.is_empty() { Err("no sweep can be read".to_owned()) } else { Ok(sweeps) }
}
