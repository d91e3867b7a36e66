//! `replica-lab cube`: converts raw mosaics to ENVI cubes, with or without a drive.

mod camera_setup;

use anyhow::{Context, bail};
use camera_setup::{CameraSetup, DriveCamera};
use command_line::argument::{InvalidValue, rectangle, words};
use command_line::say;
use formats::envi::{self, Header, Image};
use formats::raw_mosaic::RawMosaic;
use spectral::{FullResolution, Resolution, median_3x3};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Convert raw frames of mosaic cameras to ENVI cubes.
///
/// Writes one cube per frame. With a white reference the values are reflectances, else shares of the full scale.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab cube drives/sample --out cubes")]
pub struct Args {
    /// Raw frames: binary PGM, or TIFF of 8 or 16 bits (a TIFF with one sample per band is converted back to its mosaic); or
    /// drive folders, which contain references and calibration (see --camera)
    #[arg(required = true, value_name = "FRAME|DRIVE")]
    inputs: Vec<PathBuf>,
    /// Folder for the cubes; created if absent
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Name of the mosaic camera of the drives [default: the only one]
    #[arg(long)]
    camera: Option<String>,
    /// Calibration file of the manufacturer: active area, pattern, bands, spectral correction
    #[arg(long, value_name = "XML")]
    sensor: Option<PathBuf>,
    /// Side of the filter pattern of a camera without calibration file, px (1 to 5)
    #[arg(long, conflicts_with = "sensor", value_parser = clap::value_parser!(u32).range(1..=5))]
    pattern: Option<u32>,
    /// Dark frames: files or folders of files
    #[arg(long, value_name = "PATH")]
    dark: Vec<PathBuf>,
    /// White frames: files or folders of files
    #[arg(long, value_name = "PATH")]
    white: Vec<PathBuf>,
    /// Region of the white panel in the white frames, or in each frame without --white: left column, top row, width, height, px
    #[arg(long, value_name = "X,Y,W,H", value_parser = rectangle::<u32>)]
    white_region: Option<[u32; 4]>,
    /// Reflectance of the white panel, 0 to 1: one for all bands, or one per band in the order of the pattern
    #[arg(long, value_delimiter = ',', default_values_t = [0.98])]
    white_reflectance: Vec<f64>,
    /// Exposure time of the frames, ms [default: from the file]
    #[arg(long, value_parser = nanos)]
    exposure_ms: Option<u64>,
    /// Exposure time of the dark frames, ms [default: from the file, else as the frames]
    #[arg(long, value_parser = nanos)]
    dark_exposure_ms: Option<u64>,
    /// Exposure time of the white frames, ms [default: from the file, else as the frames]
    #[arg(long, value_parser = nanos)]
    white_exposure_ms: Option<u64>,
    /// Bits of a sample (1 to 16); the largest value means saturated [default: the smaller of calibration file and frame]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=16))]
    bit_depth: Option<u32>,
    /// Demosaicing: bin gives one cell per cell of the pattern; the others give one cell per pixel, 16 or 25 times the bytes
    #[arg(long, default_value_t = Resolution::Bin, value_parser = words::<Resolution>())]
    demosaic: Resolution,
    /// No spectral correction: bands as measured by the filters
    #[arg(long)]
    uncorrected: bool,
    /// Replace each value by the median of the valid values in its 3x3 cells
    #[arg(long)]
    median: bool,
}

/// Value of unknown cells of the cubes: the usual number in ENVI files, far from any reflectance.
pub const UNKNOWN: f32 = -9999.0;

/// Parses milliseconds to ns.
fn nanos(text: &str) -> Result<u64, InvalidValue> {
    let ms = text.parse().ok().filter(|ms: &f64| (0.001..=1e6).contains(ms));
    ms.map(|ms| (ms * 1e6).round() as u64).ok_or(InvalidValue("0.001 to 1000000 (ms)"))
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let mut written = std::collections::BTreeSet::new();
    for input in &args.inputs {
        let (drive, frames) = if input.is_dir() {
            let DriveCamera { setup, frames } = CameraSetup::from_drive(input, args)?;
            (Some(setup), frames)
        } else {
            (None, vec![input.clone()])
        };
        for path in frames {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let out = args.out.join(format!("{stem}.hdr"));
            if !written.insert(out.clone()) {
                bail!("{}: another input has this name: both cubes would be {}", path.display(), out.display());
            }
            let about = || path.display().to_string();
            let frame = RawMosaic::read(&path)?;
            match &drive {
                Some(setup) => write_cube(&frame, setup, &out, args).with_context(about)?,
                None => write_cube(&frame, &CameraSetup::from_frame(&frame, args).with_context(about)?, &out, args)
                    .with_context(about)?,
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn write_cube(frame: &RawMosaic, setup: &CameraSetup, out: &Path, args: &Args) -> anyhow::Result<()> {
    let camera = &setup.camera;
    let pattern = camera.mosaic().pattern();
    let cells = camera.mosaic().cells();
    let method = args.demosaic.demosaicing();
    let size = if method.is_some() { cells.map(|side| side * pattern) } else { cells };
    let n_cells = size[0] as usize * size[1] as usize;
    let n_bands = camera.wavelengths_nm().len();
    let mut values = vec![0.0; n_cells * n_bands];
    let mut masks = vec![0; n_cells];
    let exposure_nanos = setup.exposure_nanos(frame, args.exposure_ms)?;
    let counts = match method {
        Some(method) => {
            let mut full = FullResolution::new(camera, method)?;
            full.cube_into(camera, &frame.samples, exposure_nanos, &mut values, &mut masks)?
        }
        None => camera.cube_into(&frame.samples, exposure_nanos, &mut values, &mut masks)?,
    };
    if args.median {
        median_3x3(size, &mut values, &masks)?;
    }
    let mut n_unknown = 0;
    for (band, plane) in values.chunks_exact_mut(n_cells).enumerate() {
        for (value, _) in plane.iter_mut().zip(&masks).filter(|(_, mask)| *mask >> band & 1 == 0) {
            *value = UNKNOWN;
            n_unknown += 1;
        }
    }
    let mut header = Header::new(size[0] as usize, size[1] as usize, n_bands);
    header.description = format!(
        "{}; demosaicing {}{}",
        setup.description,
        args.demosaic,
        if args.median { ", median of 3x3 cells" } else { "" }
    );
    // Rounded to 0.001 nm, the resolution of an f32, for readable headers.
    header.wavelengths = camera.wavelengths_nm().iter().map(|nm| (f64::from(*nm) * 1e3).round() / 1e3).collect();
    setup.wavelength_units.clone_into(&mut header.wavelength_units);
    header.fwhm.clone_from(&setup.fwhm_nm);
    header.data_ignore_value = Some(UNKNOWN);
    envi::write(out, &Image { header, values })?;
    say!(
        "{}: {} x {} cells, {n_bands} bands, {}; samples saturated {}, clipped {}, dead {}; {:.2} % of the values unknown",
        out.display(),
        size[0],
        size[1],
        setup.description,
        counts.saturated,
        counts.clipped,
        counts.dead,
        100.0 * f64::from(n_unknown) / (n_cells * n_bands) as f64
    )?;
    Ok(())
}
