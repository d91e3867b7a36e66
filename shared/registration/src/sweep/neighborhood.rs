//! The shape of the surface around the cells of a range image, many cells at a time. The memory layout suits SIMD
//! registers, so it is not an `ndarray`.

use crate::RangeImage;
use crate::sweep::eigen::smallest_eigenvector;

/// Cells per block: one register of 64 bytes, or two of 32.
pub(crate) const LANES: usize = 16;
/// Column offsets of a neighborhood: 2 to 8 columns are 1.4 degrees, the same as vertically, so that it is about
/// square.
const COLUMN_OFFSETS: [isize; 9] = [0, 2, 4, 6, 8, -2, -4, -6, -8];
const FARTHEST: usize = 8;
/// With fewer neighbors a normal is not reliable.
const MIN_NEIGHBORS: f32 = 7.0;

/// Coordinates of an image's cells as one plane per axis. Cells `step` columns apart are contiguous: `step` lists for
/// each row. Columns wrap around at both ends.
pub(crate) struct Planes {
    step: usize,
    /// Number of cells of a list.
    n: usize,
    /// Padding before the first cell.
    before: usize,
    /// Length of a list with padding.
    len: usize,
    rows: usize,
    /// Rows up or down that a neighborhood reaches.
    reach: usize,
    coordinates: [Vec<f32>; 3],
}

impl Planes {
    pub fn new(image: &RangeImage, step: usize) -> Self {
        let n = image.cols().div_ceil(step);
        let before = FARTHEST.div_ceil(step);
        let len = n.next_multiple_of(LANES) + 2 * before;
        let empty = || vec![f32::NAN; image.rows() * step * len];
        let mut planes = Self {
            step,
            n,
            before,
            len,
            rows: image.rows(),
            reach: image.reach(),
            coordinates: [empty(), empty(), empty()],
        };
        wide_loops::run(
            #[inline(always)]
            || (0..image.rows()).for_each(|row| planes.copy_row(image, row)),
        );
        planes
    }
    #[inline(always)]
    fn copy_row(&mut self, image: &RangeImage, row: usize) {
        let step = self.step;
        let rim = self.before * self.step;
        for phase in 0..step {
            let start = (row * step + phase) * self.len;
            // The margin repeats columns of the other end; past the last column only those that a neighborhood needs.
            let rim_cols = (phase..rim).step_by(step).map(|col| image.cols() + col - rim);
            let cols = (phase..image.cols() + FARTHEST).step_by(step);
            let positions = rim_cols.chain(cols).map(|col| image.position(row, col));
            let [x, y, z] = self.coordinates.each_mut().map(|plane| &mut plane[start..start + self.len]);
            for (place, position) in positions.enumerate().take(self.len) {
                (x[place], y[place], z[place]) = (position.x, position.y, position.z);
            }
        }
    }
    /// Columns between the cells of a list.
    pub fn step(&self) -> usize {
        self.step
    }
    /// Number of cells of a list.
    pub fn n(&self) -> usize {
        self.n
    }
    /// The uppermost row of a neighborhood.
    pub fn above(&self, row: usize) -> Option<usize> {
        Some(row + self.reach).filter(|row| *row < self.rows)
    }
    /// The lowest row of a neighborhood.
    pub fn below(&self, row: usize) -> Option<usize> {
        row.checked_sub(self.reach)
    }
    /// Ranges of the cells starting at number `first`, m; NaN in empty cells.
    #[inline(always)]
    pub fn ranges(&self, row: usize, first: usize) -> [f32; LANES] {
        let [x, y, z] = self.block(row, first, 0);
        let mut ranges = [0.0; LANES];
        for lane in 0..LANES {
            ranges[lane] = (x[lane] * x[lane] + y[lane] * y[lane] + z[lane] * z[lane]).sqrt();
        }
        ranges
    }
    /// Coordinates of `LANES` cells, `offset` columns away from the cells starting at number `first`, m; NaN in empty
    /// cells.
    #[inline(always)]
    pub fn block(&self, row: usize, first: usize, offset: isize) -> [&[f32; LANES]; 3] {
        let step = self.step as isize;
        let list = row * self.step + offset.rem_euclid(step) as usize;
        let start = (list * self.len + self.before + first).wrapping_add_signed(offset.div_euclid(step));
        self.coordinates.each_ref().map(|plane| plane[start..].first_chunk().expect("lists are padded"))
    }
}

/// Shape of the surface around cells, per lane; planarity is -1 with too few points.
pub(crate) struct Shapes {
    /// Range of the cell's own point, m; NaN in empty cells.
    pub range: [f32; LANES],
    /// Direction of the smallest standard deviation, x y z.
    pub normal: [[f32; LANES]; 3],
    /// See [`crate::Feature::planarity`].
    pub planarity: [f32; LANES],
    /// Smallest standard deviation, m.
    pub roughness: [f32; LANES],
    /// Ratio of the smallest standard deviation to the second one.
    pub thickness: [f32; LANES],
}

