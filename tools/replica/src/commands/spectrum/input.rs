//! Images of reflectances: an ENVI cube, or the raw frames of a drive's mosaic camera.

use super::channel::Channel;
use anyhow::{Context, bail};
use formats::drive::Drive;
use formats::envi;
use formats::pgm::Pgm;
use formats::sensor_calibration::SensorCalibration;
use formats::tiff::Tiff;
use image::{Rgb, RgbImage};
use spectral::FrameCounts;
use std::path::Path;

/// One image, band-sequential.
pub struct Cube {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Middle of each band, nm.
    pub wavelengths_nm: Vec<f32>,
    values: Vec<f32>,
    /// Bit b: band b is valid; none if all values are.
    masks: Vec<u32>,
}

impl Cube {
    /// `None` where it is not known.
    fn value(&self, band: usize, cell: usize) -> Option<f32> {
        let is_valid = self.masks.get(cell).is_none_or(|mask| mask >> band & 1 == 1);
        let value = self.values[band * self.size[0] * self.size[1] + cell];
        (is_valid && value.is_finite()).then_some(value)
    }
}

/// What an input holds.
pub struct Source {
    /// For people.
    pub name: String,
    /// By rising wavelength.
    pub channels: Vec<Channel>,
    /// Of the raw samples; none of an ENVI cube, where saturation is not marked.
    pub raw: Option<RawCounts>,
    /// What was asked to be looked at more closely.
    pub region: Option<Selection>,
}

/// A region's values, and what it is.
pub struct Selection {
    /// By channel as those of the [`Source`], the region's cells in the same order, frame by frame; NaN where there is no value.
    pub values: Vec<Vec<f32>>,
    /// All cells of the first frame, the region with a rim of cyan.
    pub picture: RgbImage,
}

/// Over all frames.
#[derive(Clone, Copy, Default)]
pub struct RawCounts {
    /// Frames.
    pub n_frames: u64,
    /// Samples of all frames in the active area.
    pub n_samples: u64,
    /// Those without a reflectance.
    pub counts: FrameCounts,
}

/// Left column, top row, columns and rows, cells.
pub type Region = [usize; 4];

/// Which part of a drive is read.
pub struct Choice<'a> {
    /// Name of the camera; else the only one.
    pub camera: Option<&'a str>,
    /// Index of the frame; else all.
    pub frame: Option<usize>,
    /// Correct the bands by the camera's calibration file.
    pub correction: bool,
    /// Take every frame for one of the white reference's exposure: the share of the white's signal instead of reflectance.
    pub ignore_exposure: bool,
    /// Of the camera of a TIFF, which does not tell its wavelengths.
    pub sensor: Option<&'a SensorCalibration>,
    /// Of the signature.
    pub region: Option<Region>,
}

/// Reads a drive folder, a TIFF or an ENVI cube.
pub fn read(path: &Path, choice: &Choice<'_>) -> anyhow::Result<Source> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    match ending.as_str() {
        _ if path.is_dir() => read_drive(path, choice),
        "tif" | "tiff" => read_tiff(path, choice),
        _ => read_envi(path, choice),
    }
}

/// A cube as a camera's program bins it, one sample for each band: shares of the full scale, as there are no references.
fn read_tiff(path: &Path, choice: &Choice<'_>) -> anyhow::Result<Source> {
    let about = || path.display().to_string();
    let image = Tiff::parse(&std::fs::read(path).with_context(about)?).with_context(about)?;
    let n_bands = image.n_bands as usize;
    if n_bands == 1 {
        bail!("{}: a raw mosaic; replica cube makes a cube of it", path.display());
    }
    let wavelengths_nm: Vec<f32> = match choice.sensor {
        Some(sensor) if sensor.bands.len() == n_bands => {
            sensor.bands.iter().map(|band| band.wavelength_nm() as f32).collect()
        }
        Some(sensor) => bail!("{}: {n_bands} bands; must be {}, as --sensor has", path.display(), sensor.bands.len()),
        // Without wavelengths channels have their numbers.
        None => (1..=n_bands).map(|band| band as f32).collect(),
    };
    let largest = u16::MAX >> (16 - image.bit_depth);
    let n_cells = image.samples.len() / n_bands;
    let value = |(cell, band): (usize, usize)| match image.samples[cell * n_bands + band] {
        sample if sample == largest => f32::NAN,
        sample => f32::from(sample) / f32::from(largest),
    };
    let values = (0..n_bands).flat_map(|band| (0..n_cells).map(move |cell| (cell, band))).map(value).collect();
    let cube = Cube { size: [image.width as usize, image.height as usize], wavelengths_nm, values, masks: Vec::new() };
    let exposure = image.exposure_nanos.map(|nanos| format!(" at {} ms", nanos as f64 * 1e-6)).unwrap_or_default();
    let name = format!("{}{exposure}, share of the full scale (no reflectance)", path.display());
    let mut source = Source::new(name, &cube.wavelengths_nm);
    source.add(&cube, choice.region)?;
    let saturated = image.samples.iter().filter(|sample| **sample == largest).count() as u64;
    let counts = FrameCounts { saturated, ..FrameCounts::default() };
    source.raw = Some(RawCounts { n_frames: 1, n_samples: image.samples.len() as u64, counts });
    Ok(source.sorted())
}

