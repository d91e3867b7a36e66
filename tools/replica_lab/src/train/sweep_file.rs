//! Images in a file: a data set may be larger than the memory.

use super::labeled_image::LabeledImage;
use anyhow::Context;
use segmentation::spherical::{PolarImage, PolarPixel};
use std::fs::File;
use std::io::Write;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// Bytes of a pixel: ray and height as `f32`, intensity, and class. The measurements of the cameras follow all pixels, as `f32`.
const PIXEL_BYTES: usize = 18;

/// Images of equally many columns in a file without a name, which the system removes with the process.
pub struct SweepFile {
    file: File,
    columns: usize,
    /// Measurements of the cameras at each pixel.
    n_camera_bands: usize,
    images: Vec<Stored>,
    n_bytes: u64,
}

/// An image in the file.
struct Stored {
    start: u64,
    rows: usize,
    has_intensity: bool,
}

impl SweepFile {
    /// An empty file in a folder.
    pub fn create(folder: &Path, columns: usize, n_camera_bands: usize) -> anyhow::Result<Self> {
        let file = tempfile::tempfile_in(folder).with_context(|| folder.display().to_string())?;
        Ok(Self { file, columns, n_camera_bands, images: Vec::new(), n_bytes: 0 })
    }
    /// Number of images.
    pub fn len(&self) -> usize {
        self.images.len()
    }
    /// Appends an image.
    pub fn push(&mut self, LabeledImage { image, truth }: &LabeledImage) -> anyhow::Result<()> {
        let n_bytes = self.record_bytes(image.rows);
        let mut bytes = Vec::with_capacity(n_bytes);
        for (pixel, class) in image.pixels.iter().zip(truth) {
            for number in pixel.ray.into_iter().chain([pixel.height_m]) {
                bytes.extend(number.to_le_bytes());
            }
            bytes.extend([pixel.intensity, *class]);
        }
        bytes.extend(image.camera.iter().flat_map(|value| value.to_le_bytes()));
        anyhow::ensure!(bytes.len() == n_bytes, "{} rows with {} pixels", image.rows, image.pixels.len());
        self.file.write_all(&bytes).context("the file of the training sweeps")?;
        self.images.push(Stored { start: self.n_bytes, rows: image.rows, has_intensity: image.has_intensity });
        self.n_bytes += n_bytes as u64;
        Ok(())
    }
    /// Reads an image.
    pub fn image(&self, index: usize) -> std::io::Result<LabeledImage> {
        let &Stored { start, rows, has_intensity } = self.images.get(index).ok_or(std::io::ErrorKind::NotFound)?;
        let mut bytes = vec![0; self.record_bytes(rows)];
        self.file.read_exact_at(&mut bytes, start)?;
        let number = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        let pixel = |bytes: &[u8; PIXEL_BYTES]| PolarPixel {
            ray: [number(&bytes[0..]), number(&bytes[4..]), number(&bytes[8..])],
            height_m: number(&bytes[12..]),
            intensity: bytes[16],
        };
        let (pixels, camera) = bytes.split_at(rows * self.columns * PIXEL_BYTES);
        let (pixels, _) = pixels.as_chunks::<PIXEL_BYTES>();
        let image = PolarImage {
            rows,
            columns: self.columns,
            pixels: pixels.iter().map(pixel).collect(),
            has_intensity,
            camera: camera.as_chunks::<4>().0.iter().map(|bytes| number(bytes)).collect(),
        };
        Ok(LabeledImage { image, truth: pixels.iter().map(|bytes| bytes[17]).collect() })
    }
    fn record_bytes(&self, rows: usize) -> usize {
        rows * self.columns * (PIXEL_BYTES + 4 * self.n_camera_bands)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(seed: u16, columns: usize) -> LabeledImage {
        let pixel = |i: usize| PolarPixel {
            ray: [i as f32, f32::from(seed), -0.1],
            height_m: 0.3 * i as f32,
            intensity: (i % 251) as u8,
        };
        let rows = 2 + usize::from(seed);
        let n = rows * columns;
        let image = PolarImage {
            rows,
            columns,
            pixels: (0..n).map(pixel).collect(),
            has_intensity: seed.is_multiple_of(2),
            camera: (0..2 * n).map(|i| 0.01 * i as f32).collect(),
        };
        LabeledImage { image, truth: (0..n).map(|i| (i % 7) as u8).collect() }
    }

    #[test]
    fn images_are_read_as_they_were_written_in_any_order() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut file = SweepFile::create(folder.path(), 64, 2).expect("created");
        let images: Vec<LabeledImage> = (0..3).map(|seed| image(seed, 64)).collect();
        for image in &images {
            file.push(image).expect("written");
        }
        assert_eq!(file.len(), 3);
        for index in [2, 0, 1] {
            let read = file.image(index).expect("read");
            assert!(read.image == images[index].image && read.truth == images[index].truth, "image {index}");
        }
        assert!(file.image(3).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).expect("listed").count(), 0, "the file has no name");
        assert!(file.push(&image(0, 32)).is_err(), "another width");
        assert!(file.push(&image(3, 64)).is_ok_and(|()| file.image(3).is_ok()), "after an error");
    }
}
