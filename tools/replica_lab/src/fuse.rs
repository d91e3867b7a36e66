//! `replica-lab fuse`: two models as one file.

mod prior_recipe;

use anyhow::Context;
use command_line::argument;
use files::atomic_file::write_atomic;
use prior_recipe::{MeansByGroup, PriorRecipe};
use segmentation::Fusion;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use training::fit_priors;

/// Write two models as one file that fuses them.
///
/// Both have the same classes. The class with the largest weighted geometric mean of their probabilities, times its prior, wins.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage\n\n\
                  Example: replica-lab fuse models/street.safetensors models/points.safetensors --out fused.safetensors")]
pub struct Args {
    /// Model file, usually of a network on images
    first: PathBuf,
    /// Model file, usually of a network on points
    second: PathBuf,
    /// File to write; created or replaced
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Share of the first model in the mean, 0 to 1
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, value_parser = argument::share)]
    share: f64,
    /// The first model processes only every N-th sweep (1 to 16)
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=16))]
    every: u8,
    /// Factors of the means of classes, 0.01 to 100; 1 for the others
    #[arg(long, value_name = "CLASS=FACTOR", value_delimiter = ',', value_parser = prior)]
    priors: Vec<(String, f32)>,
    /// Divisor of the logarithms of the products of means and priors, 0.1 to 10; below 1, scores rise
    #[arg(long, value_name = "DIVISOR", default_value_t = 1.0)]
    temperature: f32,
    /// Fit the priors to simulated towns, and print them and the mean IoU of each group of drives without and with them
    #[arg(long, value_name = "RECIPE", conflicts_with = "priors")]
    fit_priors: Option<PathBuf>,
}

fn prior(text: &str) -> Result<(String, f32), argument::InvalidValue> {
    let parts = text.split_once('=').and_then(|(class, factor)| Some((class.to_owned(), factor.parse().ok()?)));
    parts.ok_or(argument::InvalidValue("a class and a factor, as in bridge=4.5"))
}

pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let mut priors = BTreeMap::new();
    for (class, factor) in &args.priors {
        let earlier = priors.insert(class.clone(), *factor);
        anyhow::ensure!(earlier.is_none(), "--priors: {class} is given twice");
    }
    let share = args.share;
    let every = usize::from(args.every);
    let temperature = args.temperature;
    let mut fusion = Fusion { share, every, priors, temperature };
    if let Some(recipe) = &args.fit_priors {
        fusion.priors = fit(recipe, args, &fusion)?;
    }
    let bytes = segmentation::fuse(&args.first, &args.second, &fusion)?;
    write_atomic(&args.out, &bytes).with_context(|| args.out.display().to_string())?;
    Ok(ExitCode::SUCCESS)
}

/// The priors that fit the drives of a recipe.
fn fit(recipe: &Path, args: &Args, without: &Fusion) -> anyhow::Result<BTreeMap<String, f32>> {
    let recipe = PriorRecipe::load(recipe)?;
    let MeansByGroup { classes, groups } = recipe.means(&args.first, &args.second, without)?;
    let factors = fit_priors(&groups, classes.len());
    let ones = vec![1.0; factors.len()];
    for (number, group) in (1..).zip(&groups) {
        let percent = |priors: &[f32]| 100.0 * group.mean_iou(priors).unwrap_or(0.0);
        println!("group {number}: mIoU {:.1}, with priors {:.1}", percent(&ones), percent(&factors));
    }
    let fitted = classes.iter().zip(factors).filter(|(_, factor)| *factor != 1.0);
    let fitted: BTreeMap<String, f32> = fitted.map(|(class, factor)| (class.name().to_owned(), factor)).collect();
    let listed: Vec<String> = fitted.iter().map(|(class, factor)| format!("{class}={factor}")).collect();
    match &listed[..] {
        [] => println!("no class gains by a prior"),
        _ => println!("--priors {}", listed.join(",")),
    }
    Ok(fitted)
}
