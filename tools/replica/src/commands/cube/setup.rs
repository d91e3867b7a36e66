//! A camera with its references, out of a drive folder or of what was typed.

use super::Args;
use anyhow::{Context, bail};
use formats::drive::Drive;
use formats::raw_mosaic::RawMosaic;
use formats::sensor_calibration::{FilterBand, SensorCalibration};
use spectral::{Calibration, Camera, Mosaic, Reference, WhitePanel};
use std::path::{Path, PathBuf};

/// All that a frame needs.
pub struct Setup {
    pub camera: Camera,
    /// What the numbers of the cubes are.
    pub description: String,
    /// Of the bands; "Index" if nobody told the wavelengths.
    pub wavelength_units: &'static str,
    /// Of the bands, if they are corrected.
    pub fwhm_nm: Vec<f64>,
    /// Of the drive's frames; of others the file says it, or the user.
    exposure_nanos: Option<u64>,
    /// Without a white reference exposure times have no meaning.
    is_reflectance: bool,
}

const REFLECTANCE: &str = "reflectance";
const SHARE: &str = "share of the full scale, no reflectance: no white reference";

impl Setup {
    /// Of a drive's camera, and its frames.
    pub fn of_drive(folder: &Path, args: &Args) -> anyhow::Result<(Self, Vec<PathBuf>)> {
        let drive = Drive::open(folder)?;
        let mosaics = &drive.manifest().mosaics;
        let place = match &args.camera {
            Some(name) => mosaics.iter().position(|entry| entry.name == *name),
            None => (mosaics.len() == 1).then_some(0),
        };
        let Some(index) = place else {
            let names = mosaics.iter().map(|entry| entry.name.as_str()).collect::<Vec<_>>().join(", ");
            bail!("{}: --camera must name a mosaic camera of the drive: {names}", folder.display());
        };
        let sensor = drive.sensors()[index].as_ref().filter(|_| !args.uncorrected);
        let camera = Camera::read(drive.folder(), &mosaics[index], sensor).map_err(anyhow::Error::msg)?;
        let frames = drive.mosaic_frames().iter().filter(|frame| frame.camera == index);
        let setup = Self {
            fwhm_nm: fwhm_nm(&camera, sensor),
            description: words(REFLECTANCE, &camera),
            camera,
            wavelength_units: "nm",
            exposure_nanos: Some(mosaics[index].exposure_nanos),
            is_reflectance: true,
        };
        Ok((setup, frames.map(|frame| frame.path.clone()).collect()))
    }

    /// Of a frame by itself, with the references that were typed.
    pub fn of_frame(frame: &RawMosaic, args: &Args) -> anyhow::Result<Self> {
        let sensor = args.sensor.as_deref().map(crate::commands::read_sensor).transpose()?;
        let size = [frame.width, frame.height];
        let (pattern, area) = match &sensor {
            Some(sensor) => (sensor.pattern, active_area(size, sensor)?),
            None => match args.pattern {
                Some(pattern) => (pattern, [0, 0, frame.width, frame.height]),
                None => bail!("--sensor (the camera's calibration file) or --pattern must be given"),
            },
        };
        let of_sensor = sensor.as_ref().and_then(|sensor| sensor.bit_depth);
        let bit_depth = args.bit_depth.unwrap_or(frame.bit_depth.min(of_sensor.unwrap_or(16)));
        let mosaic = Mosaic::new(size, pattern, area, bit_depth)?;
        let (calibration, is_reflectance) = calibration(&mosaic, frame, args)?;
        let n_bands = mosaic.n_bands();
        let filters_nm: Vec<f64> = match &sensor {
            Some(sensor) => sensor.bands.iter().map(FilterBand::wavelength_nm).collect(),
            None => (1..=n_bands).map(|band| band as f64).collect(),
        };
        // The matrix is for reflectances.
        let sensor = sensor.filter(|_| is_reflectance && !args.uncorrected);
        let camera = Camera::new(calibration, &filters_nm, sensor.as_ref())?;
        let quantity = if is_reflectance { REFLECTANCE } else { SHARE };
        let without_dark = if args.dark.is_empty() { ", no dark reference: nothing subtracted" } else { "" };
        Ok(Self {
            fwhm_nm: fwhm_nm(&camera, sensor.as_ref()),
            description: words(&format!("{quantity}{without_dark}"), &camera),
            camera,
            wavelength_units: if args.sensor.is_some() { "nm" } else { "Index" },
            exposure_nanos: None,
            is_reflectance,
        })
    }

    /// Of a frame.
    pub fn exposure_nanos(&self, frame: &RawMosaic, typed: Option<u64>) -> anyhow::Result<u64> {
        if !self.is_reflectance {
            return Ok(1);
        }
        let known = typed.or(self.exposure_nanos).or(frame.exposure_nanos);
        known.context("--exposure-ms must be given: the file does not say it")
    }
}

