//! `replica evaluate classes`: of label files, of simulated towns, of SemanticKITTI.

pub mod kitti;
mod knn;
mod labels;
mod picture;
mod reliability;
mod towns;

use anyhow::Context;
use clap::ValueEnum;
use learning::Options;
use learning::scores::{Confusion, ScoreTable};
use learning::spherical::Refinement;
use messages::{ClassId, GROUND_CLASSES};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Give TRUTH and PREDICTION, or a model and what it shall be tried on.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Labels that are true: a .label file of SemanticKITTI's form (class id in the lower 16 bits), or a folder of them.
    #[arg(requires = "prediction", conflicts_with = "model")]
    truth: Option<PathBuf>,
    /// Predicted labels, a file or a folder with the same names.
    prediction: Option<PathBuf>,
    /// A model file to try instead.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Kinds of simulated towns to try it in, each with all seeds.
    #[arg(long, requires = "model", value_delimiter = ',', default_value = "urban")]
    towns: Vec<String>,
    /// Seeds of the drives.
    #[arg(long, requires = "model", value_delimiter = ',')]
    seeds: Vec<u64>,
    /// Length of each drive, s.
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// Submaps of each drive, at even places.
    #[arg(long, default_value_t = 4)]
    submaps: usize,
    /// Sweeps of each submap.
    #[arg(long, default_value_t = 10)]
    sweeps: usize,
    /// The first of every so many sweeps of a submap goes through the network.
    #[arg(long, default_value_t = 1)]
    every: usize,
    /// Corrections of the network's classes by morphology.
    #[arg(long, requires = "model", value_enum, value_delimiter = ',')]
    refine: Vec<Refine>,
    /// The K nearest examples of the network's features vote on a pixel's class, in place of its last layer.
    #[arg(long, requires_all = ["model", "examples"], value_name = "K", value_parser = clap::value_parser!(u16).range(1..=1000))]
    knn: Option<u16>,
    /// Recipe of the model; the examples are of its first drives, one of each kind in its list of towns.
    #[arg(long, requires = "knn", value_name = "RECIPE")]
    examples: Option<PathBuf>,
    /// Folder of labelled SemanticKITTI sweeps (*_points_*.npy beside *_labels_*.npy) to try the model on.
    #[arg(long, requires = "model", value_name = "DIR")]
    semantickitti: Option<PathBuf>,
    /// Draws truth, prediction and errors of the first submap of the first town from above into this PNG.
    #[arg(long, requires = "seeds", value_name = "PNG")]
    picture: Option<PathBuf>,
    /// Scores ground (road, road line, sidewalk, ground, rail track, terrain) against all other classes.
    #[arg(long)]
    ground: bool,
    /// Form of the scores.
    #[arg(long, value_enum, default_value_t = Format::Markdown)]
    format: Format,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Refine {
    /// What stands out of the depth image and is longer than wide is a pole, other poles are none.
    Poles,
    /// Regions of buildings and vegetation of less than 100 pixels take the class around them.
    SmallRegions,
    /// What is higher than 2.5 m and long from above is a building.
    Buildings,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    /// Tables.
    Markdown,
    /// One line for each cloud and class.
    Csv,
    /// Everything, confusion matrices too.
    Json,
}

/// Runs the command. Scores go to stdout, talk to stderr.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let names = ClassId::ALL.iter().map(|class| class.name().to_owned()).collect();
    let mut table = ScoreTable { names, clouds: Vec::new() };
    if let (Some(truth), Some(prediction)) = (&args.truth, &args.prediction) {
        table.clouds = labels::confusions(truth, prediction)?;
    }
    if let Some(path) = &args.model {
        anyhow::ensure!(
            !args.seeds.is_empty() || args.semantickitti.is_some(),
            "nothing to try the model on\nhint: --seeds 901,902 or --semantickitti DIR"
        );
        anyhow::ensure!(args.every > 0, "--every 0: must be at least 1");
        let refine = |what: Refine| args.refine.contains(&what);
        let refinement = Refinement {
            poles: refine(Refine::Poles),
            small_regions: refine(Refine::SmallRegions),
            buildings: refine(Refine::Buildings),
        };
        let options = Options { every: args.every, refinement };
        let model = match (args.knn, &args.examples) {
            (Some(k), Some(recipe)) => Box::new(knn::load(path, recipe, usize::from(k))?.with_options(options)),
            _ => learning::load(path, &options)?,
        };
        table.clouds.extend(towns::confusions(model.as_ref(), args)?);
        if let Some(folder) = &args.semantickitti {
            table.clouds.extend(kitti::confusions(model.as_ref(), folder)?);
        }
    }
    anyhow::ensure!(!table.clouds.is_empty(), "nothing to score\nhint: TRUTH PREDICTION, or --model FILE --seeds 901");
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

/// Counts the points of one cloud whose truth is a class that can be learned.
fn count(truth: &[u8], predicted: &[u8], is_scored: impl Fn(u8) -> bool) -> Confusion {
    let mut confusion = Confusion::new(ClassId::ALL.len());
    for (truth, predicted) in truth.iter().zip(predicted) {
        if is_scored(*truth) {
            confusion.add(usize::from(*truth), usize::from(*predicted));
        }
    }
    confusion
}

fn name_of(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}
