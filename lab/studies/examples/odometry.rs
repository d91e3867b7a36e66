//! Runs the odometry on a folder of sweeps (layout: `studies::sweep_folder`), for comparison with other implementations:
//! `odometry FOLDER POSES [--sweeps N] [--set NAME=VALUE ...] [--algorithm imls] [--motion imu,gnss] [--untimed none] [--verbose]`.
//!
//! `--algorithm imls` selects IMLS-SLAM as published. `--motion` names the sensors that predict the motion. `--untimed none`
//! treats sweeps without point times as rigid; by default the sense of the rotation, in 0.1 s or less, is determined.
//! `--verbose` also prints pose, standard deviations and match of each sweep.
//!
//! Writes `world_from_lidar` at the last shot of each sweep, or without point times in its middle, in KITTI format. Prints the CPU time of all threads per sweep for range
//! image, features, registration and deskewed cloud, without reading.

use geometry::Pose;
use nalgebra::Vector6;
use registration::{
    Algorithm, DeskewTable, ImlsSettings, OdometrySettings, Registered, Sampling, SelectedOdometry, Stretches, Sweep,
    Weights,
};
use rustix::time::{ClockId, clock_gettime};
use std::path::Path;
use studies::sweep_folder::{SweepFolder, kitti_line};

/// Longest time of a revolution of sensors without point times, s.
const UNTIMED_TURN_S: f64 = 0.1;

/// Value of the setting `max_lost_m` of `slam_aggregate`.
const MAX_LOST_M: f64 = 5.0;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let mut paths = Vec::new();
    let mut settings = OdometrySettings::default();
    let mut n_sweeps = usize::MAX;
    let mut verbose = false;
    let mut motion = String::new();
    settings.untimed_turn_s = Some(UNTIMED_TURN_S);
    let mut imls = ImlsSettings::default();
    let mut algorithm = String::from("scan_to_map");
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| anyhow::anyhow!("{argument} needs a value"));
        match argument.as_str() {
            "--sweeps" => n_sweeps = value()?.parse()?,
            "--set" => set(&mut settings, &mut imls, &value()?)?,
            "--algorithm" => algorithm = value()?,
            "--untimed" if value()? == "none" => settings.untimed_turn_s = None,
            "--motion" => motion = value()?,
            "--verbose" => verbose = true,
            _ => paths.push(argument),
        }
    }
    let [sweeps, poses] = &paths[..] else { anyhow::bail!("usage: odometry FOLDER POSES [--set NAME=VALUE]") };
    let folder = SweepFolder::open(Path::new(sweeps))?;
    settings.mounting = folder.sensor_mounting()?;
    let algorithm = match algorithm.as_str() {
        "scan_to_map" => Algorithm::ScanToMap,
        "imls" => Algorithm::Imls(imls),
        _ => anyhow::bail!("--algorithm {algorithm}: must be scan_to_map or imls"),
    };
    let mut odometry = SelectedOdometry::new(settings, algorithm, folder.mounting);
    let uses = |name: &str| motion.split(',').any(|wanted| wanted == name);
    let samples = if uses("imu") { folder.inertial()? } else { Vec::new() };
    let velocities = if uses("gnss") { folder.velocities()? } else { Vec::new() };
    let mut samples = samples.into_iter().peekable();
    let mut velocities = velocities.into_iter().peekable();
    let mut ms = Vec::new();
    let mut text = String::new();
    let mut n_points = 0;
    let mut n_timed = 0;
    let mut scores = MovingScores::default();
    let mut consistency = Consistency::new(&folder, verbose);
    let mut stretches = Stretches::default();
    let mut waiting: Vec<Sweep> = Vec::new();
    for number in 0..folder.len().min(n_sweeps) {
        let (points, n_rings) = folder.points(number)?;
        let turning =
            odometry.turning_at(folder.stamp(number)).filter(|_| points.iter().all(|point| point.offset_nanos == 0));
        n_points += points.len();
        let start = cpu_ms();
        let sweep = match turning {
            Some(turning) => Sweep::spinning(folder.stamp(number), points, n_rings, turning),
            None => Sweep::new(folder.stamp(number), points, n_rings),
        };
        n_timed += usize::from(turning.is_some());
        let end = sweep.stamp().plus_nanos(i64::from(sweep.duration_nanos()));
        std::iter::from_fn(|| samples.next_if(|s| s.stamp <= end)).for_each(|sample| odometry.add_imu(sample));
        std::iter::from_fn(|| velocities.next_if(|v| v.stamp <= end)).for_each(|velocity| odometry.add_gnss(velocity));
        let registered = odometry.register(&sweep)?;
        waiting.push(sweep);
        let first = number + 1 - waiting.len();
        for (sweep, registered) in waiting.drain(..registered.len()).zip(&registered) {
            std::hint::black_box(deskewed(&sweep, registered));
        }
        ms.push(cpu_ms() - start);
        for (number, registered) in (first..).zip(&registered) {
            scores.add(&registered.moving, folder.moving(number)?.as_deref());
            // Without its own point times, a sweep has the pose of the direction ahead.
            let pose = if n_timed > 0 { registered.motion.mid } else { registered.end() };
            text.push_str(&kitti_line(&pose));
            stretches.add(registered).into_iter().for_each(|text| println!("note: {text}"));
            if verbose {
                report(registered, ms[ms.len() - 1]);
            }
            consistency.add(number, registered);
        }
    }
    if let Some(alone) = odometry.finish() {
        text.push_str(&kitti_line(&alone.end()));
    }
    std::fs::write(poses, text)?;
    let n = ms.len();
    // Without the first sweeps, which warm the caches and search the initial speed.
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
        odometry.map().len()
    );
    if let Some(spin) = odometry.turning() {
        println!("the sensor turns {spin:?}: {n_timed} sweeps got point times");
    }
    scores.print();
    consistency.print();
    stretches.finish().into_iter().for_each(|text| println!("note: {text}"));
    for doubt in [stretches.contested(0.0), stretches.lost(MAX_LOST_M)].into_iter().flatten() {
        println!("doubt: {doubt}");
    }
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
            let precision = share(self.flagged);
            let recall = share(self.moving);
            println!("moving: {} points, precision {precision:.1} %, recall {recall:.1} %", self.moving);
        }
    }
}

