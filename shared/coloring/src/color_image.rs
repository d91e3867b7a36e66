//! The pixels of a color exposure.

use crate::ProjectionCamera;
use messages::{ColorRow, ImageHeader};

/// Pixels of a color exposure, in place.
#[derive(Clone, Copy, Debug)]
pub struct ColorImage<'a> {
    camera: u8,
    width: usize,
    height: usize,
    pixels: &'a [[u8; 3]],
}

impl<'a> ColorImage<'a> {
    /// `None` unless `bytes` are `width * height * 3` with at least one pixel.
    pub fn new(camera: u8, width: u32, height: u32, bytes: &'a [u8]) -> Option<Self> {
        let (pixels, rest) = bytes.as_chunks::<3>();
        let fits = !pixels.is_empty() && rest.is_empty() && pixels.len() == width as usize * height as usize;
        fits.then_some(Self { camera, width: width as usize, height: height as usize, pixels })
    }

    /// `None` unless the header matches the camera and the bytes match the header.
    pub fn for_camera(camera: &ProjectionCamera, header: &ImageHeader, bytes: &'a [u8]) -> Option<Self> {
        let fits = camera.size() == [header.width, header.height] && header.channels == 3;
        Self::new(header.camera as u8, header.width, header.height, bytes).filter(|_| fits)
    }

    /// Index of the camera.
    pub fn camera(&self) -> usize {
        usize::from(self.camera)
    }

    /// The pixel nearest to (u, v) and its neighbors in both directions, up to `reach` steps of `step` px, with their
    /// coordinates.
    pub fn around(
        &self,
        [u, v]: [f32; 2],
        reach: usize,
        step: usize,
    ) -> impl Iterator<Item = ([f32; 2], [u8; 3])> + use<'a> {
        let line = |at: f32, len: usize| {
            let middle = ((at.max(0.0) + 0.5) as usize).min(len - 1);
            let first = middle - reach.min(middle / step) * step;
            (first..len.min(middle + reach * step + 1)).step_by(step)
        };
        let columns = line(u, self.width);
        let rows = line(v, self.height);
        let width = self.width;
        let pixels = self.pixels;
        rows.flat_map(move |y| columns.clone().map(move |x| ([x as f32, y as f32], pixels[y * width + x])))
    }

    /// Brightness, 0 to 255, bilinear between the four pixels around.
    #[inline]
    pub fn brightness(&self, pixel: [f32; 2]) -> f32 {
        let ColorRow { r, g, b, .. } = self.sample(pixel);
        (f32::from(r) + 2.0 * f32::from(g) + f32::from(b)) / 4.0
    }

    /// Color at (u, v), bilinear between the four pixels around. (u, v) is at most half a pixel outside the outermost pixel
    /// centers. Computed in steps of 1/256 px: integers take half the time of floats here.
    #[inline]
    pub fn sample(&self, pixel: [f32; 2]) -> ColorRow {
        let half = 1 << 15;
        // Two channels in one number, 32 bits each: the shares add up to 2^16, so they do not overlap.
        let (mut red_and_blue, mut green) = (half << 32 | half, half);
        for (corner, share) in self.corners(pixel) {
            let [r, g, b] = self.at(corner).map(u64::from);
            red_and_blue += share * (b << 32 | r);
            green += share * g;
        }
        let [r, g, b] = [red_and_blue >> 16, green >> 16, red_and_blue >> 48].map(|channel| channel as u8);
        ColorRow { r, g, b, camera: self.camera }
    }

    /// The color of a pixel.
    #[inline(always)]
    pub fn at(&self, [x, y]: [usize; 2]) -> [u8; 3] {
        self.pixels[y * self.width + x]
    }

    /// The four pixels around (u, v), each with its share in 1/65536.
    #[inline(always)]
    pub fn corners(&self, [u, v]: [f32; 2]) -> [([usize; 2], u64); 4] {
        let Neighbors { before: x0, after: x1, share: share_x } = neighbors(u, self.width);
        let Neighbors { before: y0, after: y1, share: share_y } = neighbors(v, self.height);
        [
            ([x0, y0], (256 - share_x) * (256 - share_y)),
            ([x1, y0], share_x * (256 - share_y)),
            ([x0, y1], (256 - share_x) * share_y),
            ([x1, y1], share_x * share_y),
        ]
    }
}

/// The pixel centers around a position, clamped to the image.
struct Neighbors {
    before: usize,
    after: usize,
    /// The position between them in 1/256.
    share: u64,
}

#[inline]
fn neighbors(at: f32, len: usize) -> Neighbors {
    // Not negative, so that truncation rounds down. Images are less than 2^15 px wide.
    let steps = (at.max(0.0) * 256.0 + 0.5) as i32 as usize;
    let before = (steps >> 8).min(len - 1);
    Neighbors { before, after: (before + 1).min(len - 1), share: (steps & 255) as u64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_between_pixels_are_interpolated_and_clamped_at_border() {
        let bytes = [0, 0, 0, 100, 200, 40, 0, 0, 200, 100, 200, 240];
        let image = ColorImage::new(3, 2, 2, &bytes).expect("fits");
        let at = |u, v| {
            let row = image.sample([u, v]);
            assert_eq!(row.camera, 3);
            [row.r, row.g, row.b]
        };
        assert_eq!(at(1.0, 0.0), [100, 200, 40]);
        assert_eq!(at(0.5, 0.0), [50, 100, 20]);
        assert_eq!(at(0.25, 0.5), [25, 50, 110]);
        assert_eq!(at(-0.5, -0.5), [0, 0, 0]);
        assert_eq!(at(1.49, 1.49), [100, 200, 240]);
    }

    #[test]
    fn pixels_around_stay_in_image_and_on_grid() {
        let bytes: Vec<u8> = (0..7 * 5).flat_map(|i| [i, 0, 0]).collect();
        let image = ColorImage::new(0, 7, 5, &bytes).expect("fits");
        let around = |pixel, reach, step| -> Vec<u8> {
            let found = image.around(pixel, reach, step);
            found.inspect(|([u, v], [i, ..])| assert_eq!(v * 7.0 + u, f32::from(*i))).map(|(_, [i, ..])| i).collect()
        };
        assert_eq!(around([2.6, 1.4], 1, 1), [2, 3, 4, 9, 10, 11, 16, 17, 18]);
        assert_eq!(around([3.0, 2.0], 1, 2), [1, 3, 5, 15, 17, 19, 29, 31, 33]);
        assert_eq!(around([-0.4, 4.4], 2, 2), [0, 2, 4, 14, 16, 18, 28, 30, 32], "a corner");
    }

    #[test]
    fn image_of_wrong_length_is_none() {
        assert!(ColorImage::new(0, 2, 2, &[0; 11]).is_none());
        assert!(ColorImage::new(0, 2, 2, &[0; 15]).is_none());
        assert!(ColorImage::new(0, 0, 0, &[]).is_none());
    }
}
