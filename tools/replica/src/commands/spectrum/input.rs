//! Images of reflectances: an ENVI cube, or the raw frames of a drive's mosaic camera.

use super::channel::Channel;
use anyhow::{Context, bail};
use formats::drive::Drive;
use formats::envi;
use formats::pgm::Pgm;
use formats::sensor_calibration::SensorCalibration;
use formats::tiff::Tiff;
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

/// What an input holds.
pub struct Source {
    /// For people.
    pub name: String,
    /// By rising wavelength.
    pub channels: Vec<Channel>,
    /// Of the raw samples; none of an ENVI cube, where saturation is not marked.
    pub raw: Option<RawCounts>,
    /// The region's mean and standard deviation by channel, if one was asked for.
    pub signature: Vec<Moments>,
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

/// Mean and standard deviation of a region, with the values that they come from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Valid values.
    pub n: u64,
    sum: f64,
    sum_of_squares: f64,
}

impl Moments {
    fn add(&mut self, value: f64) {
        self.n += 1;
        self.sum += value;
        self.sum_of_squares += value * value;
    }
    /// NaN without values.
    pub fn mean(&self) -> f64 {
        self.sum / self.n as f64
    }
    /// NaN without values.
    pub fn deviation(&self) -> f64 {
        (self.sum_of_squares / self.n as f64 - self.mean().powi(2)).max(0.0).sqrt()
    }
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
        Self { name, channels, raw: None, signature: vec![Moments::default(); wavelengths_nm.len()] }
    }

    fn add(&mut self, cube: &Cube, region: Option<Region>) -> anyhow::Result<()> {
        let [columns, rows] = cube.size;
        if let Some([x, y, width, height]) = region {
            let inside = |start: usize, length: usize, limit: usize| length > 0 && start + length <= limit;
            if !(inside(x, width, columns) && inside(y, height, rows)) {
                bail!("{}: region {x},{y},{width},{height} must lie in the {columns} x {rows} cells", self.name);
            }
        }
        for (band, plane) in cube.values.chunks_exact(columns * rows).enumerate() {
            for (cell, value) in plane.iter().enumerate() {
                let is_valid = cube.masks.get(cell).is_none_or(|mask| mask >> band & 1 == 1) && value.is_finite();
                if !is_valid {
                    self.channels[band].add_invalid();
                    continue;
                }
                self.channels[band].add(*value);
                if let Some([x, y, width, height]) = region {
                    let ([column, row], at) = ([cell % columns, cell / columns], [x..x + width, y..y + height]);
                    if at[0].contains(&column) && at[1].contains(&row) {
                        self.signature[band].add(f64::from(*value));
                    }
                }
            }
        }
        Ok(())
    }

    fn sorted(self) -> Self {
        let mut both: Vec<(Channel, Moments)> = self.channels.into_iter().zip(self.signature).collect();
        both.sort_by(|a, b| a.0.wavelength_nm.total_cmp(&b.0.wavelength_nm));
        let (channels, signature) = both.into_iter().unzip();
        Self { channels, signature, ..self }
    }
}
