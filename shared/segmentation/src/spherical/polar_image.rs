//! A sweep as an image of rays.

use crate::intensity::IntensityMap;
use geometry::{NO_POINT, RangeImage};

/// The nearest point of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PolarPixel {
    /// Vector from the LiDAR to the point, in a frame with z up, m; zero without a point.
    pub ray: [f32; 3],
    /// Height above the ground, m.
    pub height_m: f32,
    /// Raw strength of the return.
    pub intensity: u8,
}

impl PolarPixel {
    /// Length of the ray, m; 0 without a point.
    #[inline(always)]
    pub fn range_m(&self) -> f32 {
        let [x, y, z] = self.ray;
        (x * x + y * y + z * z).sqrt()
    }
    /// Whether the pixel has a point.
    #[inline(always)]
    pub fn is_valid(&self) -> bool {
        self.ray != [0.0; 3]
    }
}

/// An image of rays: rows by ring or elevation, columns by azimuth.
#[derive(Clone, Debug, PartialEq)]
pub struct PolarImage {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Pixels in raster order.
    pub pixels: Vec<PolarPixel>,
    /// Whether intensities are known.
    pub has_intensity: bool,
    /// Camera measurements, the same number of values for each pixel, NaN if unknown; empty if the model does not use
    /// them.
    pub camera: Vec<f32>,
}

impl PolarImage {
    /// The nearest point of every pixel. `pixel` converts a point, given by its index.
    pub fn from_range_image(image: &RangeImage, has_intensity: bool, pixel: impl Fn(usize) -> PolarPixel) -> Self {
        Self::showing(&image.nearest, image.columns, has_intensity, pixel)
    }
    /// Creates the image from the given point of every pixel, [`NO_POINT`] for no point, in raster order.
    pub(super) fn showing(
        points: &[u32],
        columns: usize,
        has_intensity: bool,
        pixel: impl Fn(usize) -> PolarPixel,
    ) -> Self {
        let show = |&point: &u32| if point == NO_POINT { PolarPixel::default() } else { pixel(point as usize) };
        let pixels = points.iter().map(show).collect();
        Self { rows: points.len() / columns.max(1), columns, pixels, has_intensity, camera: Vec::new() }
    }
    /// Converts the intensities of a sweep. Its lowest row is ring 0.
    pub fn apply_intensities(&mut self, map: &IntensityMap) {
        match map {
            IntensityMap::Unchanged => {}
            IntensityMap::Unknown => self.has_intensity = false,
            IntensityMap::ByRing(_) => {
                for (ring, row) in self.pixels.chunks_exact_mut(self.columns.max(1)).rev().enumerate() {
                    for pixel in row {
                        pixel.intensity = map.apply(ring, pixel.intensity);
                    }
                }
            }
        }
    }
    /// Number of values in [`Self::camera`] for each pixel.
    pub fn n_camera_bands(&self) -> usize {
        self.camera.len() / self.pixels.len().max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::super::surface::Surface;
    use super::*;

    /// A LiDAR 2 m above a floor, with a wall 5 m to the left.
    fn room() -> PolarImage {
        let rows = 32;
        let columns = 1024;
        let pixel = |i: usize| {
            let elevation = (10.0 - 1.33 * (i / columns) as f32).to_radians();
            let azimuth = (i % columns) as f32 / columns as f32 * std::f32::consts::TAU;
            let ray = [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()];
            let to_floor = if ray[2] < 0.0 { -2.0 / ray[2] } else { f32::INFINITY };
            let to_wall = if ray[1] > 0.0 { 5.0 / ray[1] } else { f32::INFINITY };
            let range = to_floor.min(to_wall);
            if range > 60.0 {
                return PolarPixel::default();
            }
            PolarPixel { ray: ray.map(|v| v * range), ..PolarPixel::default() }
        };
        PolarImage {
            rows,
            columns,
            pixels: (0..rows * columns).map(pixel).collect(),
            has_intensity: false,
            camera: Vec::new(),
        }
    }

    #[test]
    fn intensities_of_rows_are_mapped_from_the_lowest_up() {
        let pixel = |intensity| PolarPixel { ray: [1.0; 3], intensity, ..PolarPixel::default() };
        let mut image = PolarImage {
            rows: 2,
            columns: 1,
            pixels: vec![pixel(7), pixel(9)],
            has_intensity: true,
            camera: Vec::new(),
        };
        let [lowest, above] = [0_u8, 1].map(|more| std::array::from_fn(|intensity| intensity as u8 / 2 + more));
        image.apply_intensities(&IntensityMap::ByRing(vec![lowest, above]));
        assert_eq!(image.pixels.iter().map(|pixel| pixel.intensity).collect::<Vec<_>>(), [4, 4]);
        image.apply_intensities(&IntensityMap::Unchanged);
        assert!(image.pixels[1].intensity == 4 && image.has_intensity);
        image.apply_intensities(&IntensityMap::Unknown);
        assert!(!image.has_intensity);
    }

    #[test]
    fn normals_of_floor_and_wall_are_perpendicular() {
        let room = room();
        let surface = Surface::from_image(&room);
        let normal = |row, column| surface.tile(row, column / 16 * 16).normal.map(|of_tile| of_tile[column % 16]);
        let mut n_floor = 0;
        let mut n_wall = 0;
        for row in 1..31 {
            for column in 0..1024 {
                let pixel = &room.pixels[row * room.columns + column];
                let normal = normal(row, column);
                if normal == [0.0; 3] {
                    continue;
                }
                let away_from_corner = (pixel.ray[2] + 2.0).abs() > 0.6 || (pixel.ray[1] - 5.0).abs() > 0.6;
                if pixel.range_m() > 15.0 || !away_from_corner {
                    continue;
                }
                if (pixel.ray[2] + 2.0).abs() < 1e-3 {
                    assert!(normal[2] > 0.98, "floor at {:?}: {normal:?}", pixel.ray);
                    n_floor += 1;
                } else {
                    assert!(normal[1] < -0.98, "wall at {:?}: {normal:?}", pixel.ray);
                    n_wall += 1;
                }
            }
        }
        assert!(n_floor > 5000 && n_wall > 3000, "{n_floor} {n_wall}");
        assert_eq!(normal(0, 768), [0.0; 3], "no point, no normal");
    }
}
