//! Directions of the points of a sweep, seen from the LiDAR.

use crate::fast_atan2;

/// Points whose directions are computed at once.
const CHUNK: usize = 64;

/// Directions of points.
pub struct Directions {
    /// z over horizontal distance; NaN for a point that is not finite or lies at the origin.
    pub slopes: Vec<f32>,
    /// Azimuth, rad; see [`fast_atan2`].
    pub azimuths: Vec<f32>,
}

impl Directions {
    /// Computes the directions of points, whose `position` is x y z in the frame of the LiDAR.
    pub fn new<T>(points: &[T], position: impl Fn(&T) -> [f32; 3]) -> Self {
        let mut directions = Self { slopes: vec![0.0; points.len()], azimuths: vec![0.0; points.len()] };
        let chunks = directions.slopes.chunks_mut(CHUNK).zip(directions.azimuths.chunks_mut(CHUNK));
        wide_loops::run(
            #[inline(always)]
            || {
                for (points, (slopes, azimuths)) in points.chunks(CHUNK).zip(chunks) {
                    write_directions(points, &position, slopes, azimuths);
                }
            },
        );
        directions
    }
}

#[inline(always)]
fn write_directions<T>(points: &[T], position: &impl Fn(&T) -> [f32; 3], slopes: &mut [f32], azimuths: &mut [f32]) {
    for ((point, slope), azimuth) in points.iter().zip(slopes).zip(azimuths) {
        let [x, y, z] = position(point);
        // `hypot` is slow because it avoids overflow near the limits of f32.
        let found = z / (x * x + y * y).sqrt();
        *slope = if found.abs() < f32::INFINITY && (x + y).abs() < f32::INFINITY { found } else { f32::NAN };
        *azimuth = fast_atan2(y, x);
    }
}
