//! `replica campaign submit` and `resume`: an array job over the drives that are not finished, and a job after it.

use super::campaign_file::{Campaign, CampaignError};
use super::sizes::Sizes;
use super::submissions::{States, Submission, Submissions, Task};
use super::{Engine, File, script, slurm};
use crate::control::batch::launches::{Launches, Start};
use anyhow::{Context, bail, ensure};
use files::atomic_file::write_atomic;
use run::process::sibling;
use std::path::Path;
use std::process::ExitCode;

/// Script of the array in the campaign's folder.
const ARRAY: &str = "array.sh";
/// Script of the job after all drives.
const FINISH: &str = "finish.sh";

/// Submit all drives of a campaign that are not finished.
///
/// Writes OUT/campaign/array.sh and finish.sh, and submits them: a task for each drive, then a job for survey and deliveries.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 submitted, or nothing is left to do; 1 failed, 2 wrong usage, 78 refused\n\n\
                        Example: replica campaign submit campaign.toml --engine slurm")]
pub struct Args {
    #[command(flatten)]
    file: File,
    /// Scheduler
    #[arg(long)]
    engine: Engine,
    /// Write the scripts; submit nothing
    #[arg(long)]
    scripts_only: bool,
}

/// Submit the drives again that are neither finished nor active.
///
/// Uses the scripts of the campaign as they are, with the changes that you made. Each drive continues from its last barrier.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit codes: 0 submitted, or nothing is left to do; 1 failed, 2 wrong usage, 78 refused\n\n\
                        Example: replica campaign resume campaign.toml")]
pub struct ResumeArgs {
    #[command(flatten)]
    file: File,
}

/// Runs `submit`.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let Engine::Slurm = args.engine;
    let campaign = args.file.load()?;
    let mut submissions = Submissions::load(&campaign)?;
    let states = submissions.states()?;
    let names: Vec<String> = campaign.drives.iter().map(|drive| drive.name.clone()).collect();
    if submissions.drives != names {
        let active = states.drives.iter().flatten().filter(|task| task.is_active()).count();
        ensure!(
            active == 0,
            "{active} drives of the campaign's earlier list are active; wait for them, or end them with `replica campaign cancel`"
        );
        // Tasks of the earlier list have other drives.
        submissions.jobs.clear();
        submissions.drives = names;
    }
    let open = open_drives(&campaign, &states_of(&submissions)?)?;
    write_scripts(&campaign, &mut submissions)?;
    if args.scripts_only {
        super::print(&format!("written: {}\n", campaign.own_folder().display()));
        return Ok(ExitCode::SUCCESS);
    }
    submit(&campaign, submissions, &states, open)
}

/// Runs `resume`.
pub fn resume(args: &ResumeArgs) -> anyhow::Result<ExitCode> {
    let campaign = args.file.load()?;
    let submissions = Submissions::load_submitted(&campaign)?;
    let states = submissions.states()?;
    let open = open_drives(&campaign, &states)?;
    submit(&campaign, submissions, &states, open)
}

fn states_of(submissions: &Submissions) -> anyhow::Result<States> {
    Ok(submissions.states()?)
}

/// Indices of the drives that are neither finished nor active. An error for outputs of other settings, or that another run uses.
fn open_drives(campaign: &Campaign, states: &States) -> anyhow::Result<Vec<usize>> {
    let mut launches = Launches::new(&campaign.launch, &campaign.set, &campaign.without, 0)?;
    let mut open = Vec::new();
    let mut faults = Vec::new();
    for (index, drive) in campaign.drives.iter().enumerate() {
        if states.drives.get(index).is_some_and(|task| task.as_ref().is_some_and(Task::is_active)) {
            continue;
        }
        match launches.start_of(drive)? {
            Ok(Start::DoneBefore) => {}
            Ok(_) => open.push(index),
            Err(refusal) => faults.push(refusal.text),
        }
        ensure!(!launches.must_stop(), "interrupted; nothing was submitted");
    }
    if faults.is_empty() { Ok(open) } else { Err(CampaignError { faults }.into()) }
}

