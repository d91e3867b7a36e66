//! Renders points: splats into a depth buffer, then eye-dome lighting.

use super::camera::Camera;
use super::settings::{Background, PictureSize};
use rayon::prelude::*;

/// The picture is rendered at twice the size in both directions and averaged, for smooth edges.
const SUPERSAMPLING: usize = 2;

/// Diameter of a point's disk, m, and its limits in px before averaging: far points stay visible, near points stay small.
const POINT_M: f64 = 0.06;
const MIN_WIDTH_PX: f64 = 3.0;
const MAX_WIDTH_PX: f64 = 8.0;

/// Strength of the shading behind nearer neighbors, and distance of these neighbors in px before averaging.
const SHADE_STRENGTH: f32 = 18.0;
const SHADE_RADIUS: isize = 3;

/// `N` pictures of the same points in different colors, before averaging.
pub struct Canvas<const N: usize> {
    size: PictureSize,
    width: usize,
    height: usize,
    depths_m: Vec<f32>,
    /// sRGB of each pixel in each picture.
    colors: Vec<[[u8; 3]; N]>,
}

impl<const N: usize> Canvas<N> {
    /// An empty canvas.
    pub fn new(size: PictureSize) -> Self {
        let width = size.width * SUPERSAMPLING;
        let height = size.height * SUPERSAMPLING;
        let n = width * height;
        Self { size, width, height, depths_m: vec![f32::INFINITY; n], colors: vec![[[0; 3]; N]; n] }
    }

    /// Draws a point, except where a nearer point was drawn.
    pub fn splat(&mut self, camera: &Camera, position: [f64; 3], colors: [[u8; 3]; N]) {
        let Some(at) = camera.project(position) else { return };
        let u = at.u * SUPERSAMPLING as f64;
        let v = at.v * SUPERSAMPLING as f64;
        let radius = (POINT_M * at.px_per_m * SUPERSAMPLING as f64).clamp(MIN_WIDTH_PX, MAX_WIDTH_PX) / 2.0;
        // Pixels whose centers lie inside. Casts of floats to integers stop at the ends of their range.
        let range = |center: f64, half: f64, end: usize| {
            let start = (center - half - 0.5).ceil().max(0.0) as usize;
            start..((center + half - 0.5).floor() + 1.0).clamp(0.0, end as f64) as usize
        };
        let depth_m = at.depth_m as f32;
        for row in range(v, radius, self.height) {
            let above = row as f64 + 0.5 - v;
            for column in range(u, (radius * radius - above * above).max(0.0).sqrt(), self.width) {
                let pixel = row * self.width + column;
                if depth_m < self.depths_m[pixel] {
                    self.depths_m[pixel] = depth_m;
                    self.colors[pixel] = colors;
                }
            }
        }
    }

    /// Shades, adds the background and averages to the final size. Returns rows of sRGB from the top left, picture by picture.
    pub fn finish(&self, background: Background) -> [Vec<u8>; N] {
        let log_depths: Vec<f32> = self.depths_m.par_iter().map(|depth| depth.log2()).collect();
        let rows: Vec<Vec<[[u8; 3]; N]>> = (0..self.size.height)
            .into_par_iter()
            .map(|row| {
                let behind = background.color(row as f32 / self.size.height as f32);
                (0..self.size.width).map(|column| self.pixel(&log_depths, column, row, behind)).collect()
            })
            .collect();
        std::array::from_fn(|k| rows.iter().flatten().flat_map(|colors| colors[k]).collect())
    }

    fn pixel(&self, log_depths: &[f32], column: usize, row: usize, behind: [f32; 3]) -> [[u8; 3]; N] {
        let mut sums = [[0.0; 3]; N];
        for v in row * SUPERSAMPLING..(row + 1) * SUPERSAMPLING {
            for u in column * SUPERSAMPLING..(column + 1) * SUPERSAMPLING {
                let pixel = v * self.width + u;
                let is_empty = log_depths[pixel] == f32::INFINITY;
                let shade = if is_empty { 1.0 } else { self.shade(log_depths, u, v) };
                for (sum, color) in sums.iter_mut().zip(&self.colors[pixel]) {
                    for k in 0..3 {
                        sum[k] += if is_empty { behind[k] } else { f32::from(color[k]) * shade };
                    }
                }
            }
        }
        sums.map(|sum| sum.map(|value| (value / (SUPERSAMPLING * SUPERSAMPLING) as f32).round() as u8))
    }

