//! Angles between rays and surfaces.

use crate::sweep::neighborhood::{LANES, Planes};
use crate::{RangeImage, TimedPoint};
use nalgebra::Vector3;

/// Distance in columns of the neighbors that span the surface: neighbors one column apart are often closer than the
/// range noise.
const NEIGHBOR_STEP: isize = 2;

/// Computes the values of [`crate::Sweep::incidences`]. The neighbors of a cell in its row and in its column span the
/// surface. Several points of one surface in a cell share a value.
pub(crate) fn incidences(image: &RangeImage, points: &[TimedPoint]) -> Vec<f32> {
    let planes = Planes::new(image, 1);
    let mut by_cell = Vec::with_capacity(image.rows() * image.cols());
    wide_loops::run(
        #[inline(always)]
        || {
            for row in 0..image.rows() {
                for first in (0..image.cols()).step_by(LANES) {
                    by_cell.extend_from_slice(&cosines(&planes, row, first));
                }
            }
        },
    );
    let of_point = |(point_idx, point): (usize, &TimedPoint)| {
        let Some((row, col)) = image.cell(point_idx) else { return f32::NAN };
        let center = Vector3::from(point.position);
        let is_same = (image.position(row, col) - center).norm_squared() < gate(center.norm_squared().sqrt());
        if is_same { by_cell[row * image.cols() + col] } else { f32::NAN }
    };
    points.iter().enumerate().map(of_point).collect()
}

/// Largest squared distance of neighbors, m^2. On surfaces with an incidence above 70 degrees neighbors are farther
/// apart; their angle is unknown.
#[inline(always)]
fn gate(range: f32) -> f32 {
    let limit = 0.1 + 0.06 * range;
    limit * limit
}

/// Cosines of the cells starting at number `first`.
#[inline(always)]
fn cosines(planes: &Planes, row: usize, first: usize) -> [f32; LANES] {
    let center = planes.block(row, first, 0);
    let left = planes.block(row, first, NEIGHBOR_STEP);
    let right = planes.block(row, first, -NEIGHBOR_STEP);
    // At the edge of the image the cell itself replaces the missing neighbor.
    let above = planes.block(planes.above(row).unwrap_or(row), first, 0);
    let below = planes.block(planes.below(row).unwrap_or(row), first, 0);
    let mut cosines = [0.0; LANES];
    for lane in 0..LANES {
        let x = center[0][lane];
        let y = center[1][lane];
        let z = center[2][lane];
        let range = (x * x + y * y + z * z).sqrt();
        // Branch-free. The NaN of an empty cell is not near. If one of two neighbors is missing, the other and the
        // center are used.
        let near = |block: &[&[f32; LANES]; 3]| {
            let dx = block[0][lane] - x;
            let dy = block[1][lane] - y;
            let dz = block[2][lane] - z;
            let is_near = dx * dx + dy * dy + dz * dz < gate(range);
            if is_near { (dx, dy, dz) } else { (0.0, 0.0, 0.0) }
        };
        let (lx, ly, lz) = near(&left);
        let (rx, ry, rz) = near(&right);
        let (ax, ay, az) = near(&above);
        let (bx, by, bz) = near(&below);
        let ux = lx - rx;
        let uy = ly - ry;
        let uz = lz - rz;
        let vx = ax - bx;
        let vy = ay - by;
        let vz = az - bz;
        let nx = uy * vz - uz * vy;
        let ny = uz * vx - ux * vz;
        let nz = ux * vy - uy * vx;
        let norm = (nx * nx + ny * ny + nz * nz).sqrt();
        // Without neighbors 0 / 0 gives NaN.
        let cosine = (nx * x + ny * y + nz * z).abs() / (norm * range);
        cosines[lane] = if cosine > 1.0 { 1.0 } else { cosine };
    }
    cosines
}
