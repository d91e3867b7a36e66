//! `replica bench`: what a launch file's pipeline costs on this machine, and what it would cost if messages were copied.

mod figures;
mod machine;
mod measure;
mod report;

use anyhow::{Context, bail};
use figures::{Configuration, Series, Transport};
use machine::Machine;
use measure::{Failure, measure};
use report::Report;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Runs a launch file several times and reports points per second, CPU, memory, bytes moved and latencies, by stage and
/// end to end, beside the same stages over a transport that copies.
#[derive(Debug, clap::Args)]
#[command(after_help = "The report goes to stdout and, as <date>-<commit>.md and .json, into the folder of --out.\n\
    Exit codes: 0 done, 1 failed, 2 usage, 3 the runs do not agree on what they processed, 78 bad configuration")]
pub struct Args {
    /// The launch file; its results go to a temporary folder, which is removed afterwards.
    #[arg(default_value = "launch.toml")]
    launch_file: PathBuf,
    /// Measured runs of each configuration; the report gives medians.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// Numbers of cores to run on; default: one and all.
    #[arg(long, value_delimiter = ',', value_name = "N,N")]
    cores: Vec<usize>,
    /// A table of the stages for every configuration, not for the first alone.
    #[arg(long)]
    stages: bool,
    /// Leave out the runs over the copying transport.
    #[arg(long)]
    no_copying: bool,
    /// Folder of the reports.
    #[arg(long, default_value = "benches/runs", value_name = "DIR")]
    out: PathBuf,
    /// Replace a setting of the launch file (may be repeated).
    #[arg(long = "set", value_name = "TABLE.KEY=VALUE")]
    overrides: Vec<String>,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let machine = Machine::look(&args.launch_file);
    let configurations = configurations(args, machine.cores)?;
    let output = tempfile::tempdir().context("a temporary folder")?;
    let mut series: Vec<Series> = configurations.iter().map(|configuration| Series::of(*configuration)).collect();
    // The first run makes the drive if need be, and fills the caches of the disk. It does not count.
    for round in 0..=args.runs {
        let measured = round > 0;
        let n = series.len();
        for place in 0..n {
            // Each round begins with another configuration, so that no one always runs behind the same.
            let index = (place + round as usize) % n;
            let configuration = series[index].configuration;
            if !measured && place > 0 {
                break;
            }
            eprintln!("run {round} of {}: {configuration}", args.runs);
            let figures = match measure(&args.launch_file, &args.overrides, configuration, output.path()) {
                Ok(figures) => figures,
                Err(Failure::Ended(code)) => return Ok(ExitCode::from(code)),
                Err(Failure::Other(error)) => return Err(error),
            };
            if measured {
                series[index].runs.push(figures);
            }
        }
    }
    let report = Report::new(&args.launch_file, args.runs, machine, series);
    print!("{}", report.markdown(args.stages));
    let (text, data) = write(&report, args)?;
    eprintln!("{}\n{}", text.display(), data.display());
    Ok(ExitCode::from(if report.agree() { 0 } else { 3 }))
}

fn configurations(args: &Args, available: usize) -> anyhow::Result<Vec<Configuration>> {
    let mut cores = if args.cores.is_empty() { vec![available, 1] } else { args.cores.clone() };
    cores.sort_unstable_by(|a, b| b.cmp(a));
    cores.dedup();
    if let Some(wrong) = cores.iter().find(|n| !(1..=available).contains(*n)) {
        bail!("--cores {wrong}: this machine has 1 to {available}");
    }
    let transports: &[Transport] =
        if args.no_copying { &[Transport::Shared] } else { &[Transport::Shared, Transport::Copying] };
    let of = |cores: usize| transports.iter().map(move |transport| Configuration { cores, transport: *transport });
    Ok(cores.into_iter().flat_map(of).collect())
}

fn write(report: &Report, args: &Args) -> anyhow::Result<(PathBuf, PathBuf)> {
    let name = format!("{}-{}", report.date, report.machine.commit.replace(' ', "-"));
    let write = |extension: &str, bytes: &[u8]| -> anyhow::Result<PathBuf> {
        let path = args.out.join(format!("{name}.{extension}"));
        std::fs::write(&path, bytes).with_context(|| path.display().to_string())?;
        Ok(path)
    };
    create(&args.out)?;
    let text = write("md", report.markdown(args.stages).as_bytes())?;
    let data = write("json", &serde_json::to_vec_pretty(report)?)?;
    Ok((text, data))
}

fn create(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())
}
