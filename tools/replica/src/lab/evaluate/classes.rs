//! `replica evaluate classes`: scores the classes of label files, or of a model on simulated towns or SemanticKITTI.

mod error_picture;
mod fused;
mod knn;
mod label_files;
mod point_confusion;
mod reliability;
pub mod semantic_kitti;
mod towns;

use anyhow::Context;
use clap::ValueEnum;
use clap::builder::PossibleValuesParser;
use fused::Fused;
use messages::{ClassId, GROUND_CLASSES};
use scores::ScoreTable;
use segmentation::Options;
use segmentation::spherical::{IntensityUse, Refinement};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Score classes: precision, recall and IoU of each class, mIoU, overall accuracy, confusion matrix.
///
/// Scores TRUTH against PREDICTION, or a model (--model) on simulated towns (--seeds) or on SemanticKITTI (--semantickitti).
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage")]
pub struct Args {
    /// True labels: a .label file in SemanticKITTI's format (class id in the lower 16 bits), or a folder of .label files
    #[arg(requires = "prediction", conflicts_with = "model")]
    truth: Option<PathBuf>,
    /// Predicted labels: a file, or a folder with the same file names
    prediction: Option<PathBuf>,
    /// Model file to evaluate instead
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Second model; each point takes the class with the higher score
    #[arg(long, requires = "model", value_name = "FILE")]
    fused_with: Option<PathBuf>,
    /// Kinds of simulated towns; each is used with all seeds
    #[arg(long, requires = "model", value_delimiter = ',', default_value = "urban")]
    towns: Vec<String>,
    /// Seeds of the simulated drives
    #[arg(long, requires = "model", value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Length of each drive, s
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// Submaps of each drive, evenly distributed
    #[arg(long, default_value_t = 4)]
    submaps: usize,
    /// Sweeps of each submap
    #[arg(long, default_value_t = 10)]
    sweeps: usize,
    /// Use every N-th sweep of a submap for inference
    #[arg(long, default_value_t = 1)]
    every: usize,
    /// What the model takes from the intensities
    #[arg(long, value_name = "USE", default_value = "auto", value_parser = PossibleValuesParser::new(IntensityUse::WORDS))]
    intensity: String,
    /// Multiply the intensities of the simulated sweeps, as another sensor would
    #[arg(long, requires = "seeds", default_value_t = 1.0)]
    gain: f32,
    /// Correct the classes by morphology
    #[arg(long, requires = "model", value_enum, value_delimiter = ',')]
    refine: Vec<Refine>,
    /// Replace the last layer of the network: the K nearest examples in feature space vote on the class (1 to 1000)
    #[arg(long, requires_all = ["model", "examples"], value_name = "K", value_parser = clap::value_parser!(u16).range(1..=1000))]
    knn: Option<u16>,
    /// Recipe of the model; its first drives, one for each of its towns, provide the examples
    #[arg(long, requires = "knn", value_name = "RECIPE")]
    examples: Option<PathBuf>,
    /// Folder of labelled SemanticKITTI sweeps (*_points_*.npy beside *_labels_*.npy) to evaluate the model on
    #[arg(long, requires = "model", value_name = "DIR")]
    semantickitti: Option<PathBuf>,
    /// Draw a top view of truth, prediction and errors of the first submap into this PNG
    #[arg(long, requires = "seeds", value_name = "PNG")]
    picture: Option<PathBuf>,
    /// Score ground (road, road line, sidewalk, ground, rail track, terrain) against all other classes
    #[arg(long)]
    ground: bool,
    /// Format of the scores
    #[arg(long, value_enum, default_value_t = Format::Markdown)]
    format: Format,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Refine {
    /// Upright narrow objects in the depth image become poles; other poles are removed.
    Poles,
    /// Regions of buildings and vegetation below 100 pixels get the class around them.
    SmallRegions,
    /// Objects above 2.5 m that are long in the top view become buildings.
    Buildings,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// Markdown tables.
    Markdown,
    /// CSV, one line per cloud and class.
    Csv,
    /// JSON, including confusion matrices.
    Json,
}

/// Runs the command. Scores go to stdout, diagnostics to stderr.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let names = ClassId::ALL.iter().map(|class| class.name().to_owned()).collect();
    let mut table = ScoreTable { names, clouds: Vec::new() };
    if let (Some(truth), Some(prediction)) = (&args.truth, &args.prediction) {
        table.clouds = label_files::confusions(truth, prediction)?;
    }
    if let Some(path) = &args.model {
        anyhow::ensure!(
            !args.seeds.is_empty() || args.semantickitti.is_some(),
            "--model needs data to evaluate the model on\nhint: --seeds 901,902 or --semantickitti DIR"
        );
        anyhow::ensure!(args.every > 0, "--every 0: must be at least 1");
        let refine = |correction: Refine| args.refine.contains(&correction);
        let refinement = Refinement {
            poles: refine(Refine::Poles),
            small_regions: refine(Refine::SmallRegions),
            buildings: refine(Refine::Buildings),
        };
        let intensity = IntensityUse::from_word(&args.intensity).unwrap_or_default();
        let options = Options { every: args.every, intensity, refinement, ..Options::default() };
        let model = match (args.knn, &args.examples) {
            (Some(k), Some(recipe)) => Box::new(knn::load(path, recipe, usize::from(k))?.with_options(options)?),
            _ => segmentation::load(path, &options)?,
        };
        let model = match &args.fused_with {
            Some(second) => Box::new(Fused([model, segmentation::load(second, &options)?])),
            None => model,
        };
        table.clouds.extend(towns::confusions(model.as_ref(), args)?);
        if let Some(folder) = &args.semantickitti {
            table.clouds.extend(semantic_kitti::confusions(model.as_ref(), folder)?);
        }
    }
    anyhow::ensure!(
        !table.clouds.is_empty(),
        "nothing to score\nhint: give TRUTH and PREDICTION, or --model FILE --seeds 901"
    );
    if args.ground {
        let is_ground = |class: usize| GROUND_CLASSES.iter().any(|ground| *ground as usize == class);
        let of_class = |class: usize| if is_ground(class) { ClassId::Ground } else { ClassId::Other } as usize;
        for (_, confusion) in &mut table.clouds {
            *confusion = confusion.merged(of_class);
        }
    }
    let text = match args.format {
        Format::Markdown => table.markdown(),
        Format::Csv => table.csv(),
        Format::Json => serde_json::to_string_pretty(&table.json())?,
    };
    writeln!(std::io::stdout(), "{text}").context("stdout")?;
    Ok(ExitCode::SUCCESS)
}
