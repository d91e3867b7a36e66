//! The statistics of one input.

use super::channel::Channel;
use super::moments::moments;
use anyhow::bail;
use image::{Rgb, RgbImage};
use spectral::FrameCounts;

/// One image, band-sequential.
pub struct BandImage {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Center wavelength of each band, nm.
    pub wavelengths_nm: Vec<f32>,
    /// Values, band by band, each band row by row.
    pub values: Vec<f32>,
    /// Bit mask of each cell; bit b: band b is valid. Empty if all values are valid.
    pub masks: Vec<u32>,
}

impl BandImage {
    /// The value of a band in a cell. `None` if it is unknown.
    fn value(&self, band: usize, cell: usize) -> Option<f32> {
        let is_valid = self.masks.get(cell).is_none_or(|mask| mask >> band & 1 == 1);
        let value = self.values[band * self.size[0] * self.size[1] + cell];
        (is_valid && value.is_finite()).then_some(value)
    }
}

/// The statistics of one input.
pub struct Source {
    /// Name in reports.
    pub name: String,
    /// Channels, sorted by wavelength.
    pub channels: Vec<Channel>,
    /// Counts of the raw samples. `None` for an ENVI cube, which does not mark saturation.
    pub raw: Option<RawCounts>,
    /// The selected region.
    pub region: Option<RegionValues>,
}

/// The values of a region.
pub struct RegionValues {
    /// Values of the region's cells by channel of the [`Source`], frame by frame. NaN where a value is unknown.
    pub values: Vec<Vec<f32>>,
    /// The first frame, with a cyan frame around the region.
    pub picture: RgbImage,
}

/// Counts over all frames.
#[derive(Clone, Copy, Default)]
pub struct RawCounts {
    /// Frames.
    pub n_frames: u64,
    /// Samples of all frames in the active area.
    pub n_samples: u64,
    /// Samples without a valid reflectance.
    pub counts: FrameCounts,
}

/// Left column, top row, columns and rows, in cells.
pub type Region = [usize; 4];

impl Source {
    /// A source without values.
    pub fn new(name: String, wavelengths_nm: &[f32]) -> Self {
        let channels = wavelengths_nm.iter().map(|nm| Channel::new(*nm)).collect();
        Self { name, channels, raw: None, region: None }
    }

    /// Mean and standard deviation of a channel in the region. `None` without values.
    pub fn signature(&self, channel: usize) -> Option<[f64; 2]> {
        moments(self.region.as_ref()?.values[channel].iter().map(|value| f64::from(*value)))
    }

    /// Adds an image.
    pub fn add(&mut self, image: &BandImage, region: Option<Region>) -> anyhow::Result<()> {
        let [columns, rows] = image.size;
        for (band, channel) in self.channels.iter_mut().enumerate() {
            for cell in 0..columns * rows {
                match image.value(band, cell) {
                    Some(value) => channel.add(value),
                    None => channel.add_invalid(),
                }
            }
        }
        let Some([x, y, width, height]) = region else { return Ok(()) };
        let inside = |start: usize, length: usize, limit: usize| length > 0 && start + length <= limit;
        if !(inside(x, width, columns) && inside(y, height, rows)) {
            bail!("{}: region {x},{y},{width},{height} must lie in the {columns} x {rows} cells", self.name);
        }
        let selection = self.region.get_or_insert_with(|| RegionValues {
            values: vec![Vec::new(); image.wavelengths_nm.len()],
            picture: picture(image, [x, y, width, height]),
        });
        for (band, values) in selection.values.iter_mut().enumerate() {
            let cells = (y..y + height).flat_map(|row| row * columns + x..row * columns + x + width);
            values.extend(cells.map(|cell| image.value(band, cell).unwrap_or(f32::NAN)));
        }
        Ok(())
    }

    /// Sorts the channels by wavelength.
    #[must_use]
    pub fn sorted(mut self) -> Self {
        let mut order: Vec<usize> = (0..self.channels.len()).collect();
        order.sort_by(|a, b| self.channels[*a].wavelength_nm.total_cmp(&self.channels[*b].wavelength_nm));
        if let Some(selection) = &mut self.region {
            selection.values = order.iter().map(|band| std::mem::take(&mut selection.values[*band])).collect();
        }
        self.channels.sort_by(|a, b| a.wavelength_nm.total_cmp(&b.wavelength_nm));
        self
    }
}

/// A false-color picture: the longest, the middle and the shortest wavelength as red, green and blue, each scaled to the 98th
/// percentile of its values. Black where a value is unknown.
fn picture(image: &BandImage, [x, y, width, height]: Region) -> RgbImage {
    let [columns, rows] = image.size;
    let mut bands: Vec<usize> = (0..image.wavelengths_nm.len()).collect();
    bands.sort_by(|a, b| image.wavelengths_nm[*b].total_cmp(&image.wavelengths_nm[*a]));
    let bands = [bands[0], bands[bands.len() / 2], bands[bands.len() - 1]];
    let white = bands.map(|band| {
        let mut values: Vec<f32> = (0..columns * rows).filter_map(|cell| image.value(band, cell)).collect();
        values.sort_by(f32::total_cmp);
        values.get(values.len() * 49 / 50).copied().unwrap_or(1.0).max(1e-6)
    });
    // The frame lies outside the region, clipped to the image.
    let is_on = |at: usize, start: usize, length: usize| at + 1 == start || at == start + length;
    let is_in = |at: usize, start: usize, length: usize| at + 1 >= start && at <= start + length;
    RgbImage::from_fn(columns as u32, rows as u32, |column, row| {
        let column = column as usize;
        let row = row as usize;
        let is_frame =
            is_in(column, x, width) && is_in(row, y, height) && (is_on(column, x, width) || is_on(row, y, height));
        if is_frame {
            return Rgb([0, 255, 255]);
        }
        // The square root approximates the gamma of screens.
        let level = |i: usize| {
            Some((255.0 * (image.value(bands[i], row * columns + column)? / white[i]).clamp(0.0, 1.0).sqrt()) as u8)
        };
        let levels = || Some([level(0)?, level(1)?, level(2)?]);
        Rgb(levels().unwrap_or_default())
    })
}