    /// Eye-dome lighting (Boucheny 2009): 1 on a free surface, less the further a pixel lies behind its neighbors.
    /// The logarithm makes a step count by its ratio, so near and far objects get the same outlines.
    fn shade(&self, log_depths: &[f32], u: usize, v: usize) -> f32 {
        let own = log_depths[v * self.width + u];
        let mut sum = 0.0;
        for (du, dv) in [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)] {
            let column = u.saturating_add_signed(du * SHADE_RADIUS).min(self.width - 1);
            let row = v.saturating_add_signed(dv * SHADE_RADIUS).min(self.height - 1);
            // Larger steps are shaded like a step of a quarter of the distance.
            sum += (own - log_depths[row * self.width + column]).clamp(0.0, 0.25);
        }
        (-SHADE_STRENGTH * sum / 8.0).exp().max(0.2)
    }
}

impl Background {
    /// sRGB at a height in the picture: 0 is the top, 1 the bottom.
    fn color(self, height: f32) -> [f32; 3] {
        match self {
            Background::White => [255.0; 3],
            Background::Dark => {
                [[10.0, 24.0], [13.0, 29.0], [20.0, 38.0]].map(|[top, bottom]| top + (bottom - top) * height)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: PictureSize = PictureSize { width: 64, height: 32 };

    fn camera() -> Camera {
        Camera::top_view([[0.0, 0.0, 0.0], [64.0, 32.0, 10.0]], &[], SIZE)
    }

    #[test]
    fn nearer_point_wins_in_either_order() {
        let near = [10.2, 20.2, 5.0];
        let far = [10.2, 20.2, 1.0];
        for order in [[near, far], [far, near]] {
            let mut canvas = Canvas::new(SIZE);
            for position in order {
                let color = if position == near { [255, 0, 0] } else { [0, 255, 0] };
                canvas.splat(&camera(), position, [color]);
            }
            let drawn: Vec<[u8; 3]> =
                canvas.colors.iter().map(|[color]| *color).filter(|color| *color != [0; 3]).collect();
            assert!(!drawn.is_empty() && drawn.iter().all(|color| *color == [255, 0, 0]));
        }
    }

    #[test]
    fn single_point_colors_one_pixel() {
        let mut canvas = Canvas::new(SIZE);
        canvas.splat(&camera(), [10.5, 20.5, 0.0], [[200, 100, 50]]);
        let [pixels] = canvas.finish(Background::White);
        assert_eq!(pixels.len(), 64 * 32 * 3);
        let colored: Vec<usize> = (0..64 * 32).filter(|i| pixels[i * 3..i * 3 + 3] != [255; 3]).collect();
        // North is up: y = 20.5 of 32 is row 11.
        assert_eq!(colored, [11 * 64 + 10]);
        assert_eq!(pixels[colored[0] * 3..][..3], [200, 100, 50]);
    }

    #[test]
    fn points_outside_or_not_finite_are_not_drawn() {
        let mut canvas = Canvas::<1>::new(SIZE);
        for position in [[-500.0, 0.0, 0.0], [1e300, 1e300, 0.0], [f64::NAN; 3], [0.0, 0.0, 1e9]] {
            canvas.splat(&camera(), position, [[255; 3]]);
        }
        assert!(canvas.depths_m.iter().all(|depth| *depth == f32::INFINITY));
    }

    #[test]
    fn depth_step_darkens_the_far_side() {
        let mut canvas = Canvas::new(SIZE);
        for i in 0..128 * 64 {
            let x = f64::from(i % 128) / 2.0 + 0.25;
            let y = f64::from(i / 128) / 2.0 + 0.25;
            canvas.splat(&camera(), [x, y, if x < 32.0 { 9.0 } else { 0.0 }], [[200; 3]]);
        }
        let [pixels] = canvas.finish(Background::White);
        let level = |column: usize| pixels[(16 * 64 + column) * 3];
        assert_eq!((level(10), level(50)), (200, 200));
        assert!(level(32) < 140, "{}", level(32));
        assert_eq!(level(30), 200);
    }
}
