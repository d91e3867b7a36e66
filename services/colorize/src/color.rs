//! The `color` column.

use crate::choose::{Choices, Sources};
use crate::chunk::{CHUNK, Chunk};
use crate::level::Levels;
use messages::{ColorRow, UNSEEN};
use rayon::prelude::*;

/// Pixels of an exposure, in place.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    camera: u8,
    width: usize,
    height: usize,
    pixels: &'a [[u8; 3]],
}

impl<'a> Picture<'a> {
    /// `None` unless `bytes` are `width * height * 3` with at least one pixel.
    pub fn new(camera: u8, width: u32, height: u32, bytes: &'a [u8]) -> Option<Self> {
        let (pixels, rest) = bytes.as_chunks::<3>();
        let fits = !pixels.is_empty() && rest.is_empty() && pixels.len() == width as usize * height as usize;
        fits.then_some(Self { camera, width: width as usize, height: height as usize, pixels })
    }

    /// Index of the camera.
    pub fn camera(&self) -> usize {
        usize::from(self.camera)
    }

    /// Between the pixels around, 0 to 255.
    pub fn brightness(&self, pixel: [f32; 2]) -> f32 {
        let ColorRow { r, g, b, .. } = self.sample(pixel);
        (f32::from(r) + 2.0 * f32::from(g) + f32::from(b)) / 4.0
    }

    /// Bilinear between the four pixels around (u, v), which lies at most half a pixel outside the outermost centers. In steps of
    /// 1/256 px, because whole numbers take half the time of others here.
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
        // Two channels in one number, 32 bits each: the shares sum up to 2^16, so none reaches the other.
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

/// The centers before and after `at`, clamped to the image, and how far `at` is from the first to the second, in 1/256.
fn neighbors(at: f32, len: usize) -> (usize, usize, u64) {
    // Not negative, so that cutting off rounds down; images are less than 2^15 px wide.
    let steps = (at.max(0.0) * 256.0 + 0.5) as i32 as usize;
    let before = (steps >> 8).min(len - 1);
    (before, (before + 1).min(len - 1), (steps & 255) as u64)
}

/// Colors all points into `rows` of the same number and says how many were seen. `pictures` belong to the views by index; with
/// `is_leveled`, exposures are made alike and those lose that are too bright or too dark at a point.
pub fn color_into(sources: &Sources<'_>, pictures: &[Picture<'_>], is_leveled: bool, rows: &mut [ColorRow]) -> u64 {
    let levels = is_leveled.then(|| Levels::find(sources, pictures));
    let color_chunk = |choices: &mut Choices, (chunk, rows): (&Chunk, &mut [ColorRow])| {
        choices.fill(chunk, sources);
        rows.fill(UNSEEN_ROW);
        let mut n_seen = 0;
        for (i, view, pixel) in choices.seen() {
            rows[i] = match &levels {
                Some(levels) => leveled(levels, sources, pictures, chunk, (i, view, pixel)),
                None => pictures[view].sample(pixel),
            };
            n_seen += 1;
        }
        n_seen
    };
    let chunks = sources.cloud.chunks().par_iter().zip(rows.par_chunks_mut(CHUNK));
    chunks.map_init(Choices::default, color_chunk).sum()
}

/// The color of a point in the chosen view, or in another one if that shows it as white or black as it can.
pub fn leveled(
    levels: &Levels,
    sources: &Sources<'_>,
    pictures: &[Picture<'_>],
    chunk: &Chunk,
    (i, view, pixel): (usize, usize, [f32; 2]),
) -> ColorRow {
    let row = pictures[view].sample(pixel);
    if is_exposed(row) {
        return levels.leveled(row, view);
    }
    let other = Choices::other(i, chunk, sources, |view, pixel| is_exposed(pictures[view].sample(pixel)));
    let (view, pixel) = other.unwrap_or((view, pixel));
    levels.leveled(pictures[view].sample(pixel), view)
}

/// Whether the sensor told a color: it does not where a channel is full or all are empty.
fn is_exposed(row: ColorRow) -> bool {
    let brightest = row.r.max(row.g).max(row.b);
    (4..254).contains(&brightest)
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
