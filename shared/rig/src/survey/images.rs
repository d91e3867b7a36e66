//! Pixels of camera files.

use acquisition::recorded::image_into;
use coloring::ColorImage;
use drive::Frame;
use drive::manifest::CameraEntry;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The decoded pixels of an image: three bytes each.
#[derive(Clone, Debug)]
pub struct PixelBuffer {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Red, green, blue, row by row.
    pub bytes: Vec<u8>,
}

impl PixelBuffer {
    /// The image in the form that the projection reads.
    pub fn view(&self) -> Option<ColorImage<'_>> {
        ColorImage::new(0, self.width, self.height, &self.bytes)
    }

    /// The image with left and right exchanged.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let row = |row: &[u8]| row.chunks_exact(3).rev().flatten().copied().collect::<Vec<u8>>();
        let bytes = self.bytes.chunks_exact(3 * self.width.max(1) as usize).flat_map(row).collect();
        Self { bytes, ..*self }
    }
}

/// The pixels of a file; `None` if it is damaged or its size differs from the camera's. `acquire` reports such files.
pub fn decoded(frame: &Frame, entry: &CameraEntry) -> Option<PixelBuffer> {
    let (width, height) = entry.model.size();
    let mut bytes = vec![0; 3 * width as usize * height as usize];
    // The decoder panics on some damaged files.
    let result = catch_unwind(AssertUnwindSafe(|| image_into(&frame.path, entry, &mut bytes)));
    matches!(result, Ok(Ok(()))).then_some(PixelBuffer { width, height, bytes })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirrored_image_exchanges_left_and_right() {
        let image = PixelBuffer { width: 2, height: 2, bytes: (0..12).collect() };
        assert_eq!(image.mirrored().bytes, [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]);
        assert_eq!(image.mirrored().mirrored().bytes, image.bytes);
    }
}
