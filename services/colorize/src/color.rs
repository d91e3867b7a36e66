//! The `color` column.

use crate::choose::{Choices, Sources};
use crate::chunk::{CHUNK, Extent};
use messages::{ColorRow, SubmapPoint, UNSEEN};
use rayon::prelude::*;

/// Pixels of an exposure, in place.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    camera: u8,
    width: usize,
    pixels: &'a [[u8; 3]],
}

impl<'a> Picture<'a> {
    /// `None` unless `bytes` are `width * height * 3` with at least one pixel.
    pub fn new(camera: u8, width: u32, height: u32, bytes: &'a [u8]) -> Option<Self> {
        let (pixels, rest) = bytes.as_chunks::<3>();
        let fits = !pixels.is_empty() && rest.is_empty() && pixels.len() == width as usize * height as usize;
        fits.then_some(Self { camera, width: width as usize, pixels })
    }

    /// Bilinear between the four pixels around (u, v), which lies at most half a pixel outside the outermost centers.
    fn sample(&self, [u, v]: [f32; 2]) -> ColorRow {
        let height = self.pixels.len() / self.width;
        let (x0, x1, share_x) = neighbors(u, self.width);
        let (y0, y1, share_y) = neighbors(v, height);
        let pixel = |x: usize, y: usize| self.pixels[y * self.width + x];
        let (top_left, top_right, left, right) = (pixel(x0, y0), pixel(x1, y0), pixel(x0, y1), pixel(x1, y1));
        let channel = |i: usize| {
            let mix = |a: u8, b: u8| f32::from(a) + share_x * (f32::from(b) - f32::from(a));
            let (top, bottom) = (mix(top_left[i], top_right[i]), mix(left[i], right[i]));
            // Between 0 and 255 as all four are; half up.
            (top + share_y * (bottom - top) + 0.5) as u8
        };
        ColorRow { r: channel(0), g: channel(1), b: channel(2), camera: self.camera }
    }
}

/// The centers before and after `at`, clamped to the image, and how far `at` is from the first to the second.
fn neighbors(at: f32, len: usize) -> (usize, usize, f32) {
    let at = at.max(0.0);
    let before = (at as usize).min(len - 1);
    (before, (before + 1).min(len - 1), at - before as f32)
}

/// Colors all points into `rows` of the same number and says how many were seen. `pictures` belong to the views by index.
pub fn color_into(sources: &Sources<'_>, pictures: &[Picture<'_>], rows: &mut [ColorRow]) -> u64 {
    let color_chunk = |choices: &mut Choices,
                       ((points, extent), rows): ((&[SubmapPoint], &Extent), &mut [ColorRow])| {
        choices.fill(points, extent, sources);
        let mut n_seen = 0;
        for (row, choice) in rows.iter_mut().zip(choices.iter()) {
            let seen = choice.and_then(|(view, pixel)| Some((pictures.get(view)?, pixel)));
            n_seen += u64::from(seen.is_some());
            *row = seen.map_or(UNSEEN_ROW, |(picture, pixel)| picture.sample(pixel));
        }
        n_seen
    };
    let chunks = sources.cloud.points.par_chunks(CHUNK).zip(sources.cloud.extents());
    chunks.zip(rows.par_chunks_mut(CHUNK)).map_init(Choices::default, color_chunk).sum()
}

const UNSEEN_ROW: ColorRow = ColorRow { r: 0, g: 0, b: 0, camera: UNSEEN };

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_between_pixels_are_mixed_and_those_at_the_rim_are_not_invented() {
        let bytes = [0, 0, 0, 100, 200, 40, 0, 0, 200, 100, 200, 240];
        let picture = Picture::new(3, 2, 2, &bytes).expect("fits");
        let at = |u, v| {
            let row = picture.sample([u, v]);
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
    fn a_picture_that_does_not_fit_its_size_is_none() {
        assert!(Picture::new(0, 2, 2, &[0; 11]).is_none());
        assert!(Picture::new(0, 2, 2, &[0; 15]).is_none());
        assert!(Picture::new(0, 0, 0, &[]).is_none());
    }
}
