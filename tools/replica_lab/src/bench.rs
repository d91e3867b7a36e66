//! `replica-lab bench`: measures cost and throughput of a pipeline.

mod compare;
mod configuration;
mod machine;
mod measured_run;
mod profile;
mod report;
mod series;

use anyhow::{Context, bail};
use command_line::answer::Answer;
use command_line::exit_code;
use command_line::say_error;
use compare::CompareArgs;
use configuration::Configuration;
use machine::Machine;
use measured_run::{Failure, measure};
use report::Report;
use series::Series;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Measure throughput, CPU, memory and latencies of a pipeline.
///
/// Runs a launch file several times, and compares numbers of cores. The report goes to stdout and into the files DATE-COMMIT.md and
/// DATE-COMMIT.json in the folder of --out. With --compare, nothing runs: two of these JSON files are compared.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 done, 1 failed, or --compare found a regression; 2 wrong usage, or reports that cannot be compared; \
                  3 the runs processed different data, 78 invalid configuration\n\n\
                  Example: replica-lab bench launch.toml --runs 3 --out reports"
)]
pub struct Args {
    /// Launch file; its results go to a temporary folder, which is removed afterwards
    #[arg(default_value = "launch.toml")]
    launch_file: PathBuf,
    /// Number of measured runs of each configuration (1 to 1000); the report contains medians
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// Numbers of cores to run on [default: 1 and all cores]
    #[arg(long, value_delimiter = ',', value_name = "N,N")]
    cores: Vec<usize>,
    /// Print the table of the stages for every configuration instead of only for the first
    #[arg(long)]
    stages: bool,
    /// Add a run under perf: the ten largest costs of each stage
    #[arg(long)]
    profile: bool,
    /// Folder for the reports
    #[arg(long, default_value = "lab/runs", value_name = "DIR")]
    out: PathBuf,
    /// Override a setting of the launch file (may be repeated)
    #[arg(long = "set", value_name = "TABLE.KEY=VALUE")]
    overrides: Vec<String>,
    #[command(flatten)]
    compare: CompareArgs,
    #[command(flatten)]
    answer: Answer,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    if let Some(comparison) = args.compare.comparison()? {
        args.answer.print(&comparison, || comparison.text())?;
        return Ok(if comparison.has_regression() { ExitCode::FAILURE } else { ExitCode::SUCCESS });
    }
    if args.profile {
        profile::check()?;
    }
    let machine = Machine::detect(&args.launch_file);
    let configurations = configurations(args, machine.cores)?;
    let output = tempfile::tempdir().context("cannot create a temporary folder")?;
    let mut series: Vec<Series> = configurations.iter().map(|configuration| Series::new(*configuration)).collect();
    // The first run is not measured: it simulates the drive if necessary, and fills the disk caches.
    for round in 0..=args.runs {
        let measured = round > 0;
        let n = series.len();
        for turn in 0..n {
            // Each round starts with another configuration, so that none always follows the same one.
            let index = (turn + round as usize) % n;
            let configuration = series[index].configuration;
            if !measured && turn > 0 {
                break;
            }
            say_error!("run {round} of {}: {configuration}", args.runs);
            let summary = match measure(&args.launch_file, &args.overrides, configuration, output.path(), None) {
                Ok(summary) => summary,
                Err(Failure::Ended(code)) => return Ok(ExitCode::from(code)),
                Err(Failure::Other(error)) => return Err(error),
            };
            if measured {
                series[index].runs.push(summary);
            }
        }
    }
    let mut report = Report::new(&args.launch_file, args.runs, machine, series);
    if args.profile {
        say_error!("run under perf: {}", configurations[0]);
        let data = output.path().join("perf.data");
        match measure(&args.launch_file, &args.overrides, configurations[0], output.path(), Some(&data)) {
            Ok(_) => report.profiles = profile::read(&data)?,
            Err(Failure::Ended(code)) => return Ok(ExitCode::from(code)),
            Err(Failure::Other(error)) => return Err(error),
        }
    }
    args.answer.print(&report, || report.markdown(args.stages))?;
    for file in write(&report, args)? {
        say_error!("{}", file.display());
    }
    Ok(ExitCode::from(if report.runs_agree() { 0 } else { exit_code::INCOMPLETE }))
}

fn configurations(args: &Args, available: usize) -> anyhow::Result<Vec<Configuration>> {
    let mut cores = if args.cores.is_empty() { vec![available, 1] } else { args.cores.clone() };
    cores.sort_unstable_by(|a, b| b.cmp(a));
    cores.dedup();
    if let Some(wrong) = cores.iter().find(|n| !(1..=available).contains(*n)) {
        bail!("--cores {wrong}: must be 1 to {available}, the cores of this machine");
    }
    Ok(cores.into_iter().map(|cores| Configuration { cores }).collect())
}

/// Writes the report as text and as data. Returns the files.
fn write(report: &Report, args: &Args) -> anyhow::Result<[PathBuf; 2]> {
    let name = format!("{}-{}", report.date, report.machine.commit.replace(' ', "-"));
    let write = |extension: &str, bytes: &[u8]| -> anyhow::Result<PathBuf> {
        let path = args.out.join(format!("{name}.{extension}"));
        std::fs::write(&path, bytes).with_context(|| path.display().to_string())?;
        Ok(path)
    };
    create(&args.out)?;
    let text = write("md", report.markdown(args.stages).as_bytes())?;
    let data = write("json", &serde_json::to_vec_pretty(report)?)?;
    Ok([text, data])
}

fn create(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())
}