fn read_envi(path: &Path, choice: &Choice<'_>) -> anyhow::Result<Source> {
    let image = envi::read(path)?;
    let header = &image.header;
    let scale = header.reflectance_scale_factor.unwrap_or(1.0);
    let n_cells = header.samples * header.lines;
    let mut wavelengths_nm = header.wavelengths_nm().map_err(anyhow::Error::msg)?;
    if wavelengths_nm.len() != header.bands {
        // Without wavelengths channels have their numbers.
        wavelengths_nm = (1..=header.bands).map(|band| band as f32).collect();
    }
    let ignored = |value: f32| !value.is_finite() || Some(value) == header.data_ignore_value;
    let values = image.values.iter().map(|value| if ignored(*value) { f32::NAN } else { value / scale }).collect();
    debug_assert!(n_cells > 0);
    let size = [header.samples, header.lines];
    let cube = Cube { size, wavelengths_nm, values, masks: Vec::new() };
    let mut source = Source::new(path.display().to_string(), &cube.wavelengths_nm);
    source.add(&cube, choice.region)?;
    Ok(source.sorted())
}

fn read_drive(path: &Path, choice: &Choice<'_>) -> anyhow::Result<Source> {
    let drive = Drive::open(path)?;
    let mosaics = &drive.manifest().mosaics;
    let names = || mosaics.iter().map(|entry| entry.name.as_str()).collect::<Vec<_>>().join(", ");
    let index = match choice.camera {
        Some(name) => mosaics.iter().position(|entry| entry.name == name),
        None => (mosaics.len() == 1).then_some(0),
    };
    let index = index.with_context(|| format!("{}: --camera must be one of {}", path.display(), names()))?;
    let (entry, sensor) = (&mosaics[index], drive.sensors()[index].as_ref());
    let camera = spectral::Camera::read(drive.folder(), entry, sensor.filter(|_| choice.correction))
        .map_err(anyhow::Error::msg)?;
    let wavelengths_nm = camera.wavelengths_nm().to_vec();
    let [columns, rows] = camera.mosaic().cells().map(|side| side as usize);
    let n_cells = columns * rows;
    let (values, masks) = (vec![0.0; n_cells * wavelengths_nm.len()], vec![0; n_cells]);
    let mut cube = Cube { size: [columns, rows], wavelengths_nm, values, masks };
    let frames: Vec<_> = drive.mosaic_frames().iter().filter(|frame| frame.camera == index).collect();
    if choice.frame.is_some_and(|frame| frame >= frames.len()) {
        bail!("{}: --frame must be below {}, the frames of {}", path.display(), frames.len(), entry.name);
    }
    let exposure_ms = entry.exposure_nanos as f64 * 1e-6;
    let (exposure_nanos, note) = if choice.ignore_exposure {
        (entry.white_exposure_nanos, ", share of the white's signal")
    } else {
        (entry.exposure_nanos, "")
    };
    let name = format!("{} {} at {exposure_ms} ms{note}", path.display(), entry.name);
    let mut source = Source::new(name, &cube.wavelengths_nm);
    let mut raw = RawCounts::default();
    for (_, frame) in frames.iter().enumerate().filter(|(k, _)| choice.frame.is_none_or(|frame| frame == *k)) {
        let about = || frame.path.display().to_string();
        let bytes = std::fs::read(&frame.path).with_context(about)?;
        let image = Pgm::parse(&bytes).with_context(about)?;
        let counts = camera.cube_into(&image.samples(), exposure_nanos, &mut cube.values, &mut cube.masks);
        let counts = counts.with_context(about)?;
        raw.n_frames += 1;
        raw.n_samples += (n_cells * camera.mosaic().n_bands()) as u64;
        raw.counts.saturated += counts.saturated;
        raw.counts.dead += counts.dead;
        raw.counts.clipped += counts.clipped;
        source.add(&cube, choice.region)?;
    }
    source.raw = Some(raw);
    Ok(source.sorted())
}

