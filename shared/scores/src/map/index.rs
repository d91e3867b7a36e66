//! Spatial index of points.

use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Points in columns of a horizontal grid, each column sorted by height. A search visits the columns within the radius, and in each
/// column only the points within the range of heights. Needs 12 bytes per point.
pub struct PointIndex {
    cell_m: f32,
    points: Vec<[f32; 3]>,
    columns: HashMap<[i32; 2], Range<usize>>,
}

impl PointIndex {
    /// Builds an index with columns `cell_m` wide; the best width is about the search radius. Points that are not
    /// finite are skipped. Coordinates should be within 10 km of 0, where an f32 resolves 1 mm.
    pub fn new(mut points: Vec<[f32; 3]>, cell_m: f32) -> Self {
        points.retain(|point| point.iter().all(|value| value.is_finite()));
        let column = |point: &[f32; 3]| [point[0], point[1]].map(|value| (value / cell_m).floor() as i32);
        // All coordinates are compared, so that the result does not depend on the order of the input.
        points.par_sort_unstable_by(|a, b| {
            let height = a[2].total_cmp(&b[2]);
            column(a).cmp(&column(b)).then(height).then(a[0].total_cmp(&b[0])).then(a[1].total_cmp(&b[1]))
        });
        let mut columns = HashMap::new();
        let mut start = 0;
        for some in points.chunk_by(|a, b| column(a) == column(b)) {
            columns.insert(column(&some[0]), start..start + some.len());
            start += some.len();
        }
        Self { cell_m, points, columns }
    }

    /// All points, sorted.
    pub fn points(&self) -> &[[f32; 3]] {
        &self.points
    }

    /// Calls `visit` with each point within `radius_m` of `center`, and its squared distance.
    pub fn visit_ball(&self, center: [f32; 3], radius_m: f32, mut visit: impl FnMut([f32; 3], f32)) {
        let column = |value: f32| (value / self.cell_m).floor() as i32;
        for x in column(center[0] - radius_m)..=column(center[0] + radius_m) {
            for y in column(center[1] - radius_m)..=column(center[1] + radius_m) {
                let Some(range) = self.columns.get(&[x, y]) else { continue };
                let points = &self.points[range.clone()];
                let first = points.partition_point(|point| point[2] < center[2] - radius_m);
                for point in points[first..].iter().take_while(|point| point[2] <= center[2] + radius_m) {
                    let squared = (0..3).map(|k| (point[k] - center[k]).powi(2)).sum::<f32>();
                    if squared <= radius_m * radius_m {
                        visit(*point, squared);
                    }
                }
            }
        }
    }

    /// Distance to the nearest point, m, if there is one within `radius_m`.
    pub fn nearest(&self, center: [f32; 3], radius_m: f32) -> Option<f32> {
        // Most neighbors are near: a larger radius is searched only if the smaller one has no point.
        [radius_m / 16.0, radius_m / 4.0, radius_m].into_iter().find_map(|radius_m| {
            let mut nearest = f32::INFINITY;
            self.visit_ball(center, radius_m, |_, squared| nearest = nearest.min(squared));
            nearest.is_finite().then(|| nearest.sqrt())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visit_ball_finds_exactly_the_points_within_the_radius() {
        let number =
            |i: u32, k: u32| f32::from((i.wrapping_mul(2_654_435_761).rotate_left(11 * k) >> 16) as u16) / 8192.0;
        let points: Vec<[f32; 3]> = (1..4000).map(|i| [number(i, 0) - 4.0, number(i, 1) - 4.0, number(i, 2)]).collect();
        let index = PointIndex::new(points.clone(), 0.7);
        let mut n_found = 0;
        for (center, radius_m) in points.iter().step_by(97).zip([0.2, 0.7, 1.6].into_iter().cycle()) {
            let squared = |p: &[f32; 3]| (0..3).map(|k| (p[k] - center[k]).powi(2)).sum::<f32>();
            let expected = points.iter().filter(|p| squared(p) <= radius_m * radius_m).count();
            let mut n = 0;
            index.visit_ball(*center, radius_m, |_, _| n += 1);
            assert_eq!(n, expected);
            n_found += n;
            let query = [center[0] + 0.11, center[1], center[2] - 0.2];
            let squared = |p: &[f32; 3]| (0..3).map(|k| (p[k] - query[k]).powi(2)).sum::<f32>();
            let nearest = points.iter().map(squared).fold(f32::INFINITY, f32::min).sqrt();
            assert_eq!(index.nearest(query, 4.0), Some(nearest));
        }
        assert!(n_found > 200, "{n_found}");
    }

    #[test]
    fn nearest_finds_points_within_the_radius_only() {
        let index = PointIndex::new(vec![[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [f32::NAN, 0.0, 0.0]], 1.0);
        assert_eq!(index.points().len(), 2);
        assert_eq!(index.nearest([0.5, 0.0, 0.0], 1.0), Some(0.5));
        assert_eq!(index.nearest([0.0, 0.0, 1.5], 1.0), None);
    }
}
