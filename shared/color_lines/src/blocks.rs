//! The inner loops: densities of a block of points under all Gaussians.

#![allow(clippy::needless_range_loop, reason = "loops of fixed length over several arrays are vectorized")]

use crate::exponential::exponential;
use crate::gaussian::Normalized;
use crate::space::Points;

/// Points per block: the densities of a few dozen Gaussians fit into the first-level cache.
const BLOCK: usize = 128;
/// Number of partial sums, so that loops over them are vectorized; it does not depend on the machine.
const LANES: usize = 8;
/// Logarithmic density, relative to the largest one of a point, that changes no sum of 53 bits: ln 2^-53 = -36.7.
const NEGLIGIBLE: f64 = -37.0;

/// Values of each point of a block.
type Lane = [f64; BLOCK];

/// Contribution of the points of a mixture to a Gaussian.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Share {
    /// Sums over the points, in this order: responsibility r, r dx, r dy, r dz, r dx dx, r dx dy, r dx dz, r dy dy, r dy
    /// dz, r dz dz. Here d is the difference to the mean of the Gaussian. Differences are used because squares of
    /// coordinates would cancel.
    pub sums: [f64; 10],
}

/// The points of one block; unused slots repeat the last point.
struct Block {
    points: [Lane; 3],
    n: usize,
    /// Center and half sides of the bounding box.
    middle: [f64; 3],
    half: [f64; 3],
}

/// Densities of a block.
struct Densities {
    /// Indices of the Gaussians that can be relevant for a point of the block.
    near: Vec<usize>,
    /// Densities of each Gaussian; only the entries listed in `near` are current.
    values: Vec<Lane>,
    /// Largest density of each point.
    largest: Lane,
    /// Largest density of each Gaussian at any point of the bounding box.
    bounds: Vec<f64>,
}

impl Block {
    const fn new() -> Self {
        Self { points: [[0.0; BLOCK]; 3], n: 0, middle: [0.0; 3], half: [0.0; 3] }
    }

    #[inline(always)]
    fn load(&mut self, points: &Points, start: usize) {
        self.n = BLOCK.min(points.len() - start);
        for (k, (lane, axis)) in self.points.iter_mut().zip(&points.0).enumerate() {
            lane[..self.n].copy_from_slice(&axis[start..start + self.n]);
            let last = lane[self.n - 1];
            lane[self.n..].fill(last);
            let mut low = [f64::INFINITY; LANES];
            let mut high = [f64::NEG_INFINITY; LANES];
            for chunk in 0..BLOCK / LANES {
                for i in 0..LANES {
                    let value = lane[chunk * LANES + i];
                    low[i] = if value < low[i] { value } else { low[i] };
                    high[i] = if value > high[i] { value } else { high[i] };
                }
            }
            let low = low.into_iter().fold(f64::INFINITY, f64::min);
            let high = high.into_iter().fold(last, f64::max);
            self.middle[k] = 0.5 * (low + high);
            self.half[k] = 0.5 * (high - low);
        }
    }

    /// The smallest and the largest density that a Gaussian can have in the bounding box.
    #[inline(always)]
    fn bounds(&self, gaussian: &Normalized) -> [f64; 2] {
        let f = gaussian.factor;
        let d: [f64; 3] = std::array::from_fn(|k| self.middle[k] - gaussian.mean[k]);
        let middles = [f[0] * d[0], f[1] * d[0] + f[2] * d[1], f[3] * d[0] + f[4] * d[1] + f[5] * d[2]];
        let h = self.half;
        let a = f.map(f64::abs);
        let slacks = [a[0] * h[0], a[1] * h[0] + a[2] * h[1], a[3] * h[0] + a[4] * h[1] + a[5] * h[2]];
        let mut least = 0.0;
        let mut most = 0.0;
        for (middle, slack) in middles.iter().zip(slacks) {
            let near = (middle.abs() - slack).max(0.0);
            let far = middle.abs() + slack;
            least += near * near;
            most += far * far;
        }
        [gaussian.constant - most, gaussian.constant - least]
    }
}

impl Densities {
    fn new(n_gaussians: usize) -> Self {
        Self {
            near: Vec::with_capacity(n_gaussians),
            values: vec![[0.0; BLOCK]; n_gaussians],
            largest: [0.0; BLOCK],
            bounds: vec![0.0; n_gaussians],
        }
    }

    /// Finds the Gaussians whose density can be within `reach` (at most 0) of the largest one at a point of the block.
    #[inline(always)]
    fn find_near(&mut self, block: &Block, gaussians: &[Normalized], reach: f64) {
        let mut sure = f64::NEG_INFINITY;
        for (bound, gaussian) in self.bounds.iter_mut().zip(gaussians) {
            let [least, most] = block.bounds(gaussian);
            *bound = most;
            sure = sure.max(least);
        }
        self.near.clear();
        let bounds = self.bounds.iter().enumerate();
        // The margin is far above rounding errors of densities.
        self.near.extend(bounds.filter(|(_, bound)| **bound >= sure + reach - 1e-6).map(|(index, _)| index));
    }

