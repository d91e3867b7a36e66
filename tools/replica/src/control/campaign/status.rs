//! `replica campaign status`: what the engine says about each drive, and what its run has left.

use super::File;
use super::campaign_file::Campaign;
use super::submissions::{Submissions, Task};
use crate::control::batch::results::{DriveOutcome, Row, doubt_names};
use command_line::answer::Answer;
use run::exit;
use serde::Serialize;
use std::fmt::Write;
use std::process::ExitCode;

/// Print the state of each drive and job of a campaign.
///
/// The job's state is from SLURM, everything else from the files of the run.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 all drives are complete, 1 a drive failed, 2 wrong usage, 3 a drive has doubts or is not \
                        finished, 78 refused\n\n\
                        Example: replica campaign status campaign.toml"
)]
pub struct Args {
    #[command(flatten)]
    file: File,
    #[command(flatten)]
    answer: Answer,
}

/// All drives and jobs.
#[derive(Debug, Serialize)]
struct Status {
    drives: Vec<DriveStatus>,
    finish: Option<Task>,
}

#[derive(Debug, Serialize)]
struct DriveStatus {
    #[serde(flatten)]
    row: Row,
    task: Option<Task>,
}

impl DriveStatus {
    /// The outcome as a table shows it: a run whose job is active has neither failed nor been interrupted.
    fn outcome(&self) -> &'static str {
        let is_active = self.task.as_ref().is_some_and(Task::is_active);
        match (self.row.is_finished(), is_active) {
            (false, true) => "-",
            _ => self.row.outcome.text(),
        }
    }
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let campaign = args.file.load()?;
    let status = read(&campaign)?;
    args.answer.print(&status, || text(&status))?;
    Ok(ExitCode::from(exit_code(&status)))
}

fn read(campaign: &Campaign) -> anyhow::Result<Status> {
    let states = Submissions::load_submitted(campaign)?.states()?;
    // The runs after the jobs: a job that has just ended has written its summary.
    let rows = campaign.drives.iter().map(Row::read);
    let drives = rows.zip(states.drives).map(|(row, task)| DriveStatus { row, task }).collect();
    Ok(Status { drives, finish: states.finish })
}

fn exit_code(status: &Status) -> u8 {
    let is_failed = |drive: &DriveStatus| drive.outcome() == DriveOutcome::Failed.text();
    if status.drives.iter().any(is_failed) {
        exit::FAILED
    } else if status.drives.iter().all(|drive| drive.row.outcome == DriveOutcome::Complete) {
        exit::DONE
    } else {
        exit::INCOMPLETE
    }
}

fn text(status: &Status) -> String {
    let width = status.drives.iter().map(|drive| drive.row.drive.chars().count()).max().unwrap_or_default().max(5);
    let mut text = format!(
        "{:width$}  outcome     job         state         node        drive s   wall s    CPU s  doubts\n",
        "drive"
    );
    for drive in &status.drives {
        let row = &drive.row;
        let (job, state, node) = cells(drive.task.as_ref());
        let mut line = format!("{:width$}  {:<10}  {job:<10}  {state:<12}  {node:<10}", row.drive, drive.outcome());
        if row.is_finished() {
            let doubts = doubt_names(&row.doubts);
            // Writing to a string cannot fail.
            let _ = write!(line, " {:8.1} {:8.1} {:8.1}  {doubts}", row.drive_s, row.wall_s, row.cpu_s);
        }
        text += line.trim_end();
        text.push('\n');
    }
    let count =
        |is_counted: &dyn Fn(&DriveStatus) -> bool| status.drives.iter().filter(|drive| is_counted(drive)).count();
    let finished = count(&|drive| drive.row.is_finished());
    let active = count(&|drive| drive.task.as_ref().is_some_and(Task::is_active));
    let cpu_h: f64 = status.drives.iter().map(|drive| drive.row.cpu_s).sum::<f64>() / 3600.0;
    let _ = writeln!(
        text,
        "{} drives: {finished} finished, {active} jobs active; {cpu_h:.2} CPU hours",
        status.drives.len()
    );
    if let Some(finish) = &status.finish {
        let (job, state, _) = cells(Some(finish));
        let _ = writeln!(text, "survey and deliveries: job {job} {state}");
    }
    text
}

/// Job, state and node as words; a job that waits shows its reason instead of a node.
fn cells(task: Option<&Task>) -> (String, String, String) {
    let Some(task) = task else { return ("-".to_owned(), "-".to_owned(), String::new()) };
    let Some(state) = &task.state else { return (task.job.clone(), "ended".to_owned(), String::new()) };
    let node = if state.nodes.is_empty() { &state.reason } else { &state.nodes };
    (task.job.clone(), state.state.clone(), node.clone())
}

#[cfg(test)]
mod tests {
    use super::super::slurm::JobState;
    use super::*;

    fn drive(outcome: DriveOutcome, state: Option<&str>) -> DriveStatus {
        let state = state.map(|state| JobState { state: state.to_owned(), ..JobState::default() });
        let row = Row { drive: "a".to_owned(), outcome, ..Row::default() };
        DriveStatus { row, task: Some(Task { job: "12_0".to_owned(), state }) }
    }

    #[test]
    fn drive_of_an_active_job_has_not_failed() {
        let code = |drives: Vec<DriveStatus>| exit_code(&Status { drives, finish: None });
        assert_eq!(code(vec![drive(DriveOutcome::Failed, Some("PENDING"))]), exit::INCOMPLETE, "it will run again");
        assert_eq!(code(vec![drive(DriveOutcome::Failed, Some("FAILED"))]), exit::FAILED);
        assert_eq!(code(vec![drive(DriveOutcome::Failed, None)]), exit::FAILED, "SLURM has forgotten it");
        assert_eq!(code(vec![drive(DriveOutcome::Unfinished, Some("TIMEOUT"))]), exit::INCOMPLETE);
        assert_eq!(code(vec![drive(DriveOutcome::Complete, Some("COMPLETED"))]), exit::DONE);
        let text = text(&Status { drives: vec![drive(DriveOutcome::Unfinished, Some("RUNNING"))], finish: None });
        assert!(text.contains("a      -           12_0        RUNNING"), "{text}");
        assert!(text.contains("1 drives: 0 finished, 1 jobs active"), "{text}");
    }
}
