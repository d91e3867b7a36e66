//! Rays of the sweeps: whether a place was free when another sweep looked at it.
//!
//! A moving object leaves free space behind it and enters free space. The stage `slam_aggregate` marks a point where an *earlier* sweep saw
//! free space. It cannot mark a vehicle ahead that drives at the LiDAR's speed: the vehicle itself hides its next places. Later sweeps
//! of the submap see them.

use messages::{SubmapPoint, SubmapSweep};
use std::cell::OnceCell;

/// Width of a bin of azimuths. A sweep has 360 of them.
const BINS: usize = 360;

/// A ray passes through a place if it passes this close to its center, m: less than a quarter of the width of a car.
const RADIUS_M: f64 = 0.3;

/// Heights above the ground at which a ray passes through a place, m: above the noise of the ground, below the windows of a car.
const HEIGHTS_M: [f64; 2] = [0.2, 0.9];

/// A ray that ends within this distance of the center hits the place, m: half of the width of a car.
const DEPTH_M: f64 = 1.0;

/// What the rays of one sweep say about a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sight {
    /// Most rays pass through it.
    Free,
    /// Most rays end at it.
    Occupied,
    /// No ray reaches it.
    Unknown,
}

/// The rays of a submap, sorted by sweep and azimuth when they are first needed.
pub struct Rays<'a> {
    points: &'a [SubmapPoint],
    sweeps: &'a [SubmapSweep],
    /// For each sweep and bin of azimuths, its points.
    bins: OnceCell<Vec<Vec<u32>>>,
}

impl<'a> Rays<'a> {
    /// The rays from the LiDAR to the points of a submap. `points` are sorted by sweep.
    pub fn new(sweeps: &'a [SubmapSweep], points: &'a [SubmapPoint]) -> Self {
        Self { points, sweeps, bins: OnceCell::new() }
    }

    /// Times of the middle of each sweep, ns since the Unix epoch.
    pub(crate) fn sweep_nanos(&self) -> impl Iterator<Item = i64> {
        self.sweeps.iter().map(|sweep| sweep.stamp.saturating_add(i64::from(sweep.duration_nanos / 2)))
    }

    /// Position of the LiDAR in the middle of a sweep, m.
    pub(crate) fn lidar_at(&self, sweep: usize) -> [f64; 3] {
        lidar_at(&self.sweeps[sweep], 0.5)
    }

    /// What a sweep saw at a place on the ground.
    pub(crate) fn sight(&self, sweep: usize, center: [f64; 2], ground_m: f64) -> Sight {
        let bins = self.bins.get_or_init(|| self.sorted());
        let [begin, end] = [0.0, 1.0].map(|share| lidar_at(&self.sweeps[sweep], share));
        let middle = self.lidar_at(sweep);
        let range_m = (center[0] - middle[0]).hypot(center[1] - middle[1]);
        // The LiDAR sees the place under another azimuth at the start and at the end of the sweep.
        let shift_m = 0.5 * (end[0] - begin[0]).hypot(end[1] - begin[1]);
        if range_m <= 2.0 * (shift_m + DEPTH_M) {
            return Sight::Unknown;
        }
        let width = (((shift_m + RADIUS_M) / range_m).atan().to_degrees() / (360.0 / BINS as f64)).ceil() as usize;
        let first = bin(center[0] - middle[0], center[1] - middle[1]) + BINS - width;
        let mut n_through = 0;
        let mut n_hits = 0;
        for at in first..=first + 2 * width {
            for &point_idx in &bins[sweep * BINS + at % BINS] {
                let point = &self.points[point_idx as usize];
                let from = lidar_at(&self.sweeps[sweep], share_of_sweep(&self.sweeps[sweep], point));
                let ray = [f64::from(point.x) - from[0], f64::from(point.y) - from[1]];
                let to_center = [center[0] - from[0], center[1] - from[1]];
                let length_m = ray[0].hypot(ray[1]);
                let along_m = (ray[0] * to_center[0] + ray[1] * to_center[1]) / length_m;
                let off_m = (ray[0] * to_center[1] - ray[1] * to_center[0]).abs() / length_m;
                if off_m > RADIUS_M || along_m <= 0.0 || length_m < along_m - DEPTH_M {
                    continue;
                }
                let height_m = from[2] + (f64::from(point.z) - from[2]) * along_m / length_m - ground_m;
                if (HEIGHTS_M[0]..=HEIGHTS_M[1]).contains(&height_m) {
                    let is_through = length_m > along_m + DEPTH_M;
                    n_through += u32::from(is_through);
                    n_hits += u32::from(!is_through);
                }
            }
        }
        match n_through + n_hits {
            0 => Sight::Unknown,
            _ if n_through > n_hits => Sight::Free,
            _ => Sight::Occupied,
        }
    }

    fn sorted(&self) -> Vec<Vec<u32>> {
        let mut bins = vec![Vec::new(); self.sweeps.len() * BINS];
        for (number, sweep) in self.sweeps.iter().enumerate() {
            let begin = (sweep.first_point as usize).min(self.points.len());
            let end = begin.saturating_add(sweep.n_points as usize).min(self.points.len());
            for (point_idx, point) in (begin..).zip(&self.points[begin..end]) {
                let from = lidar_at(sweep, share_of_sweep(sweep, point));
                let [x, y] = [f64::from(point.x) - from[0], f64::from(point.y) - from[1]];
                if x.is_finite() && y.is_finite() && point.z.is_finite() && x.hypot(y) > 0.0 {
                    bins[number * BINS + bin(x, y)].push(point_idx as u32);
                }
            }
        }
        bins
    }
}

fn bin(x: f64, y: f64) -> usize {
    let turns = y.atan2(x) / std::f64::consts::TAU + 0.5;
    ((turns * BINS as f64) as usize).min(BINS - 1)
}

/// Time of a point since the start of its sweep, as a share of the duration.
fn share_of_sweep(sweep: &SubmapSweep, point: &SubmapPoint) -> f64 {
    (f64::from(point.offset_nanos) / f64::from(sweep.duration_nanos.max(1))).min(1.0)
}

fn lidar_at(sweep: &SubmapSweep, share: f64) -> [f64; 3] {
    std::array::from_fn(|axis| {
        let begin = f64::from(sweep.submap_from_lidar_begin[axis]);
        begin + share * (f64::from(sweep.submap_from_lidar_end[axis]) - begin)
    })
}