/// Normalized errors of poses, sampled once per second of the drive.
struct Consistency {
    truth: Vec<Pose>,
    /// Prints the errors of each sweep.
    verbose: bool,
    first: Option<(Pose, Pose)>,
    /// Normalized squared errors of position, rotation and pose: 3, 3 and 6 if the covariances are right.
    squares: Vec<[f64; 3]>,
    /// Last error of the position and its standard deviation, m.
    last: [f64; 2],
    n_degenerate: usize,
    n_bridged: usize,
}

impl Consistency {
    fn new(folder: &SweepFolder, verbose: bool) -> Self {
        Self {
            truth: folder.truth(),
            verbose,
            first: None,
            squares: Vec::new(),
            last: [0.0; 2],
            n_degenerate: 0,
            n_bridged: 0,
        }
    }
    fn add(&mut self, number: usize, registered: &Registered) {
        self.n_bridged += usize::from(registered.is_bridged());
        self.n_degenerate += usize::from(registered.matched.as_ref().is_some_and(|m| m.n_degenerate_directions > 0));
        let Some(truth) = self.truth.get(number) else { return };
        let (first_true, first_found) = *self.first.get_or_insert((*truth, registered.end()));
        let expected = first_found * first_true.inverse() * truth;
        let found = registered.end();
        let position = found.translation.vector - expected.translation.vector;
        let rotation = (found.rotation * expected.rotation.inverse()).scaled_axis();
        if self.verbose {
            println!(
                "error {:.3} {:.3} {:.3} m {:.5} {:.5} {:.5} rad",
                position.x, position.y, position.z, rotation.x, rotation.y, rotation.z
            );
        }
        if !number.is_multiple_of(10) || number == 0 {
            return;
        }
        let square = |error: geometry::Vector3<f64>, at: usize| {
            let block = registered.covariance.fixed_view::<3, 3>(at, at).into_owned();
            block.try_inverse().map_or(f64::NAN, |information| error.dot(&(information * error)))
        };
        let pose = Vector6::from_fn(|axis, _| if axis < 3 { position[axis] } else { rotation[axis - 3] });
        let of_pose =
            registered.covariance.try_inverse().map_or(f64::NAN, |information| pose.dot(&(information * pose)));
        self.squares.push([square(position, 0), square(rotation, 3), of_pose]);
        self.last = [position.norm(), registered.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt()];
    }
    fn print(&self) {
        println!("{} degenerate, {} bridged", self.n_degenerate, self.n_bridged);
        if !self.squares.is_empty() {
            let mean = |part: usize| self.squares.iter().map(|s| s[part]).sum::<f64>() / self.squares.len() as f64;
            println!(
                "normalized squared errors: position {:.1}, rotation {:.1} (3 expected), pose {:.1} (6 expected); last position off by \
                 {:.2} m, stated {:.2} m",
                mean(0),
                mean(1),
                mean(2),
                self.last[0],
                self.last[1]
            );
        }
    }
}

