//! `replica-lab evaluate classes`: scores the classes of label files, or of a model on simulated towns or SemanticKITTI.

mod coverage;
mod error_picture;
mod folder;
mod label_files;
mod labelled_submap;
mod labels;
mod models;
mod ranges;
mod reliability;
mod report;
pub mod semantic_kitti;
mod seven;
mod source;
mod street_labels;
mod tally;
mod towns;

use anyhow::Context;
use clap::ValueEnum;
use clap::builder::PossibleValuesParser;
use command_line::answer::Answer;
use command_line::argument::{self, words};
use models::Models;
use report::ClassReport;
use segmentation::intensity::IntensityUse;
use settings::Word;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tally::Tally;
use town_sweeps::Mount;
pub use towns::NOT_SCORED;

/// Score classes: precision, recall and IoU of each class, mIoU, overall accuracy, confusion matrix; also for the seven classes
/// of LiDOG and by range; calibration of the scores, and accuracy of the points with the highest scores.
///
/// Scores TRUTH against PREDICTION, or a model (--model) on simulated towns (--seeds) or on SemanticKITTI (--semantickitti).
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab evaluate classes --model models/street.safetensors --seeds 901,902")]
pub struct Args {
    /// True labels: a .label file in SemanticKITTI's format (class id in the lower 16 bits), or a folder of .label files
    #[arg(requires = "prediction", conflicts_with = "model")]
    truth: Option<PathBuf>,
    /// Predicted labels: a file, or a folder with the same file names
    prediction: Option<PathBuf>,
    /// Model file to evaluate instead
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Kinds of simulated towns; each is used with all seeds
    #[arg(long, requires = "model", value_delimiter = ',', default_value = "urban")]
    towns: Vec<String>,
    /// Seeds of the simulated drives
    #[arg(long, requires = "model", value_delimiter = ',')]
    seeds: Vec<u64>,
    /// LiDARs and mountings in the simulated towns; each drive is scored with each of them: `rig` is the HDL-32E of the L3D2 vehicle,
    /// `kitti` the HDL-64E of KITTI, `no_rings` the HDL-64E without ring numbers; the others are upright 1.73 m above the road,
    /// `low` 1 m, `high` 3 m; `rings128` has the beams of an OS1-128, `rosette` a non-repeating pattern like a Livox Avia
    #[arg(long, requires = "seeds", value_name = "NAME", value_delimiter = ',', default_value = "rig", value_parser = sensors())]
    sensor: Vec<String>,
    /// Length of each drive, s
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// Submaps of each drive, evenly distributed
    #[arg(long, default_value_t = 4)]
    submaps: usize,
    /// Sweeps of each submap
    #[arg(long, default_value_t = 10)]
    sweeps: usize,
    /// Use every N-th sweep of a submap for networks on images; a fused model multiplies N by its own number
    #[arg(long, default_value_t = 1)]
    every: usize,
    /// Number of views that vote on the classes, as `[infer] views`
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=segmentation::MOST_VIEWS as i64))]
    views: u8,
    /// How the model uses the intensities
    #[arg(long, value_name = "USE", default_value_t = IntensityUse::Auto, value_parser = words::<IntensityUse>())]
    intensity: IntensityUse,
    /// Multiply the intensities of the simulated sweeps, as another sensor would
    #[arg(long, requires = "seeds", default_value_t = 1.0)]
    gain: f32,
    /// Correct the classes by morphology
    #[arg(long, requires = "model", value_enum, value_delimiter = ',', default_values_t = [Refine::RoughGround, Refine::VehicleShape, Refine::DrivenIsRoad])]
    refine: Vec<Refine>,
    /// Folder of SemanticKITTI to evaluate the model on: the data set, a sequence (velodyne/*.bin and labels/*.label), or sweeps as NumPy
    /// arrays (pairs *_points_*.npy and *_labels_*.npy). Sweeps with intensities are also scored with `--intensity raw` and `off`
    #[arg(long, requires = "model", value_name = "DIR")]
    semantickitti: Option<PathBuf>,
    /// Folder with labelled real streets, one data set per subfolder, to evaluate the model on: sweeps as *.bin with *.label files (ids of
    /// SemanticKITTI or RELLIS-3D), and clouds of Oakland 3-D. Sets with intensities are also scored with `--intensity raw` and `off`
    #[arg(long, requires = "model", value_name = "DIR")]
    street_labels: Option<PathBuf>,
    /// Points with a score below this become `unlabeled`, as with `[infer] unknown_below`, 0 to 1
    #[arg(long, requires = "model", value_name = "SCORE", default_value_t = 0.0, value_parser = argument::share)]
    unknown_below: f64,
    /// Draw a top view of truth, prediction and errors of the first submap into this PNG
    #[arg(long, requires = "seeds", value_name = "PNG")]
    picture: Option<PathBuf>,
    /// Score ground (road, road line, sidewalk, ground, rail track, terrain) against all other classes
    #[arg(long)]
    ground: bool,
    /// Format of the scores on stdout
    #[arg(long, value_enum, default_value_t = Format::Markdown)]
    format: Format,
    /// Also write scores.md, scores.json and coverage.svg to this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    answer: Answer,
}

