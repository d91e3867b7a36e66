//! `replica cube`: raw mosaics into ENVI cubes, for those who have a camera and no vehicle (docs/cubes.md).

mod setup;

use anyhow::{Context, bail};
use clap::builder::PossibleValuesParser;
use formats::envi::{self, Header, Image};
use formats::raw_mosaic::RawMosaic;
use setup::Setup;
use spectral::{Demosaicing, FullResolution, median_3x3};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// One ENVI cube for each raw frame of a mosaic camera.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Raw frames: binary PGM, or TIFF of 8 or 16 bits (one of a sample for each band is put back into its mosaic); drive
    /// folders (see --camera) bring references and calibration along.
    #[arg(required = true, value_name = "FRAME|DRIVE")]
    inputs: Vec<PathBuf>,
    /// Folder of the cubes; made if it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Mosaic camera of the drives, by name.
    #[arg(long)]
    camera: Option<String>,
    /// The camera maker's calibration file: active area, pattern, bands, spectral correction.
    #[arg(long, value_name = "XML")]
    sensor: Option<PathBuf>,
    /// Side of the filter pattern, px, of a camera without calibration file.
    #[arg(long, conflicts_with = "sensor", value_parser = clap::value_parser!(u32).range(1..=5))]
    pattern: Option<u32>,
    /// Dark frames: files or folders of them.
    #[arg(long, value_name = "PATH")]
    dark: Vec<PathBuf>,
    /// White frames: files or folders of them.
    #[arg(long, value_name = "PATH")]
    white: Vec<PathBuf>,
    /// The white panel's place in the white frames, or, without --white, in each frame itself: left column, top row, width,
    /// height, px.
    #[arg(long, value_name = "X,Y,W,H", value_parser = rectangle)]
    white_region: Option<[u32; 4]>,
    /// Reflectance of the white panel: one for all bands, or one for each in the pattern's order.
    #[arg(long, value_delimiter = ',', default_values_t = [0.98])]
    white_reflectance: Vec<f64>,
    /// Exposure time of the frames, ms [default: as the file says].
    #[arg(long, value_parser = nanos)]
    exposure_ms: Option<u64>,
    /// Exposure time of the dark frames, ms [default: as the file says, else that of the frames].
    #[arg(long, value_parser = nanos)]
    dark_exposure_ms: Option<u64>,
    /// Exposure time of the white frames, ms [default: as the file says, else that of the frames].
    #[arg(long, value_parser = nanos)]
    white_exposure_ms: Option<u64>,
    /// Bits of a sample: the largest value means saturated [default: the fewer of what the calibration and the frame say].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=16))]
    bit_depth: Option<u32>,
    /// `bin`: one cell for each cell of the pattern. Others demosaic to one for each pixel, with 16 or 25 times the bytes.
    #[arg(long, default_value = "bin", value_parser = PossibleValuesParser::new(["bin", "wb", "id", "iid", "ppid"]))]
    demosaic: String,
    /// Bands as the filters measured them, without the spectral correction of the calibration file.
    #[arg(long)]
    uncorrected: bool,
    /// Replace every value by the median of the valid ones in its 3x3 cells.
    #[arg(long)]
    median: bool,
}

/// What was not measured, in the cubes: ENVI's usual number, far from any reflectance.
const IGNORED: f32 = -9999.0;

fn rectangle(text: &str) -> Result<[u32; 4], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| "must be four whole numbers X,Y,W,H".to_owned())
}

/// Milliseconds as they are typed into ns: 1 us to 1000 s.
fn nanos(text: &str) -> Result<u64, String> {
    let ms = text.parse().ok().filter(|ms: &f64| (0.001..=1e6).contains(ms));
    ms.map(|ms| (ms * 1e6).round() as u64).ok_or_else(|| "must be 0.001 to 1000000 (ms)".to_owned())
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let mut written = std::collections::BTreeSet::new();
    for input in &args.inputs {
        let (drive, frames) = if input.is_dir() {
            let (setup, frames) = Setup::of_drive(input, args)?;
            (Some(setup), frames)
        } else {
            (None, vec![input.clone()])
        };
        for path in frames {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let out = args.out.join(format!("{stem}.hdr"));
            if !written.insert(out.clone()) {
                bail!("{}: another input has this name, too: its cube would be {}", path.display(), out.display());
            }
            let about = || path.display().to_string();
            let frame = RawMosaic::read(&path)?;
            match &drive {
                Some(setup) => write_cube(&frame, setup, &out, args).with_context(about)?,
                None => write_cube(&frame, &Setup::of_frame(&frame, args).with_context(about)?, &out, args)
                    .with_context(about)?,
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn write_cube(frame: &RawMosaic, setup: &Setup, out: &Path, args: &Args) -> anyhow::Result<()> {
    let camera = &setup.camera;
    let (pattern, cells) = (camera.mosaic().pattern(), camera.mosaic().cells());
    let method = Demosaicing::named(&args.demosaic);
    let size = if method.is_some() { cells.map(|side| side * pattern) } else { cells };
    let n_cells = size[0] as usize * size[1] as usize;
    let n_bands = camera.wavelengths_nm().len();
    let (mut values, mut masks) = (vec![0.0; n_cells * n_bands], vec![0; n_cells]);
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
            *value = IGNORED;
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
    // A thousandth of a nm: f32 knows no more, and headers are read by people.
    header.wavelengths = camera.wavelengths_nm().iter().map(|nm| (f64::from(*nm) * 1e3).round() / 1e3).collect();
    setup.wavelength_units.clone_into(&mut header.wavelength_units);
    header.fwhm.clone_from(&setup.fwhm_nm);
    header.data_ignore_value = Some(IGNORED);
    envi::write(out, &Image { header, values })?;
    println!(
        "{}: {} x {} cells, {n_bands} bands, {}; samples saturated {}, clipped {}, dead {}; {:.2} % of the values unknown",
        out.display(),
        size[0],
        size[1],
        setup.description,
        counts.saturated,
        counts.clipped,
        counts.dead,
        100.0 * f64::from(n_unknown) / (n_cells * n_bands) as f64
    );
    Ok(())
}
