//! A mosaic camera with its references, from a drive folder or from arguments.

use super::Args;
use anyhow::{Context, bail};
use drive::Drive;
use formats::raw_mosaic::RawMosaic;
use formats::sensor_calibration::{FilterBand, SensorCalibration};
use spectral::{Calibration, Camera, DarkReference, Mosaic, Reference, WhitePanel};
use std::path::{Path, PathBuf};

/// A calibrated camera and the meaning of its values.
pub struct CameraSetup {
    pub camera: Camera,
    /// Meaning of the values of the cubes.
    pub description: String,
    /// Unit of the band positions; "Index" if the wavelengths are unknown.
    pub wavelength_units: &'static str,
    /// Full width at half maximum of the bands, if they are corrected.
    pub fwhm_nm: Vec<f64>,
    /// Exposure time of the frames of a drive. For other frames it is in the file or in an argument.
    exposure_nanos: Option<u64>,
    /// Whether the values are reflectances, which need exposure times.
    is_reflectance: bool,
}

const REFLECTANCE: &str = "reflectance";
const SHARE: &str = "share of the full scale, not a reflectance: no white reference";

/// A camera of a drive.
pub struct DriveCamera {
    pub setup: CameraSetup,
    /// Its frames.
    pub frames: Vec<PathBuf>,
}

impl CameraSetup {
    /// The camera of a drive.
    pub fn from_drive(folder: &Path, args: &Args) -> anyhow::Result<DriveCamera> {
        let drive = Drive::open(folder)?;
        let mosaics = &drive.manifest().mosaics;
        let index = match &args.camera {
            Some(name) => mosaics.iter().position(|entry| entry.name == *name),
            None => (mosaics.len() == 1).then_some(0),
        };
        let Some(index) = index else {
            let names = mosaics.iter().map(|entry| entry.name.as_str()).collect::<Vec<_>>().join(", ");
            bail!("{}: --camera must be one of the mosaic cameras of the drive: {names}", folder.display());
        };
        let sensor = drive.sensors()[index].as_ref().filter(|_| !args.uncorrected);
        let camera = Camera::read(drive.folder(), &mosaics[index], sensor).map_err(anyhow::Error::msg)?;
        let frames = drive.mosaic_frames().iter().filter(|frame| frame.camera == index);
        let setup = Self {
            fwhm_nm: fwhm_nm(&camera, sensor),
            description: describe(REFLECTANCE, &camera),
            camera,
            wavelength_units: "nm",
            exposure_nanos: Some(mosaics[index].exposure_nanos),
            is_reflectance: true,
        };
        Ok(DriveCamera { setup, frames: frames.map(|frame| frame.path.clone()).collect() })
    }

    /// The camera of a single frame, with the references from the arguments.
    pub fn from_frame(frame: &RawMosaic, args: &Args) -> anyhow::Result<Self> {
        let sensor = args.sensor.as_deref().map(crate::sensor_calibration::read).transpose()?;
        let size = [frame.width, frame.height];
        let (pattern, area) = match &sensor {
            Some(sensor) => (sensor.pattern, active_area(size, sensor)?),
            None => match args.pattern {
                Some(pattern) => (pattern, [0, 0, frame.width, frame.height]),
                None => bail!("--sensor XML or --pattern PX must be given"),
            },
        };
        let of_sensor = sensor.as_ref().and_then(|sensor| sensor.bit_depth);
        let bit_depth = args.bit_depth.unwrap_or(frame.bit_depth.min(of_sensor.unwrap_or(16)));
        let mosaic = Mosaic::new(size, pattern, area, bit_depth)?;
        let FrameCalibration { calibration, is_reflectance } = calibration(&mosaic, frame, args)?;
        let n_bands = mosaic.n_bands();
        let filters_nm: Vec<f64> = match &sensor {
            Some(sensor) => sensor.bands.iter().map(FilterBand::wavelength_nm).collect(),
            None => (1..=n_bands).map(|band| band as f64).collect(),
        };
        // The correction matrix is defined for reflectances.
        let sensor = sensor.filter(|_| is_reflectance && !args.uncorrected);
        let camera = Camera::new(calibration, &filters_nm, sensor.as_ref())?;
        let quantity = if is_reflectance { REFLECTANCE } else { SHARE };
        let without_dark = if args.dark.is_empty() { ", no dark reference subtracted" } else { "" };
        Ok(Self {
            fwhm_nm: fwhm_nm(&camera, sensor.as_ref()),
            description: describe(&format!("{quantity}{without_dark}"), &camera),
            camera,
            wavelength_units: if args.sensor.is_some() { "nm" } else { "Index" },
            exposure_nanos: None,
            is_reflectance,
        })
    }

    /// Exposure time of a frame; `argument` takes precedence.
    pub fn exposure_nanos(&self, frame: &RawMosaic, argument: Option<u64>) -> anyhow::Result<u64> {
        if !self.is_reflectance {
            return Ok(1);
        }
        let known = argument.or(self.exposure_nanos).or(frame.exposure_nanos);
        known.context("--exposure-ms must be given: the file has no exposure time")
    }
}

