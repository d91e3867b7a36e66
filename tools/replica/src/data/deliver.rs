//! `replica deliver`: a finished run in the formats that surveyors and other programs read.

mod delivered;
mod facts;
mod finished;
pub mod frame;
mod from_above;
mod source;

pub use finished::open_finished_run;

use super::new_folder::NewFolder;
use anyhow::Context;
use command_line::answer::Answer;
use command_line::argument::InvalidValue;
use command_line::exit_code::INCOMPLETE;
use command_line::say_error;
use delivered::{Delivered, Folder, Others};
use facts::Facts;
use frame::{ChosenFrame, CrsChoice};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use source::Source;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use surveying::check_points::{CheckPoint, load_check_points, write_check_points};
use surveying::objects::write_objects;
use surveying::{
    CloudOptions, PointFile, TargetFrame, Tiling, WrittenTiles, write_cloudcompare, write_copc, write_semantic_kitti,
    write_stac_item, write_tiles, write_trajectory,
};

/// Largest side of a tile, m.
const MAX_TILE_M: u32 = 100_000;
/// Default name in the headers of the system that recorded the points.
pub const SYSTEM: &str = "mobile LiDAR";
/// Name of the octree.
pub const COPC_FILE: &str = "points.copc.laz";
/// Folders of further formats.
const CLOUDCOMPARE: &str = "cloudcompare";
const SEMANTIC_KITTI: &str = "sequences/00";
/// Largest length of a text in the header of LAS files.
const MAX_SYSTEM: usize = 32;
/// `generating software` of the headers.
pub const SOFTWARE: &str = concat!("REPLICA ", env!("CARGO_PKG_VERSION"));

/// Write a run or a survey for surveyors: LAZ, COPC, path, objects.
#[derive(clap::Args, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "a flag for each kind of file")]
#[command(
    after_help = "Exit codes: 0 done, 1 failed, or the run is not georeferenced; 2 wrong usage, or outside of the area of \
                  --crs; 3 done, but no check point lies in the cloud\n\n\
                  Example: replica deliver out/sample --out delivery --copc"
)]
pub struct Args {
    /// Output folder of a finished run, or of `replica survey`
    run: PathBuf,
    /// Folder for the files; created if absent, must be empty
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Coordinates: auto (UTM of the place), local (east, north, up at the origin of the run), EPSG:N, or with heights EPSG:N+M
    #[arg(long, default_value = "auto")]
    crs: CrsChoice,
    /// Use the system of --crs also outside of its area of use
    #[arg(long)]
    force_crs: bool,
    /// Heights above the geoid of this grid (.gtx) instead of the ellipsoid
    #[arg(long, value_name = "GTX")]
    geoid: Option<PathBuf>,
    /// Grid of the datum (.gsb), for systems of --crs that need one
    #[arg(long, value_name = "GSB")]
    grid: Option<PathBuf>,
    /// Write local coordinates if heading, height or position of the run is not determined
    #[arg(long)]
    allow_unreferenced: bool,
    /// Side of the tiles, m; 0 = one file
    #[arg(long, value_name = "M", default_value_t = 50, value_parser = tile_m)]
    tile_m: u32,
    /// Write LAS without compression
    #[arg(long)]
    las: bool,
    /// Also write points.copc.laz: all points as an octree, which viewers load piece by piece
    #[arg(long)]
    copc: bool,
    /// Also write cloudcompare/*.ply: clouds whose fields CloudCompare keeps
    #[arg(long)]
    cloudcompare: bool,
    /// Also write sequences/00: sweeps and labels as in the data set SemanticKITTI
    #[arg(long)]
    semantic_kitti: bool,
    /// Also write terrain.tif, orthophoto.tif and others: views from above, with the ground completed below vehicles
    #[arg(long)]
    rasters: bool,
    /// Side of the cells of the rasters, m
    #[arg(long, value_name = "M", default_value = "0.2", value_parser = cell_mm, requires = "rasters")]
    cell_m: u32,
    /// Also write contours.geojson, breaklines.geojson and markings.geojson: lines of the terrain and of roads
    #[arg(long, requires = "rasters")]
    lines: bool,
    /// Difference in height of neighboring contour lines, m
    #[arg(long, value_name = "M", default_value = "0.5", value_parser = contour_mm, requires = "lines")]
    contour_m: u32,
    /// Write all kinds of ground, roads included, as class 2 (ground) of the ASPRS
    #[arg(long)]
    ground_as_2: bool,
    /// Compare the cloud with these points (CSV: name,x,y,z in the coordinates of the delivery)
    #[arg(long, value_name = "CSV")]
    check_points: Option<PathBuf>,
    /// Add the reflectances of the mosaic cameras to each point of LAZ, COPC and PLY
    #[arg(long)]
    bands: bool,
    /// System that recorded the points, for the headers
    #[arg(long, value_name = "TEXT", default_value = SYSTEM, value_parser = system)]
    system: String,
    #[command(flatten)]
    answer: Answer,
}

fn tile_m(text: &str) -> Result<u32, InvalidValue> {
    let side: Option<u32> = text.parse().ok();
    side.filter(|side| *side <= MAX_TILE_M).ok_or(InvalidValue("a whole number, 0 to 100000"))
}

/// Cells in mm, so that they lie on whole stored coordinates.
fn cell_mm(text: &str) -> Result<u32, InvalidValue> {
    let mm =
        text.parse().ok().map(|metres: f64| (metres * 1000.0).round()).filter(|mm| (10.0..=100_000.0).contains(mm));
    mm.map(|mm| mm as u32).ok_or(InvalidValue("0.01 to 100, in whole mm"))
}