/// Gains of the frame's camera, and whether they give reflectances.
fn calibration(mosaic: &Mosaic, frame: &RawMosaic, args: &Args) -> anyhow::Result<(Calibration, bool)> {
    let white = if args.white.is_empty() { None } else { Some(reference("white", &args.white, mosaic)?) };
    let of_frame = args.exposure_ms.or(frame.exposure_nanos);
    let (dark, dark_nanos) = if args.dark.is_empty() {
        (constant("dark", mosaic, 0)?, None)
    } else {
        reference("dark", &args.dark, mosaic)?
    };
    let dark_nanos = args.dark_exposure_ms.or(dark_nanos).or(of_frame).unwrap_or(1);
    let (white, white_nanos) = match (white, args.white_region) {
        (Some((white, nanos)), _) => (white, args.white_exposure_ms.or(nanos).or(of_frame)),
        (None, Some(_)) => {
            let mut white = Reference::new("white", mosaic);
            white.add(&frame.samples)?;
            (white, of_frame)
        }
        (None, None) => {
            // A white of nearly the full scale, as its largest value would be saturated.
            let full = f64::from(mosaic.saturation());
            let panel = WhitePanel { exposure_nanos: 1, reflectances: vec![(full - 1.0) / full], region: None };
            let white = constant("white", mosaic, mosaic.saturation() - 1)?;
            return Ok((Calibration::with_panel(mosaic, &[(1, &dark)], &white, &panel)?, false));
        }
    };
    let exposure_nanos = white_nanos.context("--white-exposure-ms must be given: the file does not say it")?;
    let panel = WhitePanel { exposure_nanos, reflectances: args.white_reflectance.clone(), region: args.white_region };
    Ok((Calibration::with_panel(mosaic, &[(dark_nanos, &dark)], &white, &panel)?, true))
}

fn constant(what: &'static str, mosaic: &Mosaic, level: u16) -> anyhow::Result<Reference> {
    let mut reference = Reference::new(what, mosaic);
    reference.add(&vec![level; mosaic.n_samples()])?;
    Ok(reference)
}

/// The mean of all frames, and their exposure time if the files say one and the same.
fn reference(what: &'static str, paths: &[PathBuf], mosaic: &Mosaic) -> anyhow::Result<(Reference, Option<u64>)> {
    let mut reference = Reference::new(what, mosaic);
    let mut exposures = Vec::new();
    for path in images(paths)? {
        let frame = RawMosaic::read(&path)?;
        let [width, height] = mosaic.size();
        if [frame.width, frame.height] != mosaic.size() {
            bail!(
                "{}: {} x {} px; must be {width} x {height}, as the frame",
                path.display(),
                frame.width,
                frame.height
            );
        }
        reference.add(&frame.samples).with_context(|| path.display().to_string())?;
        exposures.push(frame.exposure_nanos);
    }
    let first = exposures.first().copied().flatten().filter(|first| exposures.iter().all(|e| *e == Some(*first)));
    Ok((reference, first))
}

/// Files as they are, of folders the images in them, by name.
fn images(paths: &[PathBuf]) -> anyhow::Result<Vec<PathBuf>> {
    let mut images = Vec::new();
    for path in paths {
        if !path.is_dir() {
            images.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(path).with_context(|| path.display().to_string())?;
        let entries = entries.filter_map(|entry| Some(entry.ok()?.path()));
        let is_image = |path: &PathBuf| path.extension().is_some_and(|e| e == "pgm" || e == "tif" || e == "tiff");
        let mut found: Vec<PathBuf> = entries.filter(is_image).collect();
        if found.is_empty() {
            bail!("{}: no .pgm, .tif or .tiff in it", path.display());
        }
        found.sort();
        images.extend(found);
    }
    Ok(images)
}

/// Where the filters are in a frame: of the whole sensor, or cut to the active area already.
fn active_area(size: [u32; 2], sensor: &SensorCalibration) -> anyhow::Result<[u32; 4]> {
    let [x, y, width, height] = sensor.active_area;
    match size {
        size if size == sensor.size => Ok([x, y, width, height]),
        size if size == [width, height] => Ok([0, 0, width, height]),
        [w, h] => {
            let [full_width, full_height] = sensor.size;
            bail!("{w} x {h} px; must be {full_width} x {full_height}, or {width} x {height}, the active area alone")
        }
    }
}

fn fwhm_nm(camera: &Camera, sensor: Option<&SensorCalibration>) -> Vec<f64> {
    let matrix = sensor.and_then(SensorCalibration::reflectance_matrix).filter(|_| camera.correction().is_some());
    matrix.map(|matrix| matrix.virtual_bands.iter().map(|band| band.fwhm_nm).collect()).unwrap_or_default()
}

fn words(quantity: &str, camera: &Camera) -> String {
    let bands = if camera.correction().is_some() { "virtual bands" } else { "bands as the filters measured them" };
    format!("{quantity}; {bands}")
}
