//! `run/swaps.json`: the swaps of a run. A resumed run continues with the completed ones.

use crate::identity::Files;
use run::Change;
use run::control::{SwapRequest, Swapped};
use serde::{Deserialize, Serialize};

/// All swaps of a run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct SwapRecord {
    /// Changes of completed swaps.
    pub changes: Vec<Change>,
    /// A swap that is not completed. If the run ends, it continues at the swap's barrier with the old settings.
    #[serde(rename = "trying")]
    pub trial: Option<Trial>,
    /// The files of the run after the completed swaps.
    #[serde(default)]
    pub files: Option<Files>,
    /// All swaps in their order, including undone ones.
    pub swaps: Vec<Swapped>,
}

/// A swap whose new program has not finished a tick yet.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trial {
    /// Barrier at which the stage is replaced.
    pub barrier: u64,
    /// The value of [`SwapRecord::changes`] once the swap is completed.
    pub changes: Vec<Change>,
    /// The value of [`SwapRecord::files`] once the swap is completed.
    pub files: Files,
}

impl SwapRecord {
    /// The value of [`SwapRecord::changes`] after a swap.
    pub fn changes_with(&self, request: &SwapRequest) -> Vec<Change> {
        let is_undone = |change: &Change| request.back && change.table() == request.stage;
        let kept = self.changes.iter().filter(|change| !is_undone(change)).cloned();
        kept.chain(request.changes.iter().cloned()).collect()
    }

    /// Records that the swap on trial is completed or undone.
    pub fn complete(&mut self, swapped: Swapped) {
        if let Some(trial) = self.trial.take()
            && swapped.undone.is_none()
        {
            self.changes = trial.changes;
            self.files = Some(trial.files);
        }
        self.swaps.push(swapped);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(stage: &str, back: bool, set: &[&str]) -> SwapRequest {
        let changes = set.iter().map(|text| Change::set(text).expect("valid")).collect();
        SwapRequest { stage: stage.to_owned(), back, changes }
    }

    #[test]
    fn back_removes_the_swaps_of_one_stage() {
        let mut record = SwapRecord::default();
        let unset = Change::unset("infer.model").expect("valid");
        record.changes = record.changes_with(&SwapRequest { changes: vec![unset], ..request("infer", false, &[]) });
        record.changes = record.changes_with(&request("infer_2", false, &["infer_2.a=1"]));
        let texts = |changes: &[Change]| changes.iter().map(Change::to_string).collect::<Vec<_>>();
        assert_eq!(texts(&record.changes), ["--unset infer.model", "--set infer_2.a=1"]);
        let after = record.changes_with(&request("infer", true, &["infer.b=2"]));
        assert_eq!(texts(&after), ["--set infer_2.a=1", "--set infer.b=2"]);
    }

    #[test]
    fn undone_swap_changes_no_settings() {
        let trial =
            Some(Trial { barrier: 3, changes: vec![Change::set("a.b=1").expect("valid")], files: Files::default() });
        let swapped = Swapped {
            stage: "a".to_owned(),
            barrier: 3,
            ticks: 7,
            drive_time: 0,
            drive_s: 0.0,
            changes: vec![],
            state_bytes: 0,
            seconds_without_output: None,
            undone: Some("it fails".to_owned()),
        };
        let mut record = SwapRecord { trial, ..SwapRecord::default() };
        let mut completed = record.clone();
        record.complete(swapped.clone());
        assert_eq!((record.changes.len(), record.trial.is_none(), record.swaps.len()), (0, true, 1));
        completed.complete(Swapped { undone: None, ..swapped });
        assert_eq!(completed.changes, [Change::set("a.b=1").expect("valid")]);
    }
}
