//! `replica batch`: runs a launch file on many drives, one after another.
//!
//! | file | idea |
//! |---|---|
//! | `drives` | the drives of the command line, and which of them belong to a job |
//! | `launches` | starts of `replica-launch`, and signals to it |
//! | `results` | what a run has left, as a row of the table |
//! | `table` | the table as text, CSV or JSON |
//! | `plan` | how long the batch takes on several machines |

pub(super) mod drives;
pub(super) mod launches;
pub(super) mod plan;
pub(super) mod results;
mod table;

use command_line::say_error;
use drives::{BatchDrive, Job};
use launches::{Launches, Refusal, Start};
use results::{DriveOutcome, Row};
use run::exit;
use run::terminal::printable;
use std::io::Write as _;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::ExitCode;
use table::Format;

/// Process many drives, one after another.
///
/// Runs the launch file on each drive into DIR/NAME; the messages of the run go to DIR/NAME.log. NAME is the name of the drive.
/// Repeating the command runs only drives that are not complete, and continues an interrupted one. The first
/// Ctrl-C drains the current run and ends the batch; the second one stops the run.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 all drives are complete, 1 a drive failed, 2 wrong usage, 3 a drive has doubts or is not \
                  finished, 78 refused before the start, or no drive fits the launch file\n\n\
                  Example: replica batch launch.toml drives/monday drives/tuesday --out results"
)]
pub struct Args {
    /// Launch file
    launch_file: PathBuf,
    /// Drive folders or captures, as run.drive takes them
    #[arg(required = true)]
    drives: Vec<PathBuf>,
    /// Folder of the results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Override a setting of the launch file (may be repeated)
    #[arg(long = "set", value_name = "TABLE.KEY=VALUE")]
    overrides: Vec<String>,
    /// Leave a stage out (may be repeated)
    #[arg(long, value_name = "TABLE")]
    without: Vec<String>,
    /// Only the drives of job I of N: each Nth, starting with the Ith
    #[arg(long, value_name = "I/N")]
    job: Option<Job>,
    /// Start no further drive after one that failed
    #[arg(long)]
    stop_at_first: bool,
    /// Replace results that were made with other settings
    ///
    /// Without it, they are kept and the batch is refused.
    #[arg(long)]
    overwrite: bool,
    /// Wait up to this long for another run that writes into the output of a drive, also on another host
    #[arg(long, value_name = "SECONDS", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=31_536_000))]
    wait: u32,
    /// Print the table of the results so far; start nothing
    #[arg(long, value_name = "FORMAT", num_args = 0..=1, require_equals = true, default_missing_value = "text")]
    table: Option<Format>,
    /// Print how long the batch takes on 1 to N machines; start nothing
    ///
    /// Computed from the drives that are finished; the others count in proportion to their bytes.
    #[arg(long, value_name = "N", conflicts_with_all = ["table", "job"], value_parser = clap::value_parser!(u32).range(1..=10_000))]
    plan: Option<u32>,
}

/// Runs the command. Lines about drives go to stdout.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let all = match BatchDrive::list(&args.drives, &args.out) {
        Ok(all) => all,
        Err(faults) => return Ok(refused(&faults)),
    };
    let drives: Vec<BatchDrive> = match args.job {
        Some(job) => all.into_iter().enumerate().filter(|(index, _)| job.has(*index)).map(|(_, drive)| drive).collect(),
        None => all,
    };
    if let Some(n_machines) = args.plan {
        print(&plan::text(&drives, n_machines as usize)?);
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(format) = args.table {
        let rows: Vec<Row> = drives.iter().map(Row::read).collect();
        print(&table::text(&rows, format)?);
        return Ok(ExitCode::from(exit_code(&rows)));
    }
    std::fs::create_dir_all(&args.out).map_err(|error| anyhow::anyhow!("{}: {error}", args.out.display()))?;
    let mut launches = Launches::new(&args.launch_file, &args.overrides, &args.without, args.wait)?;
    let starts = match starts(&mut launches, &drives, args.overwrite)? {
        Ok(starts) => starts,
        Err(refusals) => return Ok(refused_outputs(&refusals)),
    };
    let rows = process(&mut launches, &drives, &starts, args.stop_at_first)?;
    print(&format!("{}\n", table::totals(&rows)));
    Ok(ExitCode::from(exit_code(&rows)))
}