/// Heights of contour lines in whole mm.
fn contour_mm(text: &str) -> Result<u32, InvalidValue> {
    let mm = text.parse().ok().map(|metres: f64| (metres * 1000.0).round());
    let mm = mm.filter(|mm| (50.0..=100_000.0).contains(mm));
    mm.map(|mm| mm as u32).ok_or(InvalidValue("0.05 to 100, in whole mm"))
}

fn system(text: &str) -> Result<String, InvalidValue> {
    let fits = text.is_ascii() && text.len() <= MAX_SYSTEM;
    fits.then(|| text.to_owned()).ok_or(InvalidValue("up to 32 ASCII characters"))
}

/// Writes all files.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let source = Source::open(&args.run)?;
    // Errors of files are reported before the clouds are read, which takes longer.
    let check_points = args.check_points.as_deref().map(load_check_points).transpose()?;
    let frame = frame::choose(args, &source)?;
    let folder = NewFolder::create(&args.out)?;
    let out = folder.files.as_path();
    let ChosenFrame { target, unreferenced, .. } = &frame;
    if let Some(reasons) = unreferenced {
        say_error!("warning: coordinates are local, without coordinate reference system: {reasons}");
    }
    let options = CloudOptions {
        has_bands: args.bands,
        has_ground_as_2: args.ground_as_2,
        system: args.system.clone(),
        software: SOFTWARE.to_owned(),
        note: frame.note(),
    };
    let tiling = Tiling { side_m: args.tile_m, is_compressed: !args.las };
    // Tiles read and write each point, COPC also places it.
    let bar = progress_bar("deliver", source.n_points() * if args.copc { 5 } else { 2 });
    let written = write_tiles(&source.runs, target, &options, tiling, out, |n| bar.inc(n))?;
    let WrittenTiles { mut files, left_out } = written;
    let n_points = files.iter().map(|file| file.n_points).sum();
    let n_tiles = files.len();
    if args.copc {
        files.push(write_copc(&source.runs, target, &options, out, COPC_FILE, |n| bar.inc(n))?);
    }
    bar.finish_and_clear();
    let others = write_others(args, &source, target, &options, check_points, out)?;
    let unusable = others.check_points.as_ref().and_then(|found| found.unusable(bounds(&files)));
    let facts = Facts::new(&source.runs, &frame, n_points, &files, left_out);
    facts.write(out)?;
    write_stac_item(&source.runs, target, SOFTWARE, out)?;
    folder.finish()?;
    let delivered = Delivered { out: &args.out, facts, others };
    args.answer.print(&delivered, || delivered.text(n_tiles))?;
    let Some(reason) = unusable else { return Ok(ExitCode::SUCCESS) };
    let table = args.check_points.as_deref().unwrap_or(Path::new("--check-points"));
    say_error!("warning: {}: {reason}", table.display());
    Ok(ExitCode::from(INCOMPLETE))
}

/// Smallest and largest coordinates of the points of files, m.
fn bounds(files: &[PointFile]) -> [[f64; 3]; 2] {
    let start = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    files.iter().fold(start, |[low, high], PointFile { bounds: [a, b], .. }| {
        [std::array::from_fn(|axis| low[axis].min(a[axis])), std::array::from_fn(|axis| high[axis].max(b[axis]))]
    })
}

/// Writes all files except LAS and COPC.
fn write_others(
    args: &Args,
    source: &Source,
    target: &TargetFrame<'_>,
    options: &CloudOptions,
    check_points: Option<Vec<CheckPoint>>,
    out: &Path,
) -> anyhow::Result<Others> {
    let mut others = Others { drives: source.drives.clone(), ..Others::default() };
    for (k, run) in source.runs.iter().enumerate() {
        // The drives of a survey have a folder each.
        let name = source.drives.get(k);
        let own = name.map_or_else(|| Ok(out.to_owned()), |name| made(out, name))?;
        others.path = write_trajectory(run, target, &own)?;
        if let Some(n) = write_objects(run, target, &own)? {
            *others.n_objects.get_or_insert_default() += n;
        }
        if args.cloudcompare {
            let n = write_cloudcompare(run, target, args.bands, &made(&own, CLOUDCOMPARE)?)?.len();
            add(&mut others.cloudcompare, args, CLOUDCOMPARE, name.is_some(), n);
        }
        if args.semantic_kitti {
            let n = write_semantic_kitti(run, &made(&own, SEMANTIC_KITTI)?)?;
            add(&mut others.semantic_kitti, args, SEMANTIC_KITTI, name.is_some(), n);
        }
    }
    if args.rasters {
        others.from_above = from_above::write(args, &source.runs, target, options, out)?;
    }
    if let Some(points) = check_points {
        others.set_check_points(write_check_points(&source.runs, target, points, out)?);
    }
    Ok(others)
}

/// Counts what was written in the folder of a format.
fn add(written: &mut Option<Folder>, args: &Args, format: &str, is_survey: bool, n: usize) {
    let folder = if is_survey { args.out.clone() } else { args.out.join(format) };
    written.get_or_insert(Folder { folder, n: 0 }).n += n;
}

/// Makes the folder `name` of a delivery.
fn made(out: &Path, name: &str) -> anyhow::Result<PathBuf> {
    let folder = out.join(name);
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    Ok(folder)
}

/// A bar on a terminal, else nothing.
pub fn progress_bar(command: &'static str, n_steps: u64) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(n_steps), ProgressDrawTarget::stderr());
    // The template is a constant: without it the bar is plain, not wrong.
    match ProgressStyle::with_template("{prefix} [{wide_bar}] {percent} % {eta} left") {
        Ok(style) => bar.with_prefix(command).with_style(style.progress_chars("=> ")),
        Err(_) => bar,
    }
}
