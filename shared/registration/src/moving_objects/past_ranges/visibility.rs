//! Visibility of positions in an earlier sweep, many positions at a time.

use super::{DYNAMIC, PastRanges, SECTOR, UNIT_M};
use crate::{RangeImage, SweepMotion};
use nalgebra::{Isometry3, Vector3};

/// Base of the range tolerance between different surfaces, m, to which a share of the range is added: pose errors and
/// beam width.
const TOLERANCE_M: f32 = 0.3;
const TOLERANCE_SHARE: f32 = 0.01;
/// Neighboring rays that are also compared: 0.5 degrees to each side, one ring up and down. A single ray easily misses
/// a pole or the edge of an object.
const REACH_COLUMNS: usize = 3;
/// Offsets of those columns from the middle outwards, counted from the leftmost.
const NEARBY_COLUMNS: [usize; 7] = [3, 2, 4, 1, 5, 0, 6];
/// Rays compared at once: the rays of a row and one extra, one register of 16 bytes.
const RAYS: usize = 8;
/// Mask of the rays that count.
const COUNTED: [u32; RAYS] = [1, 1, 1, 1, 1, 1, 1, 0];
/// Positions of a query: one register of 64 bytes, or two of 32.
pub(crate) const LANES: usize = 16;
/// Row of a position outside the field of view.
const NO_ROW: u32 = u32::MAX;
/// Least number of the 21 rays around a position that must pass it to make it free.
const MIN_BEYOND: u32 = 9;

/// Observation of a position in a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Visibility {
    /// Rays passed.
    Free,
    /// A ray hit a surface there.
    Occupied,
    /// A ray hit a moving object there.
    Dynamic,
    /// No ray reached it.
    Unknown,
}

impl PastRanges {
    /// The ranges with the poses of the sectors, for queries.
    pub fn placed(&self) -> PlacedRanges<'_> {
        // f32 resolves millimetres only within some kilometres, so positions are relative to the middle of the sweep.
        let mid = Isometry3::from_parts(Vector3::zeros().into(), self.motion.mid.rotation);
        let near = SweepMotion { mid, ..self.motion };
        let pose = |&share: &f32| {
            let Isometry3 { rotation, translation } = near.at(f64::from(share)).inverse().cast::<f32>();
            let [i, j, k, w] = rotation.coords.into();
            let [x, y, z] = translation.vector.into();
            [i, j, k, w, x, y, z, 0.0]
        };
        let cols = self.ranges.len() / self.slopes.len();
        PlacedRanges { ranges: self, cols, sectors: self.shares.iter().map(pose).collect() }
    }
}

/// [`PastRanges`] with the pose of each sector.
pub(crate) struct PlacedRanges<'a> {
    ranges: &'a PastRanges,
    cols: usize,
    /// Rotation as a quaternion (x y z w) and translation of `lidar_from_mid`: one load of 32 bytes.
    sectors: Vec<[f32; 8]>,
}

/// Positions in the odom frame by axis, m.
pub(crate) type Positions = [[f64; LANES]; 3];

/// The rays nearest to the positions, per lane.
struct NearestRays {
    rows: [u32; LANES],
    cols: [u32; LANES],
    /// Distances of the positions from the LiDAR, m.
    ranges: [f32; LANES],
}