/// Sums over the neighbors of a cell, per lane: number, offsets, and their products xx, xy, xz, yy, yz, zz.
struct Moments {
    n: [f32; LANES],
    first: [[f32; LANES]; 3],
    second: [[f32; LANES]; 6],
}

impl Shapes {
    /// Shapes of the cells starting at number `first`.
    #[inline(always)]
    pub fn around(planes: &Planes, row: usize, first: usize) -> Self {
        let range = planes.ranges(row, first);
        let Moments { n, first: [x, y, z], second: [xx, xy, xz, yy, yz, zz] } =
            Moments::around(planes, row, first, &range);
        let mut nx = [0.0; LANES];
        let mut ny = [0.0; LANES];
        let mut nz = [0.0; LANES];
        let mut planarity = [-1.0; LANES];
        let mut roughness = [0.0; LANES];
        let mut thickness = [0.0; LANES];
        if !n.iter().fold(false, |is_any, n| is_any | (*n >= MIN_NEIGHBORS)) {
            return Self { range, normal: [nx, ny, nz], planarity, roughness, thickness };
        }
        for lane in 0..LANES {
            let per_n = 1.0 / f64::from(n[lane]);
            let mean = |sums: &[f32; LANES]| f64::from(sums[lane]) * per_n;
            let mx = mean(&x);
            let my = mean(&y);
            let mz = mean(&z);
            let covariance = [
                mean(&xx) - mx * mx,
                mean(&xy) - mx * my,
                mean(&xz) - mx * mz,
                mean(&yy) - my * my,
                mean(&yz) - my * mz,
                mean(&zz) - mz * mz,
            ];
            let ([l1, l2, l3], [x, y, z]) = smallest_eigenvector(&covariance);
            let s1 = l1.max(0.0).sqrt();
            let s2 = l2.max(0.0).sqrt();
            let s3 = l3.max(0.0).sqrt();
            let is_known = (n[lane] >= MIN_NEIGHBORS) & (x * x + y * y + z * z > 0.5);
            (nx[lane], ny[lane], nz[lane]) = (x as f32, y as f32, z as f32);
            planarity[lane] = if is_known { ((s2 - s3) / s1) as f32 } else { -1.0 };
            roughness[lane] = s3 as f32;
            thickness[lane] = (s3 / s2) as f32;
        }
        Self { range, normal: [nx, ny, nz], planarity, roughness, thickness }
    }
}

impl Moments {
    #[inline(always)]
    fn around(planes: &Planes, row: usize, first: usize, range: &[f32; LANES]) -> Self {
        // Neighbors on the same surface are nearer than this, even at a grazing angle.
        let gate = range.map(|range| (0.2 + 0.1 * range).powi(2));
        let center = planes.block(row, first, 0);
        let mut sums = Self { n: [0.0; LANES], first: [[0.0; LANES]; 3], second: [[0.0; LANES]; 6] };
        // With dense rings the outer rows and one halfway suffice; all rows cost more than they improve.
        let half = planes.reach.div_ceil(2);
        let distances = [0, half, planes.reach].into_iter().take(if half == planes.reach { 2 } else { 3 });
        let rows = distances.flat_map(|distance| {
            let below = (distance > 0).then(|| row.checked_sub(distance)).flatten();
            [Some(row + distance).filter(|row| *row < planes.rows), below]
        });
        for row in rows.flatten() {
            for offset in COLUMN_OFFSETS {
                sums.add(&planes.block(row, first, offset), &center, &gate);
            }
        }
        sums
    }
    #[inline(always)]
    fn add(&mut self, block: &[&[f32; LANES]; 3], center: &[&[f32; LANES]; 3], gate: &[f32; LANES]) {
        let Self { n, first: [sum_x, sum_y, sum_z], second: [xx, xy, xz, yy, yz, zz] } = self;
        for lane in 0..LANES {
            let [x, y, z] = std::array::from_fn(|axis| block[axis][lane] - center[axis][lane]);
            // The NaN of an empty cell is not near.
            let is_near = x * x + y * y + z * z < gate[lane];
            let [x, y, z, one] = [x, y, z, 1.0].map(|value| if is_near { value } else { 0.0 });
            n[lane] += one;
            sum_x[lane] += x;
            sum_y[lane] += y;
            sum_z[lane] += z;
            xx[lane] += x * x;
            xy[lane] += x * y;
            xz[lane] += x * z;
            yy[lane] += y * y;
            yz[lane] += y * z;
            zz[lane] += z * z;
        }
    }
}
