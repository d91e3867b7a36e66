//! Expected number of points on an object: rays per solid angle, distance and number of sweeps.

use crate::settings::Kind;
use messages::{SubmapPoint, SubmapSweep};
use std::collections::BTreeMap;

/// Objects nearer than this are treated as at this distance, m: nearer ones are only partly in the view of a LiDAR.
const MIN_RANGE_M: f64 = 5.0;

/// Rays of the sweeps of a submap.
pub struct Density {
    /// For each sweep: position of the LiDAR, m, and rays per steradian.
    sweeps: Vec<([f64; 3], f64)>,
}

impl Density {
    /// Computes the density from the sweeps of a submap. `points` are sorted by sweep.
    pub fn from_sweeps(sweeps: &[SubmapSweep], points: &[SubmapPoint]) -> Self {
        let n_lidars = sweeps.iter().map(|sweep| sweep.lidar as usize + 1).max().unwrap_or_default();
        let rays: Vec<f64> = (0..n_lidars as u32)
            .map(|lidar| {
                // The sweep with the most points has the fewest columns without a return.
                let of_lidar = sweeps.iter().filter(|sweep| sweep.lidar == lidar);
                of_lidar.max_by_key(|sweep| sweep.n_points).map_or(0.0, |sweep| rays_per_steradian(sweep, points))
            })
            .collect();
        let place = |sweep: &SubmapSweep| {
            let begin = &sweep.submap_from_lidar_begin;
            let end = &sweep.submap_from_lidar_end;
            std::array::from_fn(|axis| 0.5 * f64::from(begin[axis] + end[axis]))
        };
        Self { sweeps: sweeps.iter().map(|sweep| (place(sweep), rays[sweep.lidar as usize])).collect() }
    }

    /// Expected points of a typical object of the class at the position of these points, over all sweeps. `None` if the
    /// rays of a sweep are unknown.
    pub fn expected(&self, points: &[SubmapPoint], object: &[u32], kind: &Kind) -> Option<f64> {
        // The visible face of an object is its front or its side.
        let face_m2 = 0.5 * kind.length_m * kind.height_m;
        let mut center = [0.0; 3];
        for point in object.iter().map(|&point_idx| &points[point_idx as usize]) {
            for (sum, value) in center.iter_mut().zip([point.x, point.y, point.z]) {
                *sum += f64::from(value) / object.len() as f64;
            }
        }
        let of_sweep = |(lidar, rays): &([f64; 3], f64)| {
            let squared_m2: f64 = (0..3).map(|axis| (center[axis] - lidar[axis]).powi(2)).sum();
            (*rays > 0.0).then(|| rays * face_m2 / squared_m2.max(MIN_RANGE_M * MIN_RANGE_M))
        };
        let sum: Option<f64> = self.sweeps.iter().map(of_sweep).sum();
        sum.filter(|_| !self.sweeps.is_empty())
    }
}

/// Columns of the ring with most returns, and rings over their range of elevations. Without rings, the returns; 0 if the elevations are
/// unknown.
fn rays_per_steradian(sweep: &SubmapSweep, points: &[SubmapPoint]) -> f64 {
    let begin = (sweep.first_point as usize).min(points.len());
    let end = (begin + sweep.n_points as usize).min(points.len());
    let mut n_of_ring = [0_u32; 256];
    let mut lowest = i16::MAX;
    let mut highest = i16::MIN;
    for point in &points[begin..end] {
        n_of_ring[usize::from(point.ring)] += 1;
        lowest = lowest.min(point.elevation);
        highest = highest.max(point.elevation);
    }
    let n_rings = n_of_ring.iter().filter(|n| **n > 0).count();
    if highest <= lowest {
        return 0.0;
    }
    if n_rings < 2 {
        return returns_per_steradian(&points[begin..end]);
    }
    let columns = f64::from(n_of_ring.into_iter().max().unwrap_or_default());
    let range_rad = (f64::from(highest - lowest) * 0.01).to_radians();
    columns / std::f64::consts::TAU * (n_rings - 1) as f64 / range_rad
}

/// Width of the cells in which the returns are counted, in hundredths of a degree: several rings of any LiDAR.
const CELL_CENTIDEGREES: i32 = 200;

/// Density of the returns of a sweep without rings: the median over the directions with returns. Rays without a return are missing, so it is
/// a lower bound.
fn returns_per_steradian(points: &[SubmapPoint]) -> f64 {
    let mut n_of_cell: BTreeMap<[i32; 2], u32> = BTreeMap::new();
    for point in points {
        let cell =
            [i32::from(point.elevation), i32::from(point.azimuth)].map(|angle| angle.div_euclid(CELL_CENTIDEGREES));
        *n_of_cell.entry(cell).or_default() += 1;
    }
    let side_rad = (f64::from(CELL_CENTIDEGREES) * 0.01).to_radians();
    let density = |(&[row, _], &n): (&[i32; 2], &u32)| {
        let elevation_rad = (f64::from(row) + 0.5) * side_rad;
        f64::from(n) / (side_rad * side_rad * elevation_rad.cos().max(0.1))
    };
    let mut densities: Vec<f64> = n_of_cell.iter().map(density).collect();
    densities.sort_by(f64::total_cmp);
    densities.get(densities.len() / 2).copied().unwrap_or_default()
}