/// How each drive starts, or all faults of the outputs.
fn starts(
    launches: &mut Launches,
    drives: &[BatchDrive],
    overwrite: bool,
) -> anyhow::Result<Result<Vec<Start>, Vec<Refusal>>> {
    let mut starts = Vec::new();
    let mut refusals = Vec::new();
    for drive in drives {
        match launches.start_of(drive)? {
            Ok(start) => starts.push(start),
            Err(_) if overwrite => starts.push(Start::Overwrite),
            Err(refusal) => refusals.push(refusal),
        }
    }
    Ok(if refusals.is_empty() { Ok(starts) } else { Err(refusals) })
}

/// Runs the drives that are not complete; a row for each drive.
fn process(
    launches: &mut Launches,
    drives: &[BatchDrive],
    starts: &[Start],
    stop_at_first: bool,
) -> anyhow::Result<Vec<Row>> {
    let n = drives.len();
    let mut must_stop = false;
    let mut rows = Vec::new();
    for (i, (drive, start)) in drives.iter().zip(starts).enumerate() {
        must_stop |= launches.must_stop();
        let mut row = Row::read(drive);
        if must_stop {
            rows.push(row);
            continue;
        }
        let mut remark = String::new();
        if *start == Start::DoneBefore {
            remark.push_str(" (done before)");
        } else {
            let ended = launches.run(drive, *start)?;
            row = Row::read(drive);
            if ended.signal().is_some() && launches.must_stop() {
                // The SIGTERM of a whole job, before the run could drain.
                remark = format!(" ({ended}; not finished)");
            } else if !matches!(ended.code(), Some(0 | 3)) {
                row.fail(ended.code());
                remark = format!(" ({ended}); see {}", drive.log.display());
            }
        }
        print(&format!("[{}/{n}] {row}{remark}\n", i + 1));
        must_stop |= stop_at_first && row.outcome == DriveOutcome::Failed;
        rows.push(row);
    }
    Ok(rows)
}

/// The exit code of a batch with these results.
fn exit_code(rows: &[Row]) -> u8 {
    if rows.iter().any(|row| row.outcome == DriveOutcome::Failed) {
        // A setting that does not exist fails with every drive.
        let is_refused = rows.iter().all(|row| row.exit_code == Some(i32::from(exit::CONFIGURATION)));
        return if is_refused { exit::CONFIGURATION } else { exit::FAILED };
    }
    let is_complete = rows.iter().all(|row| row.outcome == DriveOutcome::Complete);
    if is_complete { exit::DONE } else { exit::INCOMPLETE }
}

/// Outputs that must be kept. Another run into an output ends: then the same command may start.
fn refused_outputs(refusals: &[Refusal]) -> ExitCode {
    for refusal in refusals {
        say_error!("error: {}", refusal.text);
    }
    let is_final = refusals.iter().any(|refusal| refusal.is_of_other_settings);
    ExitCode::from(if is_final { exit::CONFIGURATION } else { exit::FAILED })
}

fn refused(faults: &[String]) -> ExitCode {
    for fault in faults {
        say_error!("error: {fault}");
    }
    ExitCode::from(exit::CONFIGURATION)
}

/// Prints to stdout. A reader that has closed the pipe does not end the batch.
fn print(text: &str) {
    let mut stdout = std::io::stdout().lock();
    let _ = stdout.write_all(printable(text).as_bytes()).and_then(|()| stdout.flush());
}
