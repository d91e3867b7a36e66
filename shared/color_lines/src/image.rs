//! Images of any number of bands.

use crate::ColorLinesError;

/// An image, band-sequential. A pixel with a value that is not finite is invalid in all bands.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    size: [usize; 2],
    n_bands: usize,
    values: &'a [f32],
}

/// Converts the values of an image from pixel-interleaved to band-sequential order.
pub fn band_sequential(interleaved: &[u8], n_bands: usize) -> Vec<f32> {
    let band = |band: usize| interleaved.iter().skip(band).step_by(n_bands).map(|value| f32::from(*value));
    (0..n_bands).flat_map(band).collect()
}

/// The valid pixels of an image.
pub(crate) struct Pixels {
    /// Columns and rows of the image.
    pub size: [usize; 2],
    /// Index of each pixel in the image, row by row.
    pub at: Vec<u32>,
    /// Values of the valid pixels, by band.
    pub bands: Vec<Vec<f32>>,
}

impl<'a> Image<'a> {
    /// An image of `size` = columns, rows, each 1 to 65535. `values` has `n_bands` planes, each row by row.
    pub fn new(size: [usize; 2], n_bands: usize, values: &'a [f32]) -> Result<Self, ColorLinesError> {
        if size.iter().any(|side| !(1..=65_535).contains(side)) || n_bands == 0 {
            return Err(ColorLinesError::Size { size, n_bands });
        }
        let expected = size[0] * size[1] * n_bands;
        if values.len() != expected {
            return Err(ColorLinesError::Length { found: values.len(), expected });
        }
        Ok(Self { size, n_bands, values })
    }

    /// Columns and rows.
    pub const fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Number of bands.
    pub const fn n_bands(&self) -> usize {
        self.n_bands
    }

    /// Number of pixels.
    pub const fn n_pixels(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// The values of a band.
    pub fn band(&self, band: usize) -> &'a [f32] {
        &self.values[band * self.n_pixels()..(band + 1) * self.n_pixels()]
    }

    /// The largest valid value: the peak of PSNR. 0 if no pixel is valid.
    pub fn largest(&self) -> f32 {
        self.values.iter().copied().filter(|value| value.is_finite()).fold(0.0, f32::max)
    }

    /// Its valid pixels.
    pub(crate) fn pixels(&self) -> Pixels {
        let mut is_valid = vec![true; self.n_pixels()];
        for band in 0..self.n_bands {
            is_valid.iter_mut().zip(self.band(band)).for_each(|(valid, value)| *valid &= value.is_finite());
        }
        let at: Vec<u32> = (0..).zip(&is_valid).filter(|(_, valid)| **valid).map(|(index, _)| index).collect();
        let gather = |band: usize| at.iter().map(|index| self.band(band)[*index as usize]).collect();
        Pixels { size: self.size, bands: (0..self.n_bands).map(gather).collect(), at }
    }
}

impl Pixels {
    pub fn len(&self) -> usize {
        self.at.len()
    }
}