impl Source {
    fn new(name: String, wavelengths_nm: &[f32]) -> Self {
        let channels = wavelengths_nm.iter().map(|nm| Channel::new(*nm)).collect();
        Self { name, channels, raw: None, region: None }
    }

    /// Mean and standard deviation of a channel in the region; `None` without values.
    pub fn signature(&self, channel: usize) -> Option<[f64; 2]> {
        moments(self.region.as_ref()?.values[channel].iter().map(|value| f64::from(*value)))
    }

    fn add(&mut self, cube: &Cube, region: Option<Region>) -> anyhow::Result<()> {
        let [columns, rows] = cube.size;
        for (band, channel) in self.channels.iter_mut().enumerate() {
            for cell in 0..columns * rows {
                match cube.value(band, cell) {
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
        let selection = self.region.get_or_insert_with(|| Selection {
            values: vec![Vec::new(); cube.wavelengths_nm.len()],
            picture: picture(cube, [x, y, width, height]),
        });
        for (band, values) in selection.values.iter_mut().enumerate() {
            let cells = (y..y + height).flat_map(|row| row * columns + x..row * columns + x + width);
            values.extend(cells.map(|cell| cube.value(band, cell).unwrap_or(f32::NAN)));
        }
        Ok(())
    }

    fn sorted(mut self) -> Self {
        let mut order: Vec<usize> = (0..self.channels.len()).collect();
        order.sort_by(|a, b| self.channels[*a].wavelength_nm.total_cmp(&self.channels[*b].wavelength_nm));
        if let Some(selection) = &mut self.region {
            selection.values = order.iter().map(|band| std::mem::take(&mut selection.values[*band])).collect();
        }
        self.channels.sort_by(|a, b| a.wavelength_nm.total_cmp(&b.wavelength_nm));
        self
    }
}

/// Mean and standard deviation of those values that are numbers; `None` without any.
pub fn moments(values: impl Iterator<Item = f64> + Clone) -> Option<[f64; 2]> {
    let values = values.filter(|value| value.is_finite());
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let square = values.map(|value| (value - mean).powi(2)).sum::<f64>() / n;
    (n > 0.0).then(|| [mean, square.sqrt()])
}

/// All cells: the bands of the longest, the middle and the shortest wavelength as red, green and blue, each up to the largest but one in fifty
/// of its values; black where one is missing.
fn picture(cube: &Cube, [x, y, width, height]: Region) -> RgbImage {
    let [columns, rows] = cube.size;
    let mut bands: Vec<usize> = (0..cube.wavelengths_nm.len()).collect();
    bands.sort_by(|a, b| cube.wavelengths_nm[*b].total_cmp(&cube.wavelengths_nm[*a]));
    let bands = [bands[0], bands[bands.len() / 2], bands[bands.len() - 1]];
    let white = bands.map(|band| {
        let mut values: Vec<f32> = (0..columns * rows).filter_map(|cell| cube.value(band, cell)).collect();
        values.sort_by(f32::total_cmp);
        values.get(values.len() * 49 / 50).copied().unwrap_or(1.0).max(1e-6)
    });
    // The rim lies around the region, where the image does not end.
    let is_on = |at: usize, start: usize, length: usize| at + 1 == start || at == start + length;
    let is_in = |at: usize, start: usize, length: usize| at + 1 >= start && at <= start + length;
    RgbImage::from_fn(columns as u32, rows as u32, |column, row| {
        let (column, row) = (column as usize, row as usize);
        let is_rim =
            is_in(column, x, width) && is_in(row, y, height) && (is_on(column, x, width) || is_on(row, y, height));
        if is_rim {
            return Rgb([0, 255, 255]);
        }
        // The square root is near what screens expect.
        let level = |i: usize| {
            Some((255.0 * (cube.value(bands[i], row * columns + column)? / white[i]).clamp(0.0, 1.0).sqrt()) as u8)
        };
        let levels = || Some([level(0)?, level(1)?, level(2)?]);
        Rgb(levels().unwrap_or_default())
    })
}
