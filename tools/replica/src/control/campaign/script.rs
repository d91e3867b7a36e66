//! The job scripts. They are files in the output, so that a person can read and change them.

use super::campaign_file::Campaign;
use super::sizes::{DRAIN_S, Sizes};
use files::shell;
use std::fmt::Write;
use std::path::Path;

/// Longest wait for a run that still writes into the output, s. After a failure of a node its processes may live on; the next
/// job waits for their end, or until their lease has expired.
const WAIT_S: u32 = 3600;

/// The script of the array: task K runs drive K of the campaign, from 0. `replica`: the program on the nodes.
pub fn array(campaign: &Campaign, sizes: &Sizes, replica: &Path) -> String {
    let Campaign { name, drives, slurm, .. } = campaign;
    let drain_s = slurm.drain_s.unwrap_or(DRAIN_S);
    let at_once = slurm.at_once.map(|n| format!("%{n}")).unwrap_or_default();
    let logs = campaign.own_folder().join("logs");
    let optional = |key: &str, value: Option<u32>| value.map(|value| format!("--{key}={value}"));
    let mut options = vec![
        format!("--job-name={name}"),
        // The last index is a literal: a task that is submitted again alone must run the same drive.
        format!("--array=0-{}{at_once}", drives.len().saturating_sub(1)),
        "--nodes=1".to_owned(),
        "--ntasks=1".to_owned(),
    ];
    options.extend(optional("cpus-per-task", slurm.cpus));
    options.extend(optional("time", sizes.minutes));
    options.extend(sizes.memory_mb.map(|megabytes| format!("--mem={megabytes}M")));
    options.extend([
        "--requeue".to_owned(),
        "--open-mode=append".to_owned(),
        format!("--signal=B:TERM@{drain_s}"),
        format!("--output={}", shell::path(&logs.join("%A_%a.log"))),
    ]);
    options.extend(slurm.options.iter().cloned());
    let mut text = header(&options);
    if let Some(megabytes) = sizes.shared_memory_mb {
        let _ = writeln!(text, "# A run needs {megabytes} MB in /dev/shm of its node.");
    }
    text += "drives=(\n";
    for drive in drives {
        let _ = writeln!(text, "    {}", shell::path(&drive.path));
    }
    text += ")\n# exec: SLURM sends the signal before the time limit to this process alone, and the batch then drains its run.\n";
    let _ = writeln!(
        text,
        "exec {} batch {} \"${{drives[$SLURM_ARRAY_TASK_ID]}}\" --out {} --wait {WAIT_S}{}",
        shell::path(replica),
        shell::path(&campaign.launch),
        shell::path(&campaign.out),
        overrides(campaign)
    );
    text
}

fn overrides(campaign: &Campaign) -> String {
    let set = campaign.set.iter().map(|value| format!(" --set {}", shell::word(value)));
    let without = campaign.without.iter().map(|value| format!(" --without {}", shell::word(value)));
    set.chain(without).collect()
}

/// The script of the job after all drives.
pub fn finish(campaign: &Campaign, replica: &Path) -> String {
    let logs = campaign.own_folder().join("logs");
    let mut options = vec![
        format!("--job-name={}-finish", campaign.name),
        "--nodes=1".to_owned(),
        "--ntasks=1".to_owned(),
        "--requeue".to_owned(),
        "--open-mode=append".to_owned(),
        format!("--output={}", shell::path(&logs.join("finish_%j.log"))),
    ];
    options.extend(campaign.slurm.options.iter().cloned());
    let mut text = header(&options);
    let _ = writeln!(text, "exec {} campaign finish {}", shell::path(replica), shell::path(&campaign.file));
    text
}

/// The first lines of a script, with options of sbatch.
fn header(options: &[String]) -> String {
    let lines = options.iter().map(|option| format!("#SBATCH {option}\n"));
    std::iter::once("#!/bin/bash\n".to_owned()).chain(lines).collect()
}
