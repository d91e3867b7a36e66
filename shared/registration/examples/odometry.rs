//! Our odometry on a folder of sweeps (`folder/mod.rs` has the layout), for comparison with other people's:
//! `odometry FOLDER POSES [--sweeps N] [--set NAME=VALUE ...] [--verbose]`.
//!
//! Writes `world_from_lidar` at the last shot of each sweep in KITTI format and prints what a sweep cost: CPU time of all
//! threads, for all that the pipeline does with it (range image, features, registration, deskewed cloud), without reading.

mod folder;

use folder::{SweepFolder, kitti_line};
use registration::{DeskewTable, Odometry, OdometrySettings, Registered, Sampling, Sweep, Weights};
use rustix::time::{ClockId, clock_gettime};
use std::path::Path;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let (mut paths, mut settings) = (Vec::new(), OdometrySettings::default());
    let (mut n_sweeps, mut verbose) = (usize::MAX, false);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| anyhow::anyhow!("{argument} needs a value"));
        match argument.as_str() {
            "--sweeps" => n_sweeps = value()?.parse()?,
            "--set" => set(&mut settings, &value()?)?,
            "--verbose" => verbose = true,
            _ => paths.push(argument),
        }
    }
    let [sweeps, poses] = &paths[..] else { anyhow::bail!("usage: odometry FOLDER POSES [--set NAME=VALUE]") };
    let folder = SweepFolder::open(Path::new(sweeps))?;
    let mut odometry = Odometry::new(settings, folder.mounting);
    let (mut ms, mut text, mut n_points) = (Vec::new(), String::new(), 0);
    let mut scores = MovingScores::default();
    let mut waiting: Vec<Sweep> = Vec::new();
    for number in 0..folder.len().min(n_sweeps) {
        let (points, n_rings) = folder.points(number)?;
        n_points += points.len();
        let start = cpu_ms();
        waiting.push(Sweep::new(folder.stamp(number), points, n_rings));
        let registered = odometry.register(&waiting[waiting.len() - 1])?;
        let first = number + 1 - waiting.len();
        for (sweep, registered) in waiting.drain(..registered.len()).zip(&registered) {
            std::hint::black_box(deskewed(&sweep, registered));
        }
        ms.push(cpu_ms() - start);
        for (number, registered) in (first..).zip(&registered) {
            scores.add(&registered.moving, folder.moving(number)?.as_deref());
            text.push_str(&kitti_line(&registered.end()));
            if verbose {
                report(registered, ms[ms.len() - 1]);
            }
        }
    }
    if let Some(alone) = odometry.finish() {
        text.push_str(&kitti_line(&alone.end()));
    }
    std::fs::write(poses, text)?;
    let n = ms.len();
    // The first sweeps warm the caches and search for the speed; the peers' are left out, too.
    let mut counted = ms.split_off(5.min(n - 1));
    counted.sort_by(f64::total_cmp);
    let mean = counted.iter().sum::<f64>() / counted.len() as f64;
    println!("ms/scan: {mean:.2}");
    println!(
        "{n} sweeps of {} points: median {:.2} ms, p95 {:.2} ms, max {:.2} ms; map {} points",
        n_points / n,
        counted[counted.len() / 2],
        counted[counted.len() * 95 / 100],
        counted[counted.len() - 1],
        odometry.map().points().len()
    );
    scores.print();
    Ok(())
}

/// Points flagged as moving against the truth.
#[derive(Default)]
struct MovingScores {
    right: usize,
    flagged: usize,
    moving: usize,
}

impl MovingScores {
    fn add(&mut self, found: &[u32], truth: Option<&[u8]>) {
        let Some(truth) = truth else { return };
        self.flagged += found.len();
        self.right += found.iter().filter(|&&idx| truth[idx as usize] != 0).count();
        self.moving += truth.iter().filter(|&&flag| flag != 0).count();
    }
    fn print(&self) {
        if self.moving > 0 {
            let share = |of: usize| 100.0 * self.right as f64 / of.max(1) as f64;
            let (precision, recall) = (share(self.flagged), share(self.moving));
            println!("moving: {} points, precision {precision:.1} %, recall {recall:.1} %", self.moving);
        }
    }
}

