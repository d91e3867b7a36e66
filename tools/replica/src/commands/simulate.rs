//! `replica simulate`: a drive through a procedural town, with truth.

use anyhow::Context;
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use simulation::{DriveReport, DriveSpec, Town, write_drive};
use std::io::{IsTerminal, Write};
use std::path::PathBuf;

/// Makes a drive folder: lidar packets, six color cameras, two mosaic cameras, GNSS, IMU, and the truth about all of them.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Kind of town.
    #[arg(long, value_enum, default_value_t = TownName::Urban)]
    town: TownName,
    /// Seed of town, traffic and noise; equal seeds give equal bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Length of the drive, s (0.2 to 600); about 12 MB per second.
    #[arg(long, default_value_t = 12.0)]
    seconds: f64,
    /// Folder to make; it must not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum TownName {
    /// Blocks of houses, squares and parks; a round of 1.5 km.
    Urban,
    /// Houses in gardens along curved roads; a round of 1.5 km.
    Suburban,
    /// A country road with village, fields, forest, tunnel, level crossing, canal and farms.
    Rural,
    /// The country road through open fields: next to nothing for an odometry to hold on to.
    Field,
    /// The country road through tunnels of 110 m and more; the drive begins before the first one.
    Tunnel,
}

impl From<TownName> for Town {
    fn from(name: TownName) -> Self {
        match name {
            TownName::Urban => Self::Urban,
            TownName::Suburban => Self::Suburban,
            TownName::Rural => Self::Rural,
            TownName::Field => Self::Field,
            TownName::Tunnel => Self::Tunnel,
        }
    }
}

/// Runs the command. What was made goes to stdout, the progress to stderr if that is a terminal.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let spec = DriveSpec { town: args.town.into(), ..DriveSpec::urban(args.seed, args.seconds) };
    let bar = progress_bar();
    let result = write_drive(&spec, &args.out, &mut |share| bar.set_position((share * STEPS as f64) as u64));
    bar.finish_and_clear();
    let report = result.context("simulate")?;
    print(&report, args).context("stdout")
}

/// Resolution of the progress.
const STEPS: u64 = 1000;

fn progress_bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
    // The template is a constant: without it the bar is plain, not wrong.
    match ProgressStyle::with_template("simulate [{wide_bar}] {percent} % {eta} left") {
        Ok(style) => bar.with_style(style.progress_chars("=> ")),
        Err(_) => bar,
    }
}

fn print(report: &DriveReport, args: &Args) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "{}: {} sweeps, {} returns, {} images, {} mosaics",
        args.out.display(),
        report.n_sweeps,
        report.n_returns,
        report.n_images,
        report.n_mosaics
    )?;
    for (class, share) in report.class_rates() {
        writeln!(out, "{:>14} {:6.2} %", class.name(), share * 100.0)?;
    }
    Ok(())
}
