//! Exposures made alike: the same wall should not change its color where one exposure ends and the next begins.
//!
//! Points that two exposures see tell how much brighter one is than the other. From them every exposure gets a gain, by weighted least
//! squares (gain compensation; Brown and Lowe, "Automatic Panoramic Image Stitching using Invariant Features", IJCV 2007, section 6). Colors are not mixed: where poses are a little off, a mixture of two exposures is blurred.

use crate::choose::{Sources, gap};
use crate::chunk::{CHUNK, Chunk, seconds};
use crate::color::Picture;
use messages::ColorRow;
use rayon::prelude::*;

/// Every so manyth point is looked at in all exposures: some thousand per submap, for some dozens of gains.
const THINNING: usize = 64;

/// Levels, of 255, between which a channel tells the brightness; beyond, the sensor or its noise does.
const USABLE: std::ops::RangeInclusive<u8> = 10..=240;

/// Two looks at a point whose brightness differs by more than this factor, as a logarithm, are of different things.
const MAX_LOG_RATIO: f64 = 1.0;

/// Deviation of a look's logarithm: above, it counts less (a Cauchy weight).
const DEVIATION: f64 = 0.1;

/// How sure it is, in looks, that a gain is 1 before anything is known: ten points are of one surface, and gains differ by 0.3.
const PRIOR: f64 = 2.0;

/// Rounds of weighing and solving: the fourth moves gains by less than 0.01.
const N_ROUNDS: usize = 4;

/// What colors of each exposure are multiplied by.
#[derive(Clone, Debug)]
pub struct Levels(Vec<f32>);

/// The same point in two exposures.
#[derive(Clone, Copy, Debug)]
pub struct Overlap {
    /// Indices of the exposures.
    pub views: [usize; 2],
    /// Where the point is on each, px.
    pub pixels: [[f32; 2]; 2],
}

impl Levels {
    /// Those that make the exposures most alike. `pictures` belong to the views by index.
    pub fn find(sources: &Sources<'_>, pictures: &[Picture<'_>]) -> Self {
        let look = |overlap: Overlap| Look::new(&overlap, pictures);
        let looks: Vec<Look> = overlaps(sources, THINNING, 0).into_iter().filter_map(look).collect();
        Self(fitted(&looks, sources.views.len()).into_iter().map(|log| (-log).exp() as f32).collect())
    }

    /// A color of an exposure as the mean of all would have it.
    #[inline]
    pub fn leveled(&self, row: ColorRow, view: usize) -> ColorRow {
        let [r, g, b] = [row.r, row.g, row.b].map(|level| (f32::from(level) * self.0[view] + 0.5) as u8);
        ColorRow { r, g, b, ..row }
    }
}

/// Points that stand still, every so manyth from `first` on, in all exposures that see them: each in the order of the views with the
/// next.
pub fn overlaps(sources: &Sources<'_>, every: usize, first: usize) -> Vec<Overlap> {
    let of_chunk = |chunk: &Chunk| {
        let near: Vec<usize> = (0..sources.views.len()).filter(|view| may_see(sources, *view, chunk)).collect();
        let mut overlaps = Vec::new();
        for i in (first..chunk.n_points.min(CHUNK)).step_by(every).filter(|i| chunk.moves[*i] == 0) {
            let mut last = None;
            for view in near.iter().copied() {
                let Some(pixel) = sources.seen(view, chunk, i) else { continue };
                if let Some((before, at)) = last.replace((view, pixel)) {
                    overlaps.push(Overlap { views: [before, view], pixels: [at, pixel] });
                }
            }
        }
        overlaps
    };
    sources.cloud.chunks().par_iter().flat_map_iter(of_chunk).collect()
}

fn may_see(sources: &Sources<'_>, view: usize, chunk: &Chunk) -> bool {
    let view = &sources.views[view];
    let time = seconds(view.stamp, sources.cloud.origin);
    gap(time, chunk.time_span) <= sources.limits.max_age_s && view.frustum.meets(&chunk.bounds)
}

/// What an overlap tells: the logarithm of the first exposure's gain, less that of the second.
struct Look {
    views: [usize; 2],
    log_ratio: f64,
}

impl Look {
    fn new(overlap: &Overlap, pictures: &[Picture<'_>]) -> Option<Self> {
        let level = |i: usize| {
            let ColorRow { r, g, b, .. } = pictures[overlap.views[i]].sample(overlap.pixels[i]);
            let is_usable = [r, g, b].iter().all(|level| USABLE.contains(level));
            is_usable.then(|| f64::from(r) + 2.0 * f64::from(g) + f64::from(b))
        };
        let log_ratio = (level(0)? / level(1)?).ln();
        (log_ratio.abs() < MAX_LOG_RATIO).then_some(Self { views: overlap.views, log_ratio })
    }
}

/// Logarithms of the gains of `n` views. Looks that contradict the solution before count less.
fn fitted(looks: &[Look], n: usize) -> Vec<f64> {
    let mut gains = vec![0.0; n];
    for _ in 0..N_ROUNDS {
        let mut matrix = vec![vec![0.0; n]; n];
        let mut right = vec![0.0; n];
        for (i, row) in matrix.iter_mut().enumerate() {
            row[i] = PRIOR;
        }
        for Look { views: [a, b], log_ratio } in looks {
            let rest = log_ratio - (gains[*a] - gains[*b]);
            let weight = 1.0 / (1.0 + (rest / DEVIATION).powi(2));
            right[*a] += weight * log_ratio;
            right[*b] -= weight * log_ratio;
            matrix[*a][*a] += weight;
            matrix[*b][*b] += weight;
            matrix[*a][*b] -= weight;
            matrix[*b][*a] -= weight;
        }
        gains = solved(matrix, right);
    }
    gains
}

/// Of a positive definite matrix, by elimination.
fn solved(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Vec<f64> {
    let n = right.len();
    for i in 0..n {
        let (above, below) = matrix.split_at_mut(i + 1);
        for (row, j) in below.iter_mut().zip(i + 1..) {
            let share = row[i] / above[i][i];
            row.iter_mut().zip(&above[i]).for_each(|(value, pivot)| *value -= share * pivot);
            right[j] -= share * right[i];
        }
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| matrix[i][k] * right[k]).sum();
        right[i] = (right[i] - known) / matrix[i][i];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_come_out_of_looks_at_the_same_things() {
        let gains = [0.3, -0.2, 0.0, -0.1];
        let looks: Vec<Look> = (0..4000_usize)
            .map(|i| {
                let views = [i % 4, (i + 1 + i / 4 % 3) % 4];
                // One in ten is of something else.
                let wrong = if i % 10 == 3 { 0.7 } else { 0.0 };
                Look { views, log_ratio: gains[views[0]] - gains[views[1]] + wrong }
            })
            .collect();
        let found = fitted(&looks, 5);
        for (i, known) in gains.iter().chain(&[0.0]).enumerate() {
            assert!((found[i] - known).abs() < 0.01, "{i}: {} instead of {known}", found[i]);
        }
    }

    #[test]
    fn nothing_seen_twice_changes_nothing() {
        assert_eq!(fitted(&[], 3), [0.0; 3]);
    }
}
