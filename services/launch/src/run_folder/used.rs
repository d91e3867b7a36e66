//! Results of an earlier run in an output folder. A new run would replace them.

use super::SETTINGS;
use super::states::States;
use run::Outcome;
use run::assignment::state_file;
use run::summary::Summary;
use std::fmt;
use std::path::Path;

/// Results of an earlier run. The next run keeps them unless its operator chooses otherwise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EarlierResults {
    n_clouds: usize,
    /// Outcome of the earlier run; `None` if it has no summary.
    outcome: Option<Outcome>,
    /// Whether `--resume` can continue it.
    can_resume: bool,
}

impl EarlierResults {
    /// The results in `output`. `None` without a cloud, a saved state or a run that processed a point.
    pub fn find(output: &Path) -> Option<Self> {
        let has_summary = Summary::file(output).exists();
        let summary = Summary::load(output).ok();
        let has_produced = match &summary {
            Some(summary) => summary.total.points > 0 || summary.outcome.is_in_order(),
            // A file that this version cannot read may be the summary of another version.
            None => has_summary,
        };
        let n_clouds = entries(&output.join("clouds"));
        let has_states = has_states(&output.join("run/states"), summary.as_ref());
        let can_resume = has_states && output.join("run").join(SETTINGS).exists();
        let is_used = n_clouds > 0 || has_states || has_produced;
        is_used.then(|| Self { n_clouds, outcome: summary.map(|summary| summary.outcome), can_resume })
    }
}

/// Whether there is a barrier to continue from. After a run that has a summary, it must be one that all of its stages
/// have reached; the first stage may be ahead of one that has failed at its first tick.
fn has_states(folder: &Path, summary: Option<&Summary>) -> bool {
    let stages = summary.map(|summary| summary.stages.as_slice()).unwrap_or_default();
    let has_all = |barrier: u64| stages.iter().all(|stage| state_file(folder, barrier, &stage.name).exists());
    States::new(folder.to_owned()).barriers().into_iter().any(has_all)
}

/// Entries of a folder; 0 if it cannot be listed.
fn entries(folder: &Path) -> usize {
    std::fs::read_dir(folder).map_or(0, Iterator::count)
}

impl fmt::Display for EarlierResults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.outcome {
            Some(outcome) => write!(f, "a run that ended as `{outcome}`")?,
            None => write!(f, "a run that was interrupted")?,
        }
        if self.n_clouds > 0 {
            write!(f, ", with {} files in clouds/", self.n_clouds)?;
        }
        write!(f, "; set another run.output, or add --overwrite to replace them")?;
        if self.can_resume && self.outcome != Some(Outcome::Done) {
            write!(f, ", or --resume to continue that run")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::summary::StageSummary;

    fn write(path: &Path, text: &str) {
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, text).expect("written");
    }

    fn summary(outcome: Outcome, points: u64) -> String {
        let mut summary = Summary { outcome, ..Summary::default() };
        summary.total.points = points;
        serde_json::to_string(&summary).expect("JSON")
    }

    #[test]
    fn output_with_results_of_an_earlier_run_is_used() {
        for (name, text) in [
            ("clouds/submap_0000.ply", String::new()),
            ("run/states/3/export.state", String::new()),
            ("summary.json", summary(Outcome::Done, 0)),
            ("summary.json", summary(Outcome::Failed, 7)),
            ("summary.json", "of another version".to_owned()),
        ] {
            let output = tempfile::tempdir().expect("a folder");
            write(&output.path().join(name), &text);
            assert!(EarlierResults::find(output.path()).is_some(), "{name}: {text}");
        }
    }

    #[test]
    fn output_without_results_is_free() {
        let output = tempfile::tempdir().expect("a folder");
        assert_eq!(EarlierResults::find(&output.path().join("absent")), None);
        write(&output.path().join("notes.txt"), "of the operator");
        write(&output.path().join("run/settings.json"), "{}");
        write(&output.path().join("summary.json"), &summary(Outcome::Failed, 0));
        assert_eq!(EarlierResults::find(output.path()), None);
    }

    #[test]
    fn barrier_that_not_all_stages_reached_is_no_result() {
        let output = tempfile::tempdir().expect("a folder");
        let stage = |name: &str| StageSummary { name: name.to_owned(), ..StageSummary::default() };
        let stages = vec![stage("acquire"), stage("export")];
        let failed = Summary { outcome: Outcome::Failed, stages, ..Summary::default() };
        write(&output.path().join("summary.json"), &serde_json::to_string(&failed).expect("JSON"));
        write(&output.path().join("run/states/1/acquire.state"), "");
        assert_eq!(EarlierResults::find(output.path()), None);
        write(&output.path().join("run/states/1/export.state"), "");
        assert!(EarlierResults::find(output.path()).is_some());
    }

    #[test]
    fn text_says_how_to_continue() {
        let output = tempfile::tempdir().expect("a folder");
        write(&output.path().join("clouds/submap_0000.ply"), "");
        write(&output.path().join("run/states/3/export.state"), "");
        write(&output.path().join("run/settings.json"), "{}");
        let text = |output: &Path| EarlierResults::find(output).expect("is used").to_string();
        assert_eq!(
            text(output.path()),
            "a run that was interrupted, with 1 files in clouds/; set another run.output, or add --overwrite to replace \
             them, or --resume to continue that run"
        );
        write(&output.path().join("summary.json"), &summary(Outcome::Done, 7));
        assert!(!text(output.path()).contains("--resume"), "a finished run needs no resume");
    }
}
