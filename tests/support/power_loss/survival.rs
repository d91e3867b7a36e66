//! Runs that are resumed after a power loss.

use super::{Journal, RecordedDisk, Survives, Tree};
use crate::launch::{Launch, result_files};
use random::Random;
use std::collections::BTreeMap;
use std::fmt;

/// A run with all changes of its disk.
pub struct RecordedRun {
    launch: Launch,
    journal: Journal,
    /// Changes of an earlier run, before this run.
    n_before: usize,
    expected: BTreeMap<String, Vec<u8>>,
    /// Files of the earlier run.
    earlier: Option<BTreeMap<String, Vec<u8>>>,
}

/// Outcomes of resumed runs.
#[derive(Debug, Default)]
pub struct Survival {
    /// Number of runs continued from a barrier, with the bytes of the undisturbed run.
    pub resumed: usize,
    /// Number of runs started again, with the same bytes.
    pub begun_again: usize,
    /// Number of refused runs, by the text without numbers.
    pub refused: BTreeMap<String, usize>,
    /// Wrong results and unclear refusals.
    pub faults: Vec<String>,
}

impl RecordedRun {
    /// Runs `launch` on a recorded disk. With `earlier`, a run with these arguments precedes it, whose results it
    /// replaces.
    ///
    /// # Panics
    /// If a run fails.
    pub fn new(launch: Launch, earlier: Option<&[&str]>) -> Self {
        let disk = RecordedDisk::mount(&launch.output());
        let mut n_before = 0;
        let mut arguments = Vec::new();
        let mut before = None;
        if let Some(earlier) = earlier {
            assert_eq!(launch.start_again(earlier).wait(), Some(0), "{}", launch.stderr());
            before = Some(result_files(&launch.output()));
            n_before = disk.n_changes();
            arguments.push("--overwrite");
        }
        assert_eq!(launch.start_again(&arguments).wait(), Some(0), "{}", launch.stderr());
        let expected = result_files(&launch.output());
        Self { journal: disk.unmount(), launch, n_before, expected, earlier: before }
    }

    /// The changes of the disk.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }

    /// The files of the run that was not disturbed.
    pub fn expected(&self) -> &BTreeMap<String, Vec<u8>> {
        &self.expected
    }

    /// All power losses within the run that leave different disks.
    pub fn crashes(&self) -> Vec<(usize, Survives)> {
        self.journal.crashes(4).into_iter().filter(|(moment, _)| *moment >= self.n_before).collect()
    }

    /// Resumes the run after `n` power losses, drawn from `crashes`, or after all of them if there are fewer.
    pub fn survive(&self, n: usize, random: &mut Random) -> Survival {
        let mut crashes = self.crashes();
        let mut survival = Survival::default();
        for _ in 0..n.min(crashes.len()) {
            let (moment, survives) = crashes.swap_remove(random.index(crashes.len()));
            let tree = self.journal.after(moment, survives);
            if let Err(fault) = self.resume(&tree, &mut survival) {
                let n_changes = self.journal.n_changes();
                survival.faults.push(format!("before change {moment} of {n_changes}, {survives:?} survives: {fault}"));
            }
        }
        survival
    }

    /// Resumes the run on this disk.
    fn resume(&self, tree: &Tree, survival: &mut Survival) -> Result<(), String> {
        tree.write(&self.launch.output());
        let is_earlier = self.earlier.as_ref().is_some_and(|earlier| *earlier == self.results());
        if tree.says_done() && !is_earlier {
            self.compare().map_err(|fault| format!("the summary says `done`, but {fault}"))?;
        }
        let code = self.launch.start_again(&["--resume"]).wait();
        let text = self.launch.stderr();
        match code {
            Some(0) => {
                self.compare()?;
                let is_resumed = text.contains("resuming from barrier");
                *(if is_resumed { &mut survival.resumed } else { &mut survival.begun_again }) += 1;
                Ok(())
            }
            // The text must name a file or folder of the output.
            Some(1 | 78) if text.contains(&*self.launch.output().to_string_lossy()) => {
                let last = text.lines().last().unwrap_or_default();
                let last = last.replace(&*self.launch.output().to_string_lossy(), "out");
                let reason: String = last.chars().filter(|char| !char.is_ascii_digit()).collect();
                *survival.refused.entry(reason).or_default() += 1;
                Ok(())
            }
            other => Err(format!("--resume ended with {other:?}: {text}")),
        }
    }

    /// The results in the output, without temporary files.
    fn results(&self) -> BTreeMap<String, Vec<u8>> {
        let got = result_files(&self.launch.output());
        got.into_iter().filter(|(name, _)| !name.ends_with(".partial")).collect()
    }

    /// Checks that the results in the output equal the undisturbed run.
    fn compare(&self) -> Result<(), String> {
        let got = self.results();
        let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
        if names(&got) != names(&self.expected) {
            return Err(format!("the files are {:?}, not {:?}", names(&got), names(&self.expected)));
        }
        match got.iter().find(|(name, bytes)| self.expected[*name] != **bytes) {
            Some((name, bytes)) => Err(format!("{name} with {} bytes differs", bytes.len())),
            None => Ok(()),
        }
    }
}

impl Tree {
    /// Whether a summary reports the run as done.
    fn says_done(&self) -> bool {
        let summary: Option<serde_json::Value> =
            self.file("summary.json").and_then(|bytes| serde_json::from_slice(bytes).ok());
        summary.is_some_and(|summary| summary["outcome"] == "done")
    }
}

impl Survival {
    /// Number of power losses that were tried.
    pub fn total(&self) -> usize {
        self.resumed + self.begun_again + self.refused.values().sum::<usize>() + self.faults.len()
    }
}

impl fmt::Display for Survival {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { resumed, begun_again, refused, faults } = self;
        writeln!(
            f,
            "{} power losses: {resumed} resumed, {begun_again} started again, with the same bytes",
            self.total()
        )?;
        for (reason, n) in refused {
            writeln!(f, "{n} refused: {reason}")?;
        }
        for fault in faults {
            writeln!(f, "FAULT {fault}")?;
        }
        Ok(())
    }
}
