//! Position from code ranges: weighted least squares with outlier rejection.
//!
//! The unknowns are the position error in the world frame, the receiver clock and the offset of Galileo time, all in m.
//! Satellites are 20 000 km away, so the equations are linear within a millimetre for the errors that occur here.

use super::sky::System;
use geometry::Vector3;
use nalgebra::{Matrix5, Vector5};

/// Largest PDOP of a valid position.
const MAX_PDOP: f64 = 20.0;
/// Outlier threshold, in standard deviations.
const MAX_RESIDUAL: f64 = 3.5;

/// One code range.
#[derive(Clone, Copy, Debug)]
pub struct CodeRange {
    /// System, which selects the clock.
    pub system: System,
    /// Unit vector towards the satellite, world frame.
    pub direction: Vector3<f64>,
    /// Measured minus true range, m.
    pub error_m: f64,
    /// Standard deviation assumed by the receiver, m.
    pub sigma_m: f64,
    /// Ground truth: whether only a reflection was received.
    pub is_reflected: bool,
}

/// A position.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Its error in the world frame, m.
    pub error: Vector3<f64>,
    /// Variances assumed by the receiver, by axis of the world frame, m^2.
    pub variances: Vector3<f64>,
    /// Horizontal dilution of precision.
    pub hdop: f64,
    /// Ranges in the solution.
    pub used: Vec<CodeRange>,
}

/// Position from consistent ranges; `None` if there are too few or the geometry is degenerate.
pub fn solve(mut ranges: Vec<CodeRange>) -> Option<Solution> {
    loop {
        let LeastSquares { solution, residuals } = least_squares(&ranges)?;
        let worst = residuals.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        match worst {
            // At least one range more than unknowns must remain; otherwise there are no residuals.
            Some((index, residual)) if residual > MAX_RESIDUAL && ranges.len() > n_unknowns(&ranges) + 1 => {
                ranges.remove(index);
            }
            _ => return Some(Solution { used: ranges, ..solution }),
        }
    }
}

fn n_unknowns(ranges: &[CodeRange]) -> usize {
    let has = |system| usize::from(ranges.iter().any(|range| range.system == system));
    3 + has(System::Gps) + has(System::Galileo)
}

struct LeastSquares {
    /// The solution without its ranges.
    solution: Solution,
    /// Each residual in its standard deviations.
    residuals: Vec<f64>,
}

fn least_squares(ranges: &[CodeRange]) -> Option<LeastSquares> {
    if ranges.len() < n_unknowns(ranges) {
        return None;
    }
    let mut weighted = Matrix5::zeros();
    let mut plain = Matrix5::zeros();
    let mut right = Vector5::zeros();
    for range in ranges {
        let row = row(range);
        let weight = range.sigma_m.powi(-2);
        weighted += row * row.transpose() * weight;
        plain += row * row.transpose();
        right += row * (weight * range.error_m);
    }
    // Clocks of systems without ranges.
    for system in [System::Gps, System::Galileo] {
        if !ranges.iter().any(|range| range.system == system) {
            weighted[(clock(system), clock(system))] = 1.0;
            plain[(clock(system), clock(system))] = 1.0;
        }
    }
    let covariance = weighted.try_inverse()?;
    let shape = plain.try_inverse()?;
    let pdop2 = shape[(0, 0)] + shape[(1, 1)] + shape[(2, 2)];
    // Also rejects degenerate geometry after rounding.
    if !(0.0..=MAX_PDOP * MAX_PDOP).contains(&pdop2) {
        return None;
    }
    let state = covariance * right;
    let residual = |range: &CodeRange| (range.error_m - row(range).dot(&state)).abs() / range.sigma_m;
    let solution = Solution {
        error: state.fixed_rows::<3>(0).into(),
        variances: covariance.diagonal().fixed_rows::<3>(0).into(),
        hdop: (shape[(0, 0)] + shape[(1, 1)]).sqrt(),
        used: Vec::new(),
    };
    Some(LeastSquares { solution, residuals: ranges.iter().map(residual).collect() })
}

const fn clock(system: System) -> usize {
    match system {
        System::Gps => 3,
        System::Galileo => 4,
    }
}

/// Derivative of a range with respect to the unknowns.
fn row(range: &CodeRange) -> Vector5<f64> {
    let d = range.direction;
    let mut row = Vector5::new(-d.x, -d.y, -d.z, 0.0, 0.0);
    row[clock(range.system)] = 1.0;
    row
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::gnss::sky::Sky;

    /// Ranges that a receiver at `off` with the given clocks would measure.
    fn ranges(off: Vector3<f64>, clocks: [f64; 2]) -> Vec<CodeRange> {
        let high = Sky::new(5).above(0.0).into_iter().filter(|s| s.direction.z > 0.2);
        high.map(|s| CodeRange {
            system: s.system,
            direction: s.direction,
            error_m: clocks[clock(s.system) - 3] - s.direction.dot(&off),
            sigma_m: 1.0,
            is_reflected: false,
        })
        .collect()
    }

    #[test]
    fn solution_separates_position_from_clocks() {
        let off = Vector3::new(3.0, -2.0, 7.0);
        let solution = solve(ranges(off, [100.0, -40.0])).expect("a fix");
        assert!((solution.error - off).norm() < 1e-9, "{solution:?}");
        assert!((0.3..1.5).contains(&solution.hdop), "{}", solution.hdop);
    }

    #[test]
    fn outlier_range_is_excluded() {
        let mut ranges = ranges(Vector3::zeros(), [0.0; 2]);
        let n = ranges.len();
        ranges[4].error_m += 60.0;
        let solution = solve(ranges).expect("a fix");
        assert_eq!(solution.used.len(), n - 1);
        assert!(solution.error.norm() < 1e-9);
    }

    #[test]
    fn too_few_or_one_sided_ranges_give_no_fix() {
        let all = ranges(Vector3::zeros(), [0.0; 2]);
        let gps: Vec<CodeRange> = all.iter().copied().filter(|r| r.system == System::Gps).collect();
        assert!(solve(gps[..4].to_vec()).is_some());
        assert!(solve(gps[..3].to_vec()).is_none());
        let mut together = gps[..4].to_vec();
        for (i, range) in together.iter_mut().enumerate() {
            range.direction = Vector3::new(0.01 * i as f64, 0.002 * (i * i) as f64, 1.0).normalize();
        }
        assert!(solve(together).is_none());
    }
}
