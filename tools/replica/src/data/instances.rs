//! `replica instances`: lists the objects in the clouds of a run.

use anyhow::Context as _;
use command_line::answer::Answer;
use delivery::GEOREFERENCE;
use formats::ply::Vertices;
use geometry::OrientedRectangle;
use pictures::cloud_files::cloud_files;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use surveying::Georeference;
use surveying::objects::{ObjectSummary, Objects, geojson, table};

/// List the objects in the clouds of a run as CSV or GeoJSON.
///
/// Prints class, number of points, oriented bounding box, height and mean score of each object, in m and rad.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica instances out/sample --geojson > objects.geojson")]
pub struct Args {
    /// Output folder of a run or a PLY file, with the fields semantic and instance
    path: PathBuf,
    /// Print GeoJSON (WGS84); the output folder must have a georeference.json with an origin
    #[arg(long, conflicts_with = "json")]
    geojson: bool,
    #[command(flatten)]
    answer: Answer,
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
    args.answer.print(&json!({"objects": summaries.iter().map(facts).collect::<Vec<_>>()}), || text)?;
    Ok(ExitCode::SUCCESS)
}

/// An object in the frame of the clouds, m and rad.
fn facts(object: &ObjectSummary) -> Value {
    let OrientedRectangle { center, length_m, width_m, heading } = object.footprint;
    json!({
        "id": object.id, "class": object.class, "points": object.n_points, "clouds": object.n_clouds,
        "score": object.score, "x_m": center[0], "y_m": center[1], "z_low_m": object.low_m, "z_high_m": object.high_m,
        "length_m": length_m, "width_m": width_m, "heading_rad": heading,
    })
}

const GEOJSON_NEEDS: &str = "GeoJSON needs the geographic position of the clouds";

fn georeference(run: &Path) -> anyhow::Result<Georeference> {
    Georeference::load(&run.join(GEOREFERENCE)).context(GEOJSON_NEEDS)
}
