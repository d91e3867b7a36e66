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
    pub fn of_camera(camera: &ProjectionCamera, header: &ImageHeader, bytes: &'a [u8]) -> Option<Self> {
        let fits = camera.size() == [header.width, header.height] && header.channels == 3;
        Self::new(header.camera as u8, header.width, header.height, bytes).filter(|_| fits)
    }

    /// Index of the camera.
    pub fn camera(&self) -> usize {
        usize::from(self.camera)
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
    pub fn sample(&self, [u, v]: [f32; 2]) -> ColorRow {
        let (x0, x1, share_x) = neighbors(u, self.width);
        let (y0, y1, share_y) = neighbors(v, self.height);
        let corners = [
            (x0, y0, (256 - share_x) * (256 - share_y)),
            (x1, y0, share_x * (256 - share_y)),
            (x0, y1, (256 - share_x) * share_y),
            (x1, y1, share_x * share_y),
        ];
        let half = 1 << 15;
        // Two channels in one number, 32 bits each: the shares sum up to 2^16, so they do not overlap.
        let (mut red_and_blue, mut green) = (half << 32 | half, half);
        for (x, y, share) in corners {
            let [r, g, b] = self.pixels[y * self.width + x].map(u64::from);
            red_and_blue += share * (b << 32 | r);
            green += share * g;
        }
        let [r, g, b] = [red_and_blue >> 16, green >> 16, red_and_blue >> 48].map(|channel| channel as u8);
        ColorRow { r, g, b, camera: self.camera }
    }
}

/// The pixel centers before and after `at`, clamped to the image, and the position of `at` between them in 1/256.
#[inline]
fn neighbors(at: f32, len: usize) -> (usize, usize, u64) {
    // Not negative, so that truncation rounds down. Images are less than 2^15 px wide.
    let steps = (at.max(0.0) * 256.0 + 0.5) as i32 as usize;
    let before = (steps >> 8).min(len - 1);
    (before, (before + 1).min(len - 1), (steps & 255) as u64)
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
    fn image_of_wrong_length_is_none() {
        assert!(ColorImage::new(0, 2, 2, &[0; 11]).is_none());
        assert!(ColorImage::new(0, 2, 2, &[0; 15]).is_none());
        assert!(ColorImage::new(0, 0, 0, &[]).is_none());
    }
}
