//! What a vehicle drives on is road: the ground below its path shows how far a model mistakes the roads of a drive for other ground.
//!
//! Asphalt that is rougher than in the training, or measured by a noisier sensor, looks like a lawn. The same happens below the
//! vehicle, where the truth is known. There, the odds of other kinds of ground against road are measured, and divided out
//! everywhere in the submap.

use crate::cell_probabilities::best_of;
use crate::sample::sample_step;
use crate::sweep_positions::sweep_positions;
use geometry::BevGrid;
use messages::{ClassId, SubmapHeader, SubmapPoint};
use ndarray::Array2;

/// Half the width of a lane that is certainly road, m: the track of a car and a quarter of a meter.
const HALF_WIDTH_M: f64 = 1.5;
/// The path is continued straight by this length, m: a standing vehicle sees no ground below itself, and the rings of an HDL-64E start at 4 m.
const CONTINUED_M: f64 = 8.0;
/// A path shorter than this, m, has no direction; x of the submap is forward.
const MIN_DIRECTION_M: f64 = 2.0;
/// Farther positions of successive sweeps are not connected, m: nobody knows what was driven on between them.
const MAX_STEP_M: f64 = 3.0;
/// Side of the cells of the top view of the path, m.
const CELL_M: f64 = 0.25;
/// Largest number of cells of the top view: a path of 400 m in both directions.
const MAX_CELLS: usize = 1 << 22;
/// Largest height of points on the road, m.
const GROUND_M: f32 = 0.3;
/// With fewer points below the path nothing is known.
const MIN_POINTS: usize = 50;
/// Share of the points below the path that become road.
const ROAD_SHARE: f64 = 0.9;
/// Largest change of the logarithm of the odds. More than this is another surface, not a bias.
const MAX_SHIFT: f32 = 2.0;
// Share and largest change were chosen on the data sets of `street_labels` and three SemanticKITTI sweeps of a motorway.

/// Kinds of ground other than roads.
const OTHER_GROUND: [ClassId; 3] = [ClassId::Sidewalk, ClassId::Terrain, ClassId::Ground];
const ROADS: [ClassId; 2] = [ClassId::Road, ClassId::RoadLine];

/// The strip below the path of the first LiDAR, seen from above.
pub(crate) struct DrivenPath {
    grid: BevGrid,
    is_driven: Array2<bool>,
}

impl DrivenPath {
    /// The strip of a submap; `None` without positions of the LiDAR.
    pub fn find(header: &SubmapHeader) -> Option<Self> {
        let ends = sweep_positions(header).flat_map(|sweep| [sweep.begin, sweep.end]);
        let path = continued(&ends.map(|[x, y, _]| [x, y]).collect::<Vec<_>>())?;
        let extreme = |axis: usize, largest: fn(f64, f64) -> f64, sign: f64| {
            path.iter().flatten().map(|of| of[axis]).reduce(largest).map(|value| value + sign * 2.0 * HALF_WIDTH_M)
        };
        let min = [extreme(0, f64::min, -1.0)?, extreme(1, f64::min, -1.0)?];
        let max = [extreme(0, f64::max, 1.0)?, extreme(1, f64::max, 1.0)?];
        let grid = BevGrid::covering(min, max, CELL_M, MAX_CELLS)?;
        let mut is_driven = Array2::from_elem((grid.rows, grid.cols), false);
        for [from, to] in &path {
            let length_m = (to[0] - from[0]).hypot(to[1] - from[1]);
            let n_steps = (length_m / CELL_M).ceil().max(1.0) as usize;
            for step in 0..=n_steps {
                let share = step as f64 / n_steps as f64;
                mark(&mut is_driven, &grid, [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis])));
            }
        }
        Some(Self { grid, is_driven })
    }

    fn contains(&self, point: &SubmapPoint) -> bool {
        self.grid.cell(f64::from(point.x), f64::from(point.y)).is_some_and(|cell| self.is_driven[cell])
    }

    /// Indices of a sample of the points on the ground of the strip. `heights_m` are the heights above the terrain.
    pub fn ground<'a>(&'a self, points: &'a [SubmapPoint], heights_m: &'a [f32]) -> impl Iterator<Item = usize> + 'a {
        let is_low = |height_m: &f32| height_m.abs() < GROUND_M;
        let is_below = move |index: &usize| is_low(&heights_m[*index]) && self.contains(&points[*index]);
        (0..points.len()).step_by(sample_step(points.len())).filter(is_below)
    }
}

/// Marks the cells around a position.
fn mark(is_driven: &mut Array2<bool>, grid: &BevGrid, [x, y]: [f64; 2]) {
    let n = (HALF_WIDTH_M / CELL_M) as i32;
    for (i, j) in (-n..=n).flat_map(|i| (-n..=n).map(move |j| (i, j))) {
        let offset = [i, j].map(|cells| f64::from(cells) * CELL_M);
        if offset[0].hypot(offset[1]) <= HALF_WIDTH_M
            && let Some(cell) = grid.cell(x + offset[0], y + offset[1])
        {
            is_driven[cell] = true;
        }
    }
}

/// The segments of a path, continued at both ends.
fn continued(positions: &[[f64; 2]]) -> Option<Vec<[[f64; 2]; 2]>> {
    let (first, last) = (*positions.first()?, *positions.last()?);
    let distance_m = |a: [f64; 2], b: [f64; 2]| (b[0] - a[0]).hypot(b[1] - a[1]);
    let length_m = distance_m(first, last);
    let forward = if length_m < MIN_DIRECTION_M { [1.0, 0.0] } else { [0, 1].map(|k| (last[k] - first[k]) / length_m) };
    let moved = |from: [f64; 2], by_m: f64| [0, 1].map(|k| from[k] + by_m * forward[k]);
    let mut path: Vec<[[f64; 2]; 2]> =
        positions.windows(2).map(|pair| [pair[0], pair[1]]).filter(|[a, b]| distance_m(*a, *b) <= MAX_STEP_M).collect();
    path.extend(positions.iter().map(|position| [*position; 2]));
    path.extend([[moved(first, -CONTINUED_M), first], [last, moved(last, CONTINUED_M)]]);
    Some(path)
}