impl PlacedRanges<'_> {
    /// Visibility of positions in the sweep.
    #[inline(always)]
    pub fn visibility(&self, positions: &Positions) -> [Visibility; LANES] {
        let NearestRays { rows, cols, ranges } = self.nearest_rays(positions);
        let last_row = self.ranges.slopes.len() as u32 - 1;
        let mut nearest = [0; LANES];
        for lane in 0..LANES {
            nearest[lane] = self.ranges.ranges[rows[lane].min(last_row) as usize * self.cols + cols[lane] as usize];
        }
        // The nearest ray hits most static objects.
        let mut is_hit = [0_u32; LANES];
        for lane in 0..LANES {
            is_hit[lane] = u32::from((range_m(nearest[lane]) - ranges[lane]).abs() < tolerance_m(ranges[lane]));
        }
        let mut found = [Visibility::Unknown; LANES];
        for lane in (0..LANES).filter(|lane| rows[*lane] != NO_ROW) {
            found[lane] = if is_hit[lane] == 1 {
                hit_by(nearest[lane])
            } else {
                self.around(rows[lane] as usize, cols[lane] as usize, ranges[lane])
            };
        }
        found
    }

    #[inline(always)]
    fn nearest_rays(&self, positions: &Positions) -> NearestRays {
        let mid = &self.ranges.motion.mid.translation.vector;
        let mut from_mid = [[0.0; LANES]; 3];
        for axis in 0..3 {
            for lane in 0..LANES {
                from_mid[axis][lane] = (positions[axis][lane] - mid[axis]) as f32;
            }
        }
        // The column determines the time, and the time the column: the second iteration is accurate within 0.1 degrees.
        let mut poses = [[0.0; LANES]; 7];
        for (part, value) in poses.iter_mut().zip(self.sectors[self.cols / 2 / SECTOR]) {
            *part = [value; LANES];
        }
        let [x, y, _] = moved(&poses, &from_mid);
        let cols = columns(&x, &y);
        for lane in 0..LANES {
            let pose = &self.sectors[cols[lane] as usize / SECTOR];
            for part in 0..7 {
                poses[part][lane] = pose[part];
            }
        }
        let [x, y, z] = moved(&poses, &from_mid);
        let mut ranges = [0.0; LANES];
        let mut slopes = [0.0; LANES];
        for lane in 0..LANES {
            let flat = x[lane] * x[lane] + y[lane] * y[lane];
            ranges[lane] = (flat + z[lane] * z[lane]).sqrt();
            slopes[lane] = z[lane] / flat.sqrt();
        }
        NearestRays { rows: self.rows(&slopes), cols: columns(&x, &y), ranges }
    }

    /// The rows whose rays have the nearest slopes; [`NO_ROW`] outside the field of view.
    #[inline(always)]
    fn rows(&self, slopes: &[f32; LANES]) -> [u32; LANES] {
        let of_rows = &self.ranges.slopes;
        // Rows ascend, so the number of lower rows is the row above. Counting is faster than a search in each lane.
        let mut above = [0_u32; LANES];
        for of_row in of_rows {
            for lane in 0..LANES {
                above[lane] += u32::from(*of_row < slopes[lane]);
            }
        }
        let mut rows = [NO_ROW; LANES];
        for (lane, row) in rows.iter_mut().enumerate() {
            let above = above[lane];
            let slope = slopes[lane];
            if above > 0 && (above as usize) < of_rows.len() {
                let to_above = of_rows[above as usize] - slope;
                *row = if to_above < slope - of_rows[above as usize - 1] { above } else { above - 1 };
            }
        }
        rows
    }

    /// Visibility at a range, from the rays around a direction.
    #[inline(always)]
    fn around(&self, row: usize, col: usize, range: f32) -> Visibility {
        let tolerance = tolerance_m(range);
        let below = row.checked_sub(1);
        let above = Some(row + 1).filter(|row| *row < self.ranges.slopes.len());
        // Rays of missing rows are not counted.
        let mut rays = [[0; RAYS]; 4];
        let mut is_counted = [[0_u32; RAYS]; 4];
        for (number, row) in [Some(row), below, above].into_iter().enumerate() {
            if let Some(row) = row {
                rays[number] = self.rays(row, col);
                is_counted[number] = COUNTED;
            }
        }
        let rays = rays.as_flattened();
        let is_counted = is_counted.as_flattened();
        let mut is_hit = [0_u32; 4 * RAYS];
        let mut n_hits = 0;
        let mut n_beyond = 0;
        let mut n_before = 0;
        for at in 0..4 * RAYS {
            let range_m = range_m(rays[at]);
            is_hit[at] = u32::from((range_m - range).abs() < tolerance) & is_counted[at];
            n_hits += is_hit[at];
            n_beyond += u32::from(range_m > range) & is_counted[at];
            n_before += u32::from((range_m > 0.0) & (range_m < range)) & is_counted[at];
        }
        if n_hits > 0 {
            let in_order = (0..3).flat_map(|number| NEARBY_COLUMNS.map(|offset| number * RAYS + offset));
            let first = in_order.into_iter().find(|at| is_hit[*at] == 1);
            return first.map_or(Visibility::Unknown, |at| hit_by(rays[at]));
        }
        // Rays that end before and behind the position may hit one surface at a grazing angle, which contains the
        // position.
        if n_beyond >= MIN_BEYOND && n_before == 0 { Visibility::Free } else { Visibility::Unknown }
    }

    /// The rays of a row around a column, from left to right, and one extra, so that they fill a register.
    #[inline(always)]
    fn rays(&self, row: usize, col: usize) -> [u16; RAYS] {
        let of_row = &self.ranges.ranges[row * self.cols..][..self.cols];
        let first = col.checked_sub(REACH_COLUMNS).and_then(|first| of_row.get(first..first + RAYS));
        let at_rim = || std::array::from_fn(|at| of_row[(col + self.cols + at - REACH_COLUMNS) % self.cols]);
        first.and_then(|rays| rays.first_chunk()).copied().unwrap_or_else(at_rim)
    }
}

