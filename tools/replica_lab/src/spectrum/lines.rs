//! `replica-lab spectrum lines`: Graph-based Color Lines of color images and cubes (thesis, chapter 3).

mod frame;
mod picture;

use anyhow::{Context, bail, ensure};
use color_lines::{Fit, MAX_GAUSSIANS, Model, Settings, Start};
use command_line::argument::not_negative;
use command_line::say;
use files::regular_file;
use frame::Frame;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Simplify images by color lines.
///
/// Models the first image, or uses the model of --apply, and projects all images. Writes for each image `NAME_lines` (the
/// nearest point on the lines), `NAME_regions` (the mean of the region) and `NAME_labels.png` (16 bits; 0: invalid);
/// `model.json`; and `spectrum.svg` of the first image. Color images become PNG, cubes become ENVI. The table shows how close
/// the results are to the originals.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab spectrum lines photo.png --out lines")]
pub struct Args {
    /// Color images (PNG, JPEG), ENVI cubes, or TIFFs with one sample per band; all with the same number of bands
    #[arg(required = true, value_name = "IMAGE|CUBE.hdr|CUBE.tif")]
    inputs: Vec<PathBuf>,
    /// Folder for the results; created if absent
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Project with this model instead of modeling the first image
    #[arg(long, value_name = "model.json", conflicts_with_all = ["hemispheres", "bins", "contrast", "gaussians", "spatial_weight", "constrained"])]
    apply: Option<PathBuf>,
    /// Number of lines, longest first
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=MAX_GAUSSIANS as u64))]
    lines: u64,
    /// Number of shells around the origin, each with its own mixture (1 to 64)
    #[arg(long, default_value_t = 10)]
    hemispheres: usize,
    /// Cells of the histogram along its longest axis (2 to 128)
    #[arg(long, default_value_t = 64)]
    bins: usize,
    /// Pixels that a maximum of the histogram must be above its surroundings to start a Gaussian
    #[arg(long, value_name = "H", default_value_t = 3.0, value_parser = not_negative)]
    contrast: f64,
    /// Start this number of Gaussians, at the maxima of highest contrast, instead of all maxima above --contrast
    #[arg(long, value_name = "N", conflicts_with = "contrast")]
    gaussians: Option<usize>,
    /// Weight of the pixel coordinates against the bands, 0 to 10. Above 0 regions become compact, and there are no lines
    #[arg(long, value_name = "S", default_value_t = 0.0, value_parser = not_negative)]
    spatial_weight: f64,
    /// A pixel belongs only to the Gaussians of its own shell
    #[arg(long)]
    constrained: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    std::fs::create_dir_all(&args.out).with_context(|| args.out.display().to_string())?;
    let frames = args.inputs.iter().map(|path| Frame::read(path)).collect::<anyhow::Result<Vec<_>>>()?;
    for (index, frame) in frames.iter().enumerate() {
        if let Some(other) = frames[..index].iter().find(|other| other.name == frame.name) {
            bail!(
                "{} and {}: have the same name, so their results would be the same files",
                other.path.display(),
                frame.path.display()
            );
        }
    }
    let model = match &args.apply {
        Some(path) => read_model(path)?,
        None => fit(&frames[0], args)?,
    };
    let n_lines = args.lines as usize;
    say!(
        "{} Gaussians, {} lines{}",
        model.regions.len(),
        model.lines.len(),
        if model.lines.is_empty() { " (spatial weight)" } else { "" }
    )?;
    say!("| image | lines: PSNR, dB | MSE | regions: PSNR, dB | MSE |\n|---|---:|---:|---:|---:|")?;
    for frame in &frames {
        let image = frame.image()?;
        let about = || frame.path.display().to_string();
        let labels = model.labels(&image).with_context(about)?;
        frame.write_labels(&args.out, &labels)?;
        let regions = model.simplified(&image, &labels).with_context(about)?;
        frame.write(&args.out, "regions", &regions)?;
        let of_regions = frame.fidelity(&regions)?;
        let of_lines = if model.lines.is_empty() {
            "- | -".to_owned()
        } else {
            let projection = model.projected(&image, n_lines).with_context(about)?;
            frame.write(&args.out, "lines", &projection.values)?;
            frame.fidelity(&projection.values)?
        };
        say!("| {} | {of_lines} | {of_regions} |", frame.name)?;
    }
    let write = |name: &str, text: String| {
        let path = args.out.join(name);
        std::fs::write(&path, text).with_context(|| path.display().to_string())
    };
    write("spectrum.svg", picture::spectrum(&frames[0], &model, n_lines))?;
    if args.apply.is_none() {
        write("model.json", serde_json::to_string(&model)? + "\n")?;
    }
    Ok(ExitCode::SUCCESS)
}

fn fit(frame: &Frame, args: &Args) -> anyhow::Result<Model> {
    let settings = Settings {
        hemispheres: args.hemispheres,
        bins: args.bins,
        start: args.gaussians.map_or(Start::Contrast(args.contrast), Start::Count),
        spatial_weight: args.spatial_weight,
        constrained: args.constrained,
    };
    let Fit { model, .. } = Model::fit(&frame.image()?, &settings).with_context(|| frame.path.display().to_string())?;
    ensure!(
        u16::try_from(model.regions.len()).is_ok(),
        "{}: {} Gaussians; labels of 16 bits hold 65535\nhint: set a larger --contrast, or --gaussians",
        frame.path.display(),
        model.regions.len()
    );
    Ok(model)
}

fn read_model(path: &Path) -> anyhow::Result<Model> {
    let about = || path.display().to_string();
    let text = regular_file::read_to_string(path).with_context(about)?;
    Model::from_json(&text).with_context(about)
}