/// Calibration of a camera from arguments.
struct FrameCalibration {
    calibration: Calibration,
    /// Whether it gives reflectances.
    is_reflectance: bool,
}

fn calibration(mosaic: &Mosaic, frame: &RawMosaic, args: &Args) -> anyhow::Result<FrameCalibration> {
    let white = if args.white.is_empty() { None } else { Some(reference("white", &args.white, mosaic)?) };
    let of_frame = args.exposure_ms.or(frame.exposure_nanos);
    let TimedReference { reference: dark, exposure_nanos: dark_nanos } = if args.dark.is_empty() {
        TimedReference { reference: constant("dark", mosaic, 0)?, exposure_nanos: None }
    } else {
        reference("dark", &args.dark, mosaic)?
    };
    let dark_nanos = args.dark_exposure_ms.or(dark_nanos).or(of_frame).unwrap_or(1);
    let (white, white_nanos) = match (white, args.white_region) {
        (Some(white), _) => (white.reference, args.white_exposure_ms.or(white.exposure_nanos).or(of_frame)),
        (None, Some(_)) => {
            let mut white = Reference::new("white", mosaic);
            white.add(&frame.samples)?;
            (white, of_frame)
        }
        (None, None) => {
            // A white level one below the full scale, which would count as saturated.
            let full = f64::from(mosaic.saturation());
            let panel = WhitePanel { exposure_nanos: 1, reflectances: vec![(full - 1.0) / full], region: None };
            let white = constant("white", mosaic, mosaic.saturation() - 1)?;
            let calibration =
                Calibration::with_panel(mosaic, &[DarkReference { exposure_nanos: 1, frames: &dark }], &white, &panel)?;
            return Ok(FrameCalibration { calibration, is_reflectance: false });
        }
    };
    let exposure_nanos = white_nanos.context("--white-exposure-ms must be given: the file has no exposure time")?;
    let panel = WhitePanel { exposure_nanos, reflectances: args.white_reflectance.clone(), region: args.white_region };
    let dark = DarkReference { exposure_nanos: dark_nanos, frames: &dark };
    let calibration = Calibration::with_panel(mosaic, &[dark], &white, &panel)?;
    Ok(FrameCalibration { calibration, is_reflectance: true })
}

fn constant(what: &'static str, mosaic: &Mosaic, level: u16) -> anyhow::Result<Reference> {
    let mut reference = Reference::new(what, mosaic);
    reference.add(&vec![level; mosaic.n_samples()])?;
    Ok(reference)
}

/// The mean of some frames.
struct TimedReference {
    reference: Reference,
    /// Exposure time if it is the same in all files.
    exposure_nanos: Option<u64>,
}

fn reference(what: &'static str, paths: &[PathBuf], mosaic: &Mosaic) -> anyhow::Result<TimedReference> {
    let mut reference = Reference::new(what, mosaic);
    let mut exposures = Vec::new();
    for path in images(paths)? {
        let frame = RawMosaic::read(&path)?;
        let [width, height] = mosaic.size();
        if [frame.width, frame.height] != mosaic.size() {
            bail!(
                "{}: {} x {} px; must be {width} x {height} like the frame",
                path.display(),
                frame.width,
                frame.height
            );
        }
        reference.add(&frame.samples).with_context(|| path.display().to_string())?;
        exposures.push(frame.exposure_nanos);
    }
    let first = exposures.first().copied().flatten().filter(|first| exposures.iter().all(|e| *e == Some(*first)));
    Ok(TimedReference { reference, exposure_nanos: first })
}

/// The files, and the images of the folders sorted by name.
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
            bail!("{}: no .pgm, .tif or .tiff file in this folder", path.display());
        }
        found.sort();
        images.extend(found);
    }
    Ok(images)
}

/// The active area in a frame of the whole sensor, or in a frame that is cropped to it.
fn active_area(size: [u32; 2], sensor: &SensorCalibration) -> anyhow::Result<[u32; 4]> {
    let [x, y, width, height] = sensor.active_area;
    match size {
        size if size == sensor.size => Ok([x, y, width, height]),
        size if size == [width, height] => Ok([0, 0, width, height]),
        [w, h] => {
            let [full_width, full_height] = sensor.size;
            bail!("{w} x {h} px; must be {full_width} x {full_height}, or {width} x {height} (the active area)")
        }
    }
}

fn fwhm_nm(camera: &Camera, sensor: Option<&SensorCalibration>) -> Vec<f64> {
    let matrix = sensor.and_then(SensorCalibration::reflectance_matrix).filter(|_| camera.correction().is_some());
    matrix.map(|matrix| matrix.virtual_bands.iter().map(|band| band.fwhm_nm).collect()).unwrap_or_default()
}

fn describe(quantity: &str, camera: &Camera) -> String {
    let bands = if camera.correction().is_some() { "virtual bands" } else { "bands as measured by the filters" };
    format!("{quantity}; {bands}")
}
