//! Normals and roughness of the surfaces in a range image, from the neighbors of each pixel; 16 pixels of a row at a time.

#![allow(
    clippy::needless_range_loop,
    clippy::needless_bitwise_bool,
    reason = "loops over constant bounds become vector instructions; iterators, calls and branches in between do not"
)]

use super::{PolarImage, PolarPixel};
use kernels::images::LANES;

/// Distances of neighbors in columns, the preferred one last: far enough that range noise (2 cm) does not tilt the
/// normal, near enough to stay on the surface. 4 of 2048 columns are 0.7 degrees, half the distance between the rings
/// of an HDL-32E.
const COLUMN_STEPS: [usize; 4] = [2, 3, 5, 4];
/// Largest change of range between neighbors on one surface, as a share of the range.
const SAME_SURFACE: f32 = 0.15;
/// Distance of the neighbors for roughness, columns: 0.5 degrees of 2048 columns.
const ROUGHNESS_COLUMNS: usize = 3;
/// Padding columns at each end of a row.
const PAD: usize = 5;

/// One value for each of 16 pixels.
pub(super) type Tile = [f32; LANES];

/// The surface at 16 pixels.
pub(super) struct SurfaceTile {
    /// Rays and their length, m; 0 without a point.
    pub(super) ray: [Tile; 3],
    pub(super) range_m: Tile,
    /// Unit normals towards the LiDAR, from the cross product of the differences to the neighbors in row and column; zero without a
    /// surface.
    pub(super) normal: [Tile; 3],
    /// Distances from the midpoint of the neighbors in the row, m; 1, the largest roughness, without both neighbors.
    pub(super) roughness_m: Tile,
}

/// Rays of an image and their lengths, as a structure of arrays.
pub(super) struct Surface {
    /// x, y, z and length by row, with a row of zeros above and below, and [`PAD`] columns of the opposite end on
    /// either side.
    rays: [Vec<f32>; 4],
    pitch: usize,
}

impl Surface {
    #[inline(always)]
    pub(super) fn from_image(image: &PolarImage) -> Self {
        let pitch = image.columns.next_multiple_of(LANES) + 2 * PAD;
        let mut rays = [(); 4].map(|()| vec![0.0; (image.rows + 2) * pitch]);
        for (row, pixels) in image.pixels.chunks_exact(image.columns).enumerate() {
            let mut rows = rays.each_mut().map(|values| &mut values[(row + 1) * pitch..][..pitch]);
            let columns = image.columns;
            for (at, pixel) in (PAD..).zip(pixels) {
                set(&mut rows, at, pixel);
            }
            for pad in 0..PAD {
                set(&mut rows, pad, &pixels[columns - PAD + pad]);
                set(&mut rows, PAD + columns + pad, &pixels[pad]);
            }
        }
        Self { rays, pitch }
    }

    /// 16 pixels of a row, starting at a column that is a multiple of 16. Values beyond the last column of the image
    /// are arbitrary.
    #[inline(always)]
    pub(super) fn tile(&self, row: usize, column: usize) -> SurfaceTile {
        let at = (row + 1) * self.pitch + PAD + column;
        let here = self.load(at);
        let mut limit_m = [0.0; LANES];
        for i in 0..LANES {
            limit_m[i] = SAME_SURFACE * here[3][i] + 0.1;
        }
        // A side without a neighbor on the same surface ends at the pixel itself.
        let mut ends = [here; 4];
        for step in COLUMN_STEPS {
            take_same(&mut ends[0], &self.load(at - step), &here, &limit_m);
            take_same(&mut ends[1], &self.load(at + step), &here, &limit_m);
        }
        take_same(&mut ends[2], &self.load(at - self.pitch), &here, &limit_m);
        take_same(&mut ends[3], &self.load(at + self.pitch), &here, &limit_m);
        let [before, after] = [self.load(at - ROUGHNESS_COLUMNS), self.load(at + ROUGHNESS_COLUMNS)];
        let mut roughness_m = [0.0; LANES];
        for i in 0..LANES {
            let off = |k: usize| here[k][i] - 0.5 * (before[k][i] + after[k][i]);
            let off_m = (off(0) * off(0) + off(1) * off(1) + off(2) * off(2)).sqrt();
            let is_inside = (before[3][i] > 0.0) & (after[3][i] > 0.0);
            roughness_m[i] = if is_inside { off_m } else { 1.0 };
        }
        let normal = normal(&ends, &here);
        SurfaceTile { ray: [here[0], here[1], here[2]], range_m: here[3], normal, roughness_m }
    }

    #[inline(always)]
    fn load(&self, at: usize) -> [Tile; 4] {
        let mut tiles = [[0.0; LANES]; 4];
        for (tile, values) in tiles.iter_mut().zip(&self.rays) {
            tile.copy_from_slice(&values[at..][..LANES]);
        }
        tiles
    }
}

/// Writes the ray of a pixel and its length.
#[inline(always)]
fn set(rows: &mut [&mut [f32]; 4], at: usize, pixel: &PolarPixel) {
    let [x, y, z] = pixel.ray;
    (rows[0][at], rows[1][at], rows[2][at], rows[3][at]) = (x, y, z, pixel.range_m());
}

/// Replaces `end` with the neighbor if both are on the same surface.
#[inline(always)]
fn take_same(end: &mut [Tile; 4], neighbor: &[Tile; 4], here: &[Tile; 4], limit_m: &Tile) {
    let mut is_same = [false; LANES];
    for i in 0..LANES {
        let range_m = neighbor[3][i];
        is_same[i] = (range_m > 0.0) & ((range_m - here[3][i]).abs() < limit_m[i]);
    }
    for k in 0..3 {
        for i in 0..LANES {
            end[k][i] = if is_same[i] { neighbor[k][i] } else { end[k][i] };
        }
    }
}

/// Normals from the differences of the first two and the last two ends.
#[inline(always)]
fn normal(ends: &[[Tile; 4]; 4], here: &[Tile; 4]) -> [Tile; 3] {
    let mut normal = [[0.0; LANES]; 3];
    for i in 0..LANES {
        let along = |k: usize| ends[1][k][i] - ends[0][k][i];
        let across = |k: usize| ends[3][k][i] - ends[2][k][i];
        let ax = along(0);
        let ay = along(1);
        let az = along(2);
        let bx = across(0);
        let by = across(1);
        let bz = across(2);
        let x = ay * bz - az * by;
        let y = az * bx - ax * bz;
        let z = ax * by - ay * bx;
        let length = (x * x + y * y + z * z).sqrt();
        let towards = x * here[0][i] + y * here[1][i] + z * here[2][i];
        let scale = if towards > 0.0 { -1.0 } else { 1.0 } / length;
        let is_surface = (length >= 1e-6) & (here[3][i] > 0.0);
        normal[0][i] = if is_surface { x * scale } else { 0.0 };
        normal[1][i] = if is_surface { y * scale } else { 0.0 };
        normal[2][i] = if is_surface { z * scale } else { 0.0 };
    }
    normal
}