/// Names of the sensors.
fn sensors() -> PossibleValuesParser {
    PossibleValuesParser::new(Mount::NAMED.iter().map(|(name, _)| *name))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Refine {
    /// Upright narrow objects in the depth image become poles; other poles are removed.
    Poles,
    /// Regions of buildings and vegetation below 100 pixels get the class around them.
    SmallRegions,
    /// Objects above 2.5 m that are long in the top view become buildings.
    Buildings,
    /// Terrain becomes vegetation where the ground is rough, as with `[infer] rough_ground`.
    RoughGround,
    /// Low or tiny clusters of vehicle points get their second class, as with `[infer] vehicle_shape`.
    VehicleShape,
    /// Ground below the path is road, as with `[infer] driven_is_road`.
    DrivenIsRoad,
    /// No correction.
    None,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// Markdown tables.
    Markdown,
    /// CSV, one line per cloud and class: only the scores of the classes.
    Csv,
    /// JSON of all scores, including confusion matrices.
    Json,
}

/// Runs the command. Scores go to stdout, diagnostics to stderr.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let empty = if args.ground { Tally::ground_only() } else { Tally::new() };
    let mut sources = Vec::new();
    if let (Some(truth), Some(prediction)) = (&args.truth, &args.prediction) {
        sources = label_files::sources(truth, prediction, &empty)?;
    }
    if let Some(path) = &args.model {
        anyhow::ensure!(
            !args.seeds.is_empty() || args.semantickitti.is_some() || args.street_labels.is_some(),
            "--model needs data to evaluate the model on\nhint: --seeds 901,902, --semantickitti DIR or --street-labels DIR"
        );
        anyhow::ensure!(args.every > 0, "--every 0: must be at least 1");
        let models = Models::load(path, args)?;
        sources.extend(towns::sources(models.asked.as_ref(), args, &empty)?);
        if let Some(folder) = &args.semantickitti {
            sources.extend(semantic_kitti::sources(&models, folder, &empty)?);
        }
        if let Some(folder) = &args.street_labels {
            sources.extend(street_labels::sources(&models, folder, &empty)?);
        }
    }
    anyhow::ensure!(
        !sources.is_empty(),
        "nothing to score\nhint: give TRUTH and PREDICTION, or --model FILE --seeds 901"
    );
    let report = ClassReport::new(sources, args.intensity.word());
    let text = match args.format {
        Format::Markdown => report.markdown(),
        Format::Csv => report.csv(),
        // The list of scores.json.
        Format::Json => serde_json::to_string_pretty(&report.json())?,
    };
    args.answer.print(&serde_json::json!({"clouds": report.json()}), || text + "\n")?;
    if let Some(out) = &args.out {
        write_files(&report, out)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn write_files(report: &ClassReport, out: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(out).with_context(|| out.display().to_string())?;
    let write = |name: &str, text: String| {
        let path = out.join(name);
        std::fs::write(&path, text).with_context(|| path.display().to_string())
    };
    write("scores.md", report.markdown())?;
    write("scores.json", serde_json::to_string_pretty(&report.json())? + "\n")?;
    report.chart().map_or(Ok(()), |svg| write("coverage.svg", svg))
}