/// Ranges on different surfaces differ by more than this.
#[inline(always)]
fn tolerance_m(range: f32) -> f32 {
    TOLERANCE_M + TOLERANCE_SHARE * range
}

#[inline(always)]
fn range_m(stored: u16) -> f32 {
    f32::from(stored & !DYNAMIC) * UNIT_M
}

#[inline(always)]
fn hit_by(stored: u16) -> Visibility {
    if stored & DYNAMIC == 0 { Visibility::Occupied } else { Visibility::Dynamic }
}

/// The columns of directions.
#[inline(always)]
fn columns(x: &[f32; LANES], y: &[f32; LANES]) -> [u32; LANES] {
    let mut cols = [0; LANES];
    for lane in 0..LANES {
        cols[lane] = RangeImage::column(x[lane], y[lane]) as u32;
    }
    cols
}

/// Positions under poses (quaternion, translation), as nalgebra computes them.
#[inline(always)]
fn moved(poses: &[[f32; LANES]; 7], positions: &[[f32; LANES]; 3]) -> [[f32; LANES]; 3] {
    let mut moved = [[0.0; LANES]; 3];
    for lane in 0..LANES {
        let [i, j, k, w, tx, ty, tz] = std::array::from_fn(|part| poses[part][lane]);
        let [x, y, z] = std::array::from_fn(|axis| positions[axis][lane]);
        let a = (j * z - k * y) * 2.0;
        let b = (k * x - i * z) * 2.0;
        let c = (i * y - j * x) * 2.0;
        moved[0][lane] = a * w + (j * c - k * b) + x + tx;
        moved[1][lane] = b * w + (k * a - i * c) + y + ty;
        moved[2][lane] = c * w + (i * b - j * a) + z + tz;
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Sweep, TimedPoint};
    use geometry::Stamp;
    use nalgebra::Point3;

    /// Reference implementation of [`PlacedRanges::visibility`], position by position.
    fn plain_visibility(past: &PastRanges, position: &Vector3<f64>) -> Visibility {
        let mid = Isometry3::from_parts(Vector3::zeros().into(), past.motion.mid.rotation);
        let near = SweepMotion { mid, ..past.motion };
        let from_mid = Point3::from((position - past.motion.mid.translation.vector).cast::<f32>());
        let cols = past.ranges.len() / past.slopes.len();
        let mut col = cols / 2;
        let mut local = Point3::origin();
        for _ in 0..2 {
            local = near.at(f64::from(past.shares[col / SECTOR])).inverse().cast::<f32>() * from_mid;
            col = RangeImage::column(local.x, local.y);
        }
        let range = local.coords.norm();
        let slope = local.z / (local.x * local.x + local.y * local.y).sqrt();
        let above = past.slopes.partition_point(|of_row| *of_row < slope);
        if above == 0 || above == past.slopes.len() {
            return Visibility::Unknown;
        }
        let is_above = past.slopes[above] - slope < slope - past.slopes[above - 1];
        let row = if is_above { above } else { above - 1 };
        let mut n_beyond = 0;
        let mut is_blocked = false;
        for row in
            [Some(row), row.checked_sub(1), Some(row + 1)].into_iter().flatten().filter(|row| *row < past.slopes.len())
        {
            for offset in NEARBY_COLUMNS {
                let stored = past.ranges[row * cols + (col + cols + offset - REACH_COLUMNS) % cols];
                let range_m = f32::from(stored & !DYNAMIC) * UNIT_M;
                if (range_m - range).abs() < TOLERANCE_M + TOLERANCE_SHARE * range {
                    return if stored & DYNAMIC == 0 { Visibility::Occupied } else { Visibility::Dynamic };
                }
                n_beyond += u32::from(range_m > range);
                is_blocked |= range_m > 0.0 && range_m < range;
            }
        }
        if n_beyond >= MIN_BEYOND && !is_blocked { Visibility::Free } else { Visibility::Unknown }
    }

    /// Walls and posts around a rotating LiDAR, with gaps; every fifth point is dynamic.
    fn past() -> PastRanges {
        let mut points = Vec::new();
        for column in (0..2000_u32).filter(|column| column % 97 > 8) {
            for ring in 0..32_u8 {
                let azimuth = std::f32::consts::PI - column as f32 * std::f32::consts::TAU / 2000.0;
                let elevation = (-30.67 + f32::from(ring) * 1.333_f32).to_radians();
                let range = if column % 40 < 6 { 7.0 } else { 15.0 + 5.0 * (3.0 * azimuth).sin() };
                let flat = range * elevation.cos();
                let up = range * elevation.sin();
                let position = [flat * azimuth.cos(), flat * azimuth.sin(), up];
                points.push(TimedPoint { position, offset_nanos: column * 50_000, ring });
            }
        }
        let dynamic: Vec<u32> = (0..points.len() as u32).step_by(5).collect();
        let motion = SweepMotion {
            mid: Isometry3::new(Vector3::new(3000.0, -40.0, 1.0), Vector3::new(0.02, 0.1, 1.0)),
            translation: Vector3::new(1.0, 0.4, 0.0),
            rotation: Vector3::new(0.0, 0.01, 0.05),
        };
        PastRanges::new(&Sweep::new(Stamp(0), points, 32), motion, &dynamic)
    }

    #[test]
    fn visibility_of_many_positions_equals_that_of_each() {
        let past = past();
        let placed = past.placed();
        let mut random = random::Random::new(3);
        let mut counts = [0; 4];
        for _ in 0..2000 {
            let each: [[f64; 3]; LANES] = std::array::from_fn(|_| {
                let azimuth = random.range(-3.2, 3.2);
                let range = random.range(0.0, 25.0);
                let [x, y, z] = [range * azimuth.cos(), range * azimuth.sin(), random.range(-3.0, 4.0)];
                [3000.0 + f64::from(x), -40.0 + f64::from(y), 1.0 + f64::from(z)]
            });
            let positions = std::array::from_fn(|axis| each.map(|position| position[axis]));
            for (position, found) in each.into_iter().zip(placed.visibility(&positions)) {
                let expected = plain_visibility(&past, &position.into());
                assert_eq!(found, expected, "{position:?}");
                counts[expected as usize] += 1;
            }
        }
        assert!(counts.iter().all(|n| *n > 200), "each outcome must occur: {counts:?}");
    }
}