/// Factors of the classes that make most of the ground below the path road. `rows` are values proportional to the probabilities of the
/// classes at the points below the path. `None` if most of it is road already, or if fewer than [`MIN_POINTS`] points are ground.
pub(crate) fn road_factors<'a>(rows: impl Iterator<Item = &'a [f32]>, classes: &[ClassId]) -> Option<Vec<f32>> {
    /// Added to all values: a probability of zero is not certain.
    const LEAST: f32 = 1e-6;
    let index_of = |class: &ClassId| classes.iter().position(|of| of == class);
    let roads: Vec<usize> = ROADS.iter().filter_map(index_of).collect();
    let others: Vec<usize> = OTHER_GROUND.iter().filter_map(index_of).collect();
    let mut odds: Vec<Vec<f32>> = vec![Vec::new(); others.len()];
    for row in rows {
        let total: f32 = row.iter().sum();
        let best = best_of(row).map(|best| best.class);
        if !best.is_some_and(|best| roads.contains(&best) || others.contains(&best)) {
            continue;
        }
        let road: f32 = roads.iter().map(|road| row[*road] / total).sum();
        for (odds, other) in odds.iter_mut().zip(&others) {
            odds.push((row[*other] / total + LEAST).ln() - (road + LEAST).ln());
        }
    }
    if roads.is_empty() || odds.first().is_none_or(|odds| odds.len() < MIN_POINTS) {
        return None;
    }
    let mut factors = vec![1.0; classes.len()];
    for (odds, other) in odds.iter_mut().zip(others) {
        let rank = ((odds.len() - 1) as f64 * ROAD_SHARE).round() as usize;
        let (_, shift, _) = odds.select_nth_unstable_by(rank, f32::total_cmp);
        factors[other] = (-shift.clamp(0.0, MAX_SHIFT)).exp();
    }
    factors.iter().any(|factor| *factor != 1.0).then_some(factors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ClassId::{Road, Terrain, Vegetation};

    fn header(positions: &[[f32; 2]]) -> Box<SubmapHeader> {
        let mut header: Box<SubmapHeader> = Box::default();
        header.n_sweeps = positions.len() as u32;
        for (sweep, [x, y]) in header.sweeps.iter_mut().zip(positions) {
            sweep.n_points = 1;
            sweep.submap_from_lidar_begin = [*x, *y, 2.0, 0.0, 0.0, 0.0, 1.0];
            sweep.submap_from_lidar_end = sweep.submap_from_lidar_begin;
        }
        header
    }

    #[test]
    fn strip_follows_the_path_and_continues_it() {
        let contains =
            |path: &DrivenPath, x: f32, y: f32| path.contains(&SubmapPoint { x, y, ..SubmapPoint::default() });
        // Along y.
        let path = DrivenPath::find(&header(&[[0.0, 0.0], [0.0, 2.0], [0.0, 4.0]])).expect("has positions");
        for [x, y] in [[0.0, 3.0], [1.4, 1.0], [0.0, 11.9], [0.0, -7.9]] {
            assert!(contains(&path, x, y), "{x} {y}");
        }
        for [x, y] in [[1.9, 1.0], [0.0, 14.0], [5.0, 0.0]] {
            assert!(!contains(&path, x, y), "{x} {y}");
        }
        // A standing vehicle looks along x; far positions are not connected.
        let standing = DrivenPath::find(&header(&[[0.0, 0.0]])).expect("has positions");
        assert!(contains(&standing, 7.0, 1.0) && contains(&standing, -7.0, 0.0) && !contains(&standing, 0.0, 3.0));
        let far = DrivenPath::find(&header(&[[0.0, 0.0], [40.0, 0.0]])).expect("has positions");
        assert!(contains(&far, 0.0, 0.0) && contains(&far, 40.0, 0.0) && !contains(&far, 20.0, 0.0));
        assert!(DrivenPath::find(&SubmapHeader::default()).is_none());
    }

    #[test]
    fn ground_below_the_path_becomes_road() {
        let classes = [Road, Terrain, Vegetation];
        let rows: Vec<[f32; 3]> = (0..100).map(|i| if i < 30 { [0.6, 0.3, 0.1] } else { [0.3, 0.6, 0.1] }).collect();
        let factors = road_factors(rows.iter().map(<[f32; 3]>::as_slice), &classes).expect("a bias");
        assert_eq!([factors[0], factors[2]], [1.0, 1.0]);
        assert!((factors[1] - 0.5).abs() < 1e-3, "{factors:?}");
        // A larger difference is not a bias.
        let grass = [[0.01, 0.98, 0.01]; 100];
        let factors = road_factors(grass.iter().map(<[f32; 3]>::as_slice), &classes).expect("a bias");
        assert!((factors[1] - (-MAX_SHIFT).exp()).abs() < 1e-6, "{factors:?}");
        // Correct roads, few points and other classes change nothing.
        let right = [[0.9, 0.05, 0.05]; 100];
        assert_eq!(road_factors(right.iter().map(<[f32; 3]>::as_slice), &classes), None);
        assert_eq!(road_factors(rows[..49].iter().map(<[f32; 3]>::as_slice), &classes), None);
        let bushes = [[0.1, 0.2, 0.7]; 100];
        assert_eq!(road_factors(bushes.iter().map(<[f32; 3]>::as_slice), &classes), None);
    }
}