    /// Computes the densities of the near Gaussians, and the largest one of each point.
    #[inline(always)]
    fn fill(&mut self, block: &Block, gaussians: &[Normalized]) {
        let [x, y, z] = &block.points;
        self.largest = [f64::NEG_INFINITY; BLOCK];
        for index in &self.near {
            let Normalized { mean: [mx, my, mz], factor: f, constant } = gaussians[*index];
            let out = &mut self.values[*index];
            for i in 0..BLOCK {
                let dx = x[i] - mx;
                let dy = y[i] - my;
                let dz = z[i] - mz;
                let a = f[0] * dx;
                let b = f[1] * dx + f[2] * dy;
                let c = f[3] * dx + f[4] * dy + f[5] * dz;
                let density = constant - (a * a + b * b + c * c);
                out[i] = density;
                // `max` instead of a comparison: a comparison becomes a masked store, and the next load of the value
                // would wait for it.
                self.largest[i] = self.largest[i].max(density);
            }
        }
    }
}

/// Adds the points to the shares of the Gaussians. Returns the sum of the logarithmic densities of the mixture at the
/// points.
pub(crate) fn expectation(points: &Points, gaussians: &[Normalized], shares: &mut [Share]) -> f64 {
    let mut block = Block::new();
    let mut densities = Densities::new(gaussians.len());
    let mut log_likelihood = 0.0;
    wide_loops::run(
        #[inline(always)]
        || {
            for start in (0..points.len()).step_by(BLOCK) {
                block.load(points, start);
                densities.find_near(&block, gaussians, NEGLIGIBLE);
                densities.fill(&block, gaussians);
                let Densities { near, values, largest, .. } = &mut densities;
                let mut sums = [0.0; BLOCK];
                // A loop, not `retain`: its closure would not be inlined.
                let mut n_near = 0;
                for k in 0..near.len() {
                    let values = &mut values[near[k]];
                    if nearest_approach(values, largest) > NEGLIGIBLE {
                        for i in 0..BLOCK {
                            values[i] = exponential(values[i] - largest[i]);
                            sums[i] += values[i];
                        }
                        near[n_near] = near[k];
                        n_near += 1;
                    }
                }
                near.truncate(n_near);
                // A sum is at most the number of Gaussians, so a product of 16 does not overflow, and takes one logarithm.
                log_likelihood += largest[..block.n].iter().sum::<f64>();
                log_likelihood += sums[..block.n].chunks(16).map(|some| some.iter().product::<f64>().ln()).sum::<f64>();
                let mut factors = [0.0; BLOCK];
                for i in 0..block.n {
                    factors[i] = 1.0 / sums[i];
                }
                for index in near {
                    add(&block, &gaussians[*index].mean, &values[*index], &factors, &mut shares[*index]);
                }
            }
        },
    );
    log_likelihood
}

/// Largest difference between a density and the largest density of its point.
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

/// Adds the points of a block to the share of a Gaussian.
#[inline(always)]
fn add(block: &Block, mean: &[f64; 3], densities: &Lane, factors: &Lane, share: &mut Share) {
    let [x, y, z] = &block.points;
    let mut sums = [[0.0; LANES]; 10];
    for chunk in 0..BLOCK / LANES {
        for lane in 0..LANES {
            let i = chunk * LANES + lane;
            let r = densities[i] * factors[i];
            let dx = x[i] - mean[0];
            let dy = y[i] - mean[1];
            let dz = z[i] - mean[2];
            let rx = r * dx;
            let ry = r * dy;
            let rz = r * dz;
            let terms = [r, rx, ry, rz, rx * dx, rx * dy, rx * dz, ry * dy, ry * dz, rz * dz];
            for k in 0..10 {
                sums[k][lane] += terms[k];
            }
        }
    }
    share.sums.iter_mut().zip(&sums).for_each(|(sum, lanes)| *sum += lanes.iter().sum::<f64>());
}

/// The Gaussian of the highest density at each point; the first one of several equal ones.
pub(crate) fn classify(points: &Points, gaussians: &[Normalized]) -> Vec<u32> {
    let mut block = Block::new();
    let mut densities = Densities::new(gaussians.len());
    let mut found = Vec::with_capacity(points.len());
    wide_loops::run(
        #[inline(always)]
        || {
            for start in (0..points.len()).step_by(BLOCK) {
                block.load(points, start);
                densities.find_near(&block, gaussians, 0.0);
                densities.fill(&block, gaussians);
                let Densities { near, values, largest, .. } = &densities;
                let mut best = [u64::MAX; BLOCK];
                for index in near.iter().rev() {
                    for i in 0..BLOCK {
                        let is_largest = u64::from(values[*index][i] == largest[i]).wrapping_neg();
                        best[i] = (best[i] & !is_largest) | (*index as u64 & is_largest);
                    }
                }
                found.extend(best[..block.n].iter().map(|index| *index as u32));
            }
        },
    );
    found
}
