//! Votes of all sweeps that saw a place.

use messages::SubmapPoint;

/// Coordinates are counted in cells from here, so that they are positive, and stay in 21 bits each: +-100 km in cells of
/// 0.1 m.
const OFFSET: i64 = 1 << 20;
const MASK: i64 = (1 << 21) - 1;

/// Probabilities of classes for every point, 0 to 255 for 0 to 1, in rows of one length.
pub struct Votes {
    /// Classes.
    pub n_classes: usize,
    /// Rows by point; zeros throughout for a point without a vote.
    pub rows: Vec<u8>,
}

impl Votes {
    /// Gives every point the mean of the votes within its cell of `cell_m`: best class and its share, or `None` without
    /// votes. Cells count in the submap's frame.
    pub fn decide(&self, points: &[SubmapPoint], cell_m: f32) -> Vec<Option<(usize, f32)>> {
        let mut order: Vec<(u64, u32)> = points.iter().map(|point| cell(point, cell_m)).zip(0..).collect();
        order.sort_unstable();
        let mut decided = vec![None; points.len()];
        let mut sums = vec![0_u32; self.n_classes];
        for group in order.chunk_by(|a, b| a.0 == b.0) {
            sums.fill(0);
            for (_, point) in group {
                let row = &self.rows[*point as usize * self.n_classes..][..self.n_classes];
                sums.iter_mut().zip(row).for_each(|(sum, vote)| *sum += u32::from(*vote));
            }
            let total: u32 = sums.iter().sum();
            // The first of equals: the order of the classes decides, not that of the points.
            let best = (0..self.n_classes).rev().max_by_key(|&class| sums[class]);
            let decision = best.filter(|_| total > 0).map(|class| (class, sums[class] as f32 / total as f32));
            for (_, point) in group {
                decided[*point as usize] = decision;
            }
        }
        decided
    }
}

/// A point that is no number shares a cell with others of its kind only if they have votes, which they have not.
fn cell(point: &SubmapPoint, cell_m: f32) -> u64 {
    let count = |v: f32| ((f64::from(v) / f64::from(cell_m)).floor() as i64 + OFFSET) & MASK;
    (count(point.x) << 42 | count(point.y) << 21 | count(point.z)) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_has_one_class_and_unseen_points_have_it_too() {
        let at = |x: f32| SubmapPoint { x, ..SubmapPoint::default() };
        let points = [at(0.01), at(0.05), at(0.19), at(0.21), at(-0.01), at(5.0)];
        let votes = Votes { n_classes: 2, rows: vec![200, 55, 100, 155, 0, 0, 10, 245, 255, 0, 0, 0] };
        let decided = votes.decide(&points, 0.2);
        let near = |got: Option<(usize, f32)>, class: usize, share: f32| {
            let (got_class, got_share) = got.expect("has votes");
            assert!(got_class == class && (got_share - share).abs() < 1e-6, "{got_class} {got_share}");
        };
        for decision in &decided[..3] {
            near(*decision, 0, 300.0 / 510.0);
        }
        near(decided[3], 1, 245.0 / 255.0);
        near(decided[4], 0, 1.0);
        assert_eq!(decided[5], None);
    }
}
