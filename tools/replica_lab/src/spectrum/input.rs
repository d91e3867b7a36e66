//! Reads images of reflectances: ENVI cubes, TIFFs, or the raw frames of a mosaic camera of a drive.

use anyhow::{Context, bail};
use drive::Drive;
use files::regular_file;
use formats::band_image;
use formats::pgm::Pgm;
use formats::sensor_calibration::SensorCalibration;
use formats::tiff::Tiff;
use pictures::bands::source::{BandImage, RawCounts, Region, Source};
use spectral::FrameCounts;
use std::path::Path;

/// The part of the inputs that is read, and how it is read.
pub struct InputSelection<'a> {
    /// Name of the camera. `None`: the only one.
    pub camera: Option<&'a str>,
    /// Index of the frame. `None`: all frames.
    pub frame: Option<usize>,
    /// Apply the spectral correction of the camera's calibration file.
    pub correction: bool,
    /// Use the exposure time of the white reference for every frame: values are shares of the white signal, not reflectances.
    pub ignore_exposure: bool,
    /// Calibration of the camera of a TIFF, which does not contain the wavelengths.
    pub sensor: Option<&'a SensorCalibration>,
    /// Region of the signature.
    pub region: Option<Region>,
}

/// Reads a drive folder, a TIFF or an ENVI cube.
pub fn read(path: &Path, selection: &InputSelection<'_>) -> anyhow::Result<Source> {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_ascii_lowercase();
    match ending.as_str() {
        _ if path.is_dir() => read_drive(path, selection),
        "tif" | "tiff" => read_tiff(path, selection),
        _ => read_envi(path, selection),
    }
}

/// Reads a binned image, as camera software writes it, with one sample per band. The values are shares of the full scale, as
/// there are no references.
fn read_tiff(path: &Path, selection: &InputSelection<'_>) -> anyhow::Result<Source> {
    let about = || path.display().to_string();
    let image = Tiff::parse(&regular_file::read(path).with_context(about)?).with_context(about)?;
    let n_bands = image.n_bands as usize;
    if n_bands == 1 {
        bail!("{}: is a raw mosaic\nhint: convert it with `replica-lab cube`", path.display());
    }
    let wavelengths_nm: Vec<f32> = match selection.sensor {
        Some(sensor) if sensor.bands.len() == n_bands => {
            sensor.bands.iter().map(|band| band.wavelength_nm() as f32).collect()
        }
        Some(sensor) => bail!(
            "{}: {n_bands} bands; must be {}, the number of bands of --sensor",
            path.display(),
            sensor.bands.len()
        ),
        // Without wavelengths, channels are identified by their numbers.
        None => (1..=n_bands).map(|band| band as f32).collect(),
    };
    let largest = u16::MAX >> (16 - image.bit_depth);
    let n_cells = image.samples.len() / n_bands;
    let value = |(cell, band): (usize, usize)| match image.samples[cell * n_bands + band] {
        sample if sample == largest => f32::NAN,
        sample => f32::from(sample) / f32::from(largest),
    };
    let values = (0..n_bands).flat_map(|band| (0..n_cells).map(move |cell| (cell, band))).map(value).collect();
    let cube =
        BandImage { size: [image.width as usize, image.height as usize], wavelengths_nm, values, masks: Vec::new() };
    let exposure = image.exposure_nanos.map(|nanos| format!(" at {} ms", nanos as f64 * 1e-6)).unwrap_or_default();
    let name = format!("{}{exposure}, share of the full scale (not a reflectance)", path.display());
    let mut source = Source::new(name, &cube.wavelengths_nm);
    source.add(&cube, selection.region)?;
    let saturated = image.samples.iter().filter(|sample| **sample == largest).count() as u64;
    let counts = FrameCounts { saturated, ..FrameCounts::default() };
    source.raw = Some(RawCounts { n_frames: 1, n_samples: image.samples.len() as u64, counts });
    Ok(source.sorted())
}

fn read_envi(path: &Path, selection: &InputSelection<'_>) -> anyhow::Result<Source> {
    let band_image::BandImage { size, n_bands, mut wavelengths_nm, values } = band_image::read(path)?;
    if wavelengths_nm.len() != n_bands {
        // Without wavelengths, channels are identified by their numbers.
        wavelengths_nm = (1..=n_bands).map(|band| band as f32).collect();
    }
    let cube = BandImage { size, wavelengths_nm, values, masks: Vec::new() };
    let mut source = Source::new(path.display().to_string(), &cube.wavelengths_nm);
    source.add(&cube, selection.region)?;
    Ok(source.sorted())
}

fn read_drive(path: &Path, selection: &InputSelection<'_>) -> anyhow::Result<Source> {
    let drive = Drive::open(path)?;
    let mosaics = &drive.manifest().mosaics;
    let names = || mosaics.iter().map(|entry| entry.name.as_str()).collect::<Vec<_>>().join(", ");
    let index = match selection.camera {
        Some(name) => mosaics.iter().position(|entry| entry.name == name),
        None => (mosaics.len() == 1).then_some(0),
    };
    let index = index.with_context(|| format!("{}: --camera must be one of {}", path.display(), names()))?;
    let entry = &mosaics[index];
    let sensor = drive.sensors()[index].as_ref();
    let camera = spectral::Camera::read(drive.folder(), entry, sensor.filter(|_| selection.correction))
        .map_err(anyhow::Error::msg)?;
    let wavelengths_nm = camera.wavelengths_nm().to_vec();
    let [columns, rows] = camera.mosaic().cells().map(|side| side as usize);
    let n_cells = columns * rows;
    let values = vec![0.0; n_cells * wavelengths_nm.len()];
    let masks = vec![0; n_cells];
    let mut cube = BandImage { size: [columns, rows], wavelengths_nm, values, masks };
    let frames: Vec<_> = drive.mosaic_frames().iter().filter(|frame| frame.camera == index).collect();
    if selection.frame.is_some_and(|frame| frame >= frames.len()) {
        bail!("{}: --frame must be below {}, the frames of {}", path.display(), frames.len(), entry.name);
    }
    let exposure_ms = entry.exposure_nanos as f64 * 1e-6;
    let (exposure_nanos, note) = if selection.ignore_exposure {
        (entry.white_exposure_nanos, ", share of the white signal")
    } else {
        (entry.exposure_nanos, "")
    };
    let name = format!("{} {} at {exposure_ms} ms{note}", path.display(), entry.name);
    let mut source = Source::new(name, &cube.wavelengths_nm);
    let mut raw = RawCounts::default();
    for (_, frame) in frames.iter().enumerate().filter(|(k, _)| selection.frame.is_none_or(|frame| frame == *k)) {
        let about = || frame.path.display().to_string();
        let bytes = regular_file::read(&frame.path).with_context(about)?;
        let image = Pgm::parse(&bytes).with_context(about)?;
        let counts = camera.cube_into(&image.samples(), exposure_nanos, &mut cube.values, &mut cube.masks);
        let counts = counts.with_context(about)?;
        raw.n_frames += 1;
        raw.n_samples += (n_cells * camera.mosaic().n_bands()) as u64;
        raw.counts.saturated += counts.saturated;
        raw.counts.dead += counts.dead;
        raw.counts.clipped += counts.clipped;
        source.add(&cube, selection.region)?;
    }
    source.raw = Some(raw);
    Ok(source.sorted())
}
