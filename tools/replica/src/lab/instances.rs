//! `replica instances`: lists the objects in the clouds of a run.

use crate::cloud_files::cloud_files;
use anyhow::Context as _;
use deliverables::Georeference;
use deliverables::objects::{Objects, geojson, table};
use delivery::GEOREFERENCE;
use formats::ply::Vertices;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// List the objects in the clouds of a run as CSV or GeoJSON.
///
/// Prints class, number of points, oriented bounding box, height and mean score of each object, in m and rad.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage")]
pub struct Args {
    /// Output folder of a run or a PLY file, with the fields semantic and instance
    path: PathBuf,
    /// Print GeoJSON (WGS84); the output folder must have a georeference.json with an origin
    #[arg(long)]
    geojson: bool,
}

/// Prints the objects.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    // Errors here are reported before the clouds are read, which takes longer.
    let georeference = if args.geojson { Some(georeference(&args.path)?) } else { None };
    let mut objects = Objects::default();
    for file in cloud_files(&args.path)? {
        objects.add(&Vertices::load(&file)?)?;
    }
    let summaries = objects.summaries();
    let text = match &georeference {
        None => table(&summaries),
        Some(georeference) => geojson(&summaries, georeference)?
            .with_context(|| format!("{}: has no `origin`; {GEOJSON_NEEDS}", args.path.display()))?,
    };
    // A reader that closes the pipe early has seen enough.
    let _ = std::io::stdout().write_all(text.as_bytes());
    Ok(ExitCode::SUCCESS)
}

const GEOJSON_NEEDS: &str = "GeoJSON needs the geographic position of the clouds";

fn georeference(run: &Path) -> anyhow::Result<Georeference> {
    Georeference::load(&run.join(GEOREFERENCE)).context(GEOJSON_NEEDS)
}