/// The dense cloud as the stage writes it.
fn deskewed(sweep: &Sweep, registered: &Registered) -> Vec<[f32; 3]> {
    let table = DeskewTable::new(&registered.begin(), &registered.end(), registered.duration_nanos);
    sweep.points().iter().map(|point| table.deskew(point.position, point.offset_nanos)).collect()
}

fn report(registered: &Registered, ms: f64) {
    let end = registered.end().translation.vector;
    let matched = registered.matched.as_ref().map(|m| {
        format!(
            "{}/{} matches, rms {:.4} m, cost {:.3}, least influence {:.4} ({} degenerate), converged {}",
            m.n_matches, m.n_features, m.rms_m, m.cost, m.least_influence, m.n_degenerate_directions, m.converged
        )
    });
    let seconds = registered.stamp.0 as f64 * 1e-9;
    let matched = matched.unwrap_or("bridged".to_owned());
    let deviation = |axis: usize| registered.covariance[(axis, axis)].sqrt();
    println!(
        "{seconds:.1} s, {ms:.1} ms, end {:.3} {:.3} {:.3}, deviation {:.3} {:.3} {:.3} m {:.5} {:.5} {:.5} rad, contrast {:.2}, {matched}",
        end.x,
        end.y,
        end.z,
        deviation(0),
        deviation(1),
        deviation(2),
        deviation(3),
        deviation(4),
        deviation(5),
        registered.contrast.unwrap_or(f64::NAN)
    );
}

fn cpu_ms() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 * 1e3 + now.tv_nsec as f64 * 1e-6
}

fn set(settings: &mut OdometrySettings, imls: &mut ImlsSettings, text: &str) -> anyhow::Result<()> {
    let (name, value) = text.split_once('=').ok_or_else(|| anyhow::anyhow!("--set {text}: expected NAME=VALUE"))?;
    let features = &mut settings.features;
    let map = &mut settings.map;
    let matching = &mut settings.matching;
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
            let spacing_m = spacing_m.parse()?;
            let max_features = max_features.parse()?;
            matching.sampling = Sampling::Even { spacing_m, max_features };
        }
        "matching.per_list" => matching.sampling = Sampling::NineLists { per_list: value.parse()? },
        "matching.gaussian_m" => matching.weights = Weights::Gaussian { h_m: value.parse()? },
        "matching.continuous_time" => matching.continuous_time = value.parse()?,
        "matching.small_step_m" => matching.small_step_m = value.parse()?,
        "matching.coarse_rounds" => matching.coarse_rounds = value.parse()?,
        "matching.max_rounds" => matching.max_rounds = value.parse()?,
        "matching.coarse.radius_m" => matching.coarse.radius_m = value.parse()?,
        "matching.coarse.scale_m" => matching.coarse.scale_m = value.parse()?,
        "matching.fine.radius_m" => matching.fine.radius_m = value.parse()?,
        "matching.fine.scale_m" => matching.fine.scale_m = value.parse()?,
        "matching.acceleration" => matching.acceleration.linear_mps2 = value.parse()?,
        "matching.turn_acceleration" => matching.acceleration.angular_radps2 = value.parse()?,
        "matching.residual_m" => matching.residual_m = value.parse()?,
        "matching.drift_residual_m" => matching.drift_residual_m = value.parse()?,
        "matching.min_influence" => matching.min_influence = value.parse()?,
        "imls.per_list" => imls.per_list = value.parse()?,
        "imls.h_m" => imls.h_m = value.parse()?,
        "imls.radius_m" => imls.radius_m = value.parse()?,
        "imls.rounds" => imls.rounds = value.parse()?,
        "imls.sweeps" => imls.sweeps = value.parse()?,
        _ => anyhow::bail!("unknown setting {name}"),
    }
    Ok(())
}