/// The dense cloud as the stage would write it.
fn deskewed(sweep: &Sweep, registered: &Registered) -> Vec<[f32; 3]> {
    let table = DeskewTable::new(&registered.begin(), &registered.end(), registered.duration_nanos);
    sweep.points().iter().map(|point| table.deskew(point.position, point.offset_nanos)).collect()
}

fn report(registered: &Registered, ms: f64) {
    let end = registered.end().translation.vector;
    let matched = registered.matched.as_ref().map(|m| {
        format!(
            "{}/{} matches, rms {:.4} m, cost {:.3}, weakest {:.4} ({}), converged {}",
            m.n_matches, m.n_features, m.rms_m, m.cost, m.weakest_influence, m.n_weak_directions, m.converged
        )
    });
    let seconds = registered.stamp.0 as f64 * 1e-9;
    let matched = matched.unwrap_or("bridged".to_owned());
    println!("{seconds:.1} s, {ms:.1} ms, end {:.3} {:.3} {:.3}, {matched}", end.x, end.y, end.z);
}

fn cpu_ms() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 * 1e3 + now.tv_nsec as f64 * 1e-6
}

fn set(settings: &mut OdometrySettings, text: &str) -> anyhow::Result<()> {
    let (name, value) = text.split_once('=').ok_or_else(|| anyhow::anyhow!("--set {text}: expected NAME=VALUE"))?;
    let (features, map, matching) = (&mut settings.features, &mut settings.map, &mut settings.matching);
    match name {
        "features.column_step" => features.column_step = value.parse()?,
        "features.min_range_m" => features.min_range_m = value.parse()?,
        "features.max_range_m" => features.max_range_m = value.parse()?,
        "features.min_planarity" => features.min_planarity = value.parse()?,
        "features.spacing_m" => features.spacing_m = value.parse()?,
        "map.spacing_m" => map.spacing_m = value.parse()?,
        "map.batches" => map.batches = value.parse()?,
        "map.refinement" => map.refinement = value.parse()?,
        "map.max_points" => map.max_points = value.parse()?,
        "features.max_roughness_m" => features.max_roughness_m = value.parse()?,
        "matching.rough_below" => matching.rough_below = value.parse()?,
        "features.smoothing_m" => features.smoothing_m = value.parse()?,
        "matching.even" => {
            let (spacing_m, max_features) = value.split_once(',').ok_or_else(|| anyhow::anyhow!("SPACING,MAX"))?;
            let (spacing_m, max_features) = (spacing_m.parse()?, max_features.parse()?);
            matching.sampling = Sampling::Even { spacing_m, max_features };
        }
        "matching.per_list" => matching.sampling = Sampling::NineLists { per_list: value.parse()? },
        "matching.gaussian_m" => matching.weights = Weights::Gaussian { h_m: value.parse()? },
        "matching.bends" => matching.bends = value.parse()?,
        "matching.small_step_m" => matching.small_step.0 = value.parse()?,
        "matching.coarse_rounds" => matching.coarse_rounds = value.parse()?,
        "matching.max_rounds" => matching.max_rounds = value.parse()?,
        "matching.coarse.radius_m" => matching.coarse.0 = value.parse()?,
        "matching.coarse.scale_m" => matching.coarse.1 = value.parse()?,
        "matching.fine.radius_m" => matching.fine.0 = value.parse()?,
        "matching.fine.scale_m" => matching.fine.1 = value.parse()?,
        "matching.acceleration" => matching.acceleration.0 = value.parse()?,
        "matching.turn_acceleration" => matching.acceleration.1 = value.parse()?,
        "matching.residual_m" => matching.residual_m = value.parse()?,
        "matching.min_influence" => matching.min_influence = value.parse()?,
        _ => anyhow::bail!("there is no setting {name}"),
    }
    Ok(())
}