/// Writes both scripts. A script that a person has changed is kept.
fn write_scripts(campaign: &Campaign, submissions: &mut Submissions) -> anyhow::Result<()> {
    let folder = campaign.own_folder();
    let logs = folder.join("logs");
    std::fs::create_dir_all(&logs).with_context(|| logs.display().to_string())?;
    let replica = sibling("replica")?;
    let mut scripts = vec![(ARRAY, script::array(campaign, &Sizes::new(campaign), &replica))];
    if campaign.has_finish() {
        scripts.push((FINISH, script::finish(campaign, &replica)));
    }
    for (name, text) in scripts {
        let path = folder.join(name);
        let found = std::fs::read_to_string(&path).ok();
        if found.is_some() && found.as_ref() != submissions.scripts.get(name) {
            bail!(
                "{}: was changed since it was written, and the campaign would write it anew; `replica campaign resume` submits it \
                 as it is, and without the file `submit` writes it again",
                path.display()
            );
        }
        write_atomic(&path, text.as_bytes()).with_context(|| path.display().to_string())?;
        submissions.scripts.insert(name.to_owned(), text);
    }
    submissions.save(campaign)
}

fn submit(
    campaign: &Campaign,
    mut submissions: Submissions,
    states: &States,
    open: Vec<usize>,
) -> anyhow::Result<ExitCode> {
    let folder = campaign.own_folder();
    if open.is_empty() {
        super::print("no drive is left to submit\n");
        return Ok(ExitCode::SUCCESS);
    }
    // It would start before the drives that are submitted now.
    if let Some(finish) = states.finish.as_ref().filter(|finish| finish.is_active()) {
        slurm::cancel(&finish.job, slurm::Cancel::Now)?;
    }
    let at_once = campaign.slurm.at_once.map(|n| format!("%{n}")).unwrap_or_default();
    let array = slurm::submit(&folder.join(ARRAY), &[format!("--array={}{at_once}", ranges(&open))])?;
    let n = open.len();
    submissions.jobs.push(Submission { array: array.clone(), drives: open, finish: None });
    // At once: a job without a record would be submitted again.
    submissions.save(campaign)?;
    super::print(&format!("{n} of {} drives: job {array}\n", campaign.drives.len()));
    if campaign.has_finish() {
        let finish = submit_finish(&folder.join(FINISH), &submissions, states, &array).with_context(|| {
            format!(
                "the drives are submitted, survey and deliveries are not; run {} after them",
                folder.join(FINISH).display()
            )
        })?;
        super::print(&format!("survey and deliveries: job {finish}\n"));
        if let Some(last) = submissions.jobs.last_mut() {
            last.finish = Some(finish);
        }
        submissions.save(campaign)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Submits the job after the new array and after all earlier ones that are active.
fn submit_finish(script: &Path, submissions: &Submissions, states: &States, array: &str) -> anyhow::Result<String> {
    let active: Vec<&str> =
        states.drives.iter().flatten().filter(|task| task.is_active()).map(|task| task.job.as_str()).collect();
    let earlier = submissions.jobs.iter().map(|job| job.array.as_str()).filter(|earlier| {
        let own = format!("{earlier}_");
        active.iter().any(|job| job.starts_with(&own))
    });
    // afterany: afterok would wait for ever for a drive that fails or has doubts.
    let jobs: Vec<&str> = earlier.chain([array]).collect();
    Ok(slurm::submit(script, &[format!("--dependency=afterany:{}", jobs.join(":"))])?)
}

/// Indices as ranges, in SLURM's form: `0-3,5`.
fn ranges(indices: &[usize]) -> String {
    let mut ranges: Vec<(usize, usize)> = Vec::new();
    for index in indices {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == *index => *last = *index,
            _ => ranges.push((*index, *index)),
        }
    }
    let text = |(first, last)| if first == last { format!("{first}") } else { format!("{first}-{last}") };
    ranges.into_iter().map(text).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_become_ranges() {
        assert_eq!(ranges(&[0, 1, 2, 3, 5, 8, 9]), "0-3,5,8-9");
        assert_eq!(ranges(&[7]), "7");
    }
}
