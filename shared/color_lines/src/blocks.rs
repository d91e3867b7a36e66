//! The inner loops: densities of a block of points under all Gaussians.

#![allow(clippy::needless_range_loop, reason = "loops of fixed length over several arrays are vectorized")]

use crate::exponential::exponential;
use crate::gaussian::Normalized;
use crate::space::Points;

/// Points of a block: the densities of a few dozen Gaussians fit into the first-level cache.
const BLOCK: usize = 128;
/// Partial sums, so that loops over them are vectorized; their number does not depend on the machine.
const LANES: usize = 8;
/// Density below the largest one of a point, as a logarithm, that changes no sum of 53 bits.
const NEGLIGIBLE: f64 = -40.0;

/// Values by point of a block.
type Lane = [f64; BLOCK];

/// What the points of a mixture give a Gaussian.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Share {
    /// Sum of responsibilities, of responsibilities times the difference d to the Gaussian's mean, and times dx dx, dx dy, dx dz,
    /// dy dy, dy dz, dz dz. Differences, because squares of coordinates would cancel.
    pub sums: [f64; 10],
}

/// The points of one block; unused places repeat the last point.
struct Block {
    points: [Lane; 3],
    n: usize,
}

/// Buffers of a pass.
struct Scratch {
    /// By Gaussian.
    densities: Vec<Lane>,
    largest: Lane,
}

impl Block {
    #[inline(always)]
    fn load(&mut self, points: &Points, start: usize) {
        self.n = BLOCK.min(points.len() - start);
        for (lane, axis) in self.points.iter_mut().zip(&points.0) {
            lane[..self.n].copy_from_slice(&axis[start..start + self.n]);
            let last = lane[self.n - 1];
            lane[self.n..].fill(last);
        }
    }
}

/// Fills the densities, and the largest of each point.
#[inline(always)]
fn densities(block: &Block, gaussians: &[Normalized], scratch: &mut Scratch) {
    let [x, y, z] = &block.points;
    scratch.largest = [f64::NEG_INFINITY; BLOCK];
    for (gaussian, out) in gaussians.iter().zip(&mut scratch.densities) {
        let ([mx, my, mz], f, constant) = (gaussian.mean, gaussian.factor, gaussian.constant);
        for i in 0..BLOCK {
            let (dx, dy, dz) = (x[i] - mx, y[i] - my, z[i] - mz);
            let (a, b, c) = (f[0] * dx, f[1] * dx + f[2] * dy, f[3] * dx + f[4] * dy + f[5] * dz);
            let density = constant - (a * a + b * b + c * c);
            out[i] = density;
            scratch.largest[i] = if density > scratch.largest[i] { density } else { scratch.largest[i] };
        }
    }
}

/// Adds the points to the shares of the Gaussians. Returns the sum of the logarithmic densities of the mixture at the points.
pub(crate) fn expectation(points: &Points, gaussians: &[Normalized], shares: &mut [Share]) -> f64 {
    let mut block = Block { points: [[0.0; BLOCK]; 3], n: 0 };
    let mut scratch = Scratch { densities: vec![[0.0; BLOCK]; gaussians.len()], largest: [0.0; BLOCK] };
    let mut is_near = vec![false; gaussians.len()];
    let mut log_likelihood = 0.0;
    wide_loops::run(
        #[inline(always)]
        || {
            for start in (0..points.len()).step_by(BLOCK) {
                block.load(points, start);
                densities(&block, gaussians, &mut scratch);
                let mut sums = [0.0; BLOCK];
                for (densities, near) in scratch.densities.iter_mut().zip(&mut is_near) {
                    *near = nearest_approach(densities, &scratch.largest) > NEGLIGIBLE;
                    if *near {
                        for i in 0..BLOCK {
                            densities[i] = exponential(densities[i] - scratch.largest[i]);
                            sums[i] += densities[i];
                        }
                    }
                }
                log_likelihood += (0..block.n).map(|i| scratch.largest[i] + sums[i].ln()).sum::<f64>();
                let mut factors = [0.0; BLOCK];
                for i in 0..block.n {
                    factors[i] = 1.0 / sums[i];
                }
                let near = scratch.densities.iter().zip(gaussians).zip(&mut *shares).zip(&is_near);
                for (((densities, gaussian), share), _) in near.filter(|(_, near)| **near) {
                    add(&block, &gaussian.mean, densities, &factors, share);
                }
            }
        },
    );
    log_likelihood
}

/// The largest difference of a density to the largest one of its point.
#[inline(always)]
fn nearest_approach(densities: &Lane, largest: &Lane) -> f64 {
    let mut lanes = [f64::NEG_INFINITY; LANES];
    for chunk in 0..BLOCK / LANES {
        for lane in 0..LANES {
            let difference = densities[chunk * LANES + lane] - largest[chunk * LANES + lane];
            lanes[lane] = if difference > lanes[lane] { difference } else { lanes[lane] };
        }
    }
    lanes.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

#[inline(always)]
fn add(block: &Block, mean: &[f64; 3], densities: &Lane, factors: &Lane, share: &mut Share) {
    let [x, y, z] = &block.points;
    let mut sums = [[0.0; LANES]; 10];
    for chunk in 0..BLOCK / LANES {
        for lane in 0..LANES {
            let i = chunk * LANES + lane;
            let r = densities[i] * factors[i];
            let (dx, dy, dz) = (x[i] - mean[0], y[i] - mean[1], z[i] - mean[2]);
            let (rx, ry, rz) = (r * dx, r * dy, r * dz);
            let terms = [r, rx, ry, rz, rx * dx, rx * dy, rx * dz, ry * dy, ry * dz, rz * dz];
            for k in 0..10 {
                sums[k][lane] += terms[k];
            }
        }
    }
    share.sums.iter_mut().zip(&sums).for_each(|(sum, lanes)| *sum += lanes.iter().sum::<f64>());
}

/// The Gaussian of the highest density of each point; the first of equal ones.
pub(crate) fn classify(points: &Points, gaussians: &[Normalized]) -> Vec<u32> {
    let mut block = Block { points: [[0.0; BLOCK]; 3], n: 0 };
    let mut scratch = Scratch { densities: vec![[0.0; BLOCK]; 1], largest: [0.0; BLOCK] };
    let mut found = Vec::with_capacity(points.len());
    wide_loops::run(
        #[inline(always)]
        || {
            for start in (0..points.len()).step_by(BLOCK) {
                block.load(points, start);
                let (mut best, mut highest) = ([0_u64; BLOCK], [f64::NEG_INFINITY; BLOCK]);
                for (index, gaussian) in (0..).zip(gaussians) {
                    densities(&block, std::slice::from_ref(gaussian), &mut scratch);
                    for i in 0..BLOCK {
                        let is_higher = scratch.densities[0][i] > highest[i];
                        best[i] = if is_higher { index } else { best[i] };
                        highest[i] = if is_higher { scratch.densities[0][i] } else { highest[i] };
                    }
                }
                found.extend(best[..block.n].iter().map(|index| *index as u32));
            }
        },
    );
    found
}
