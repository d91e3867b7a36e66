//! `run/swaps.json`: the swaps of a run. A resumed run continues with the completed ones.

use crate::identity::Files;
use run::control::{SwapRequest, Swapped};
use serde::{Deserialize, Serialize};

/// All swaps of a run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct SwapRecord {
    /// Settings of completed swaps, in the form of `--set`.
    pub overrides: Vec<String>,
    /// A swap that is not completed. If the run ends, it continues at the swap's barrier with the old settings.
    #[serde(rename = "trying")]
    pub trial: Option<Trial>,
    /// The files of the run after the completed swaps.
    #[serde(default)]
    pub files: Option<Files>,
    /// All swaps in their order, undone ones too.
    pub swaps: Vec<Swapped>,
}

/// A swap whose new program has not finished a tick yet.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trial {
    /// Where the stage is replaced.
    pub barrier: u64,
    /// [`SwapRecord::overrides`] once it is completed.
    pub overrides: Vec<String>,
    /// [`SwapRecord::files`] once it is completed.
    pub files: Files,
}

impl SwapRecord {
    /// [`SwapRecord::overrides`] after a swap.
    pub fn overrides_with(&self, request: &SwapRequest) -> Vec<String> {
        let own = format!("{}.", request.stage);
        let is_own = |text: &String| text.strip_prefix('!').unwrap_or(text).starts_with(&own);
        let mut overrides: Vec<String> =
            self.overrides.iter().filter(|text| !(request.back && is_own(text))).cloned().collect();
        overrides.extend(changes(request));
        overrides
    }

    /// The swap on trial is completed or undone.
    pub fn complete(&mut self, swapped: Swapped) {
        if let Some(trial) = self.trial.take()
            && swapped.undone.is_none()
        {
            self.overrides = trial.overrides;
            self.files = Some(trial.files);
        }
        self.swaps.push(swapped);
    }
}

/// The changes of the request, in the form of `--set`.
pub fn changes(request: &SwapRequest) -> Vec<String> {
    let SwapRequest { stage, program, unset, set, .. } = request;
    let unset = unset.iter().map(|key| format!("!{stage}.{key}"));
    let program = program.iter().map(|program| format!("{stage}.program={}", program.display()));
    unset.chain(program).chain(set.iter().map(|text| format!("{stage}.{text}"))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(stage: &str, back: bool, set: &[&str]) -> SwapRequest {
        let set = set.iter().map(|text| (*text).to_owned()).collect();
        SwapRequest { stage: stage.to_owned(), back, set, ..SwapRequest::default() }
    }

    #[test]
    fn back_removes_the_swaps_of_one_stage() {
        let mut record = SwapRecord::default();
        let unset = vec!["model".to_owned()];
        let program = Some("/p".into());
        record.overrides = record.overrides_with(&SwapRequest { unset, program, ..request("infer", false, &[]) });
        assert_eq!(record.overrides, ["!infer.model", "infer.program=/p"]);
        record.overrides = record.overrides_with(&request("infer_2", false, &["a=1"]));
        assert_eq!(record.overrides_with(&request("infer", true, &["b=2"])), ["infer_2.a=1", "infer.b=2"]);
    }

    #[test]
    fn undone_swap_changes_no_settings() {
        let trial = Some(Trial { barrier: 3, overrides: vec!["a.b=1".to_owned()], files: Files::default() });
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
        assert_eq!((record.overrides.len(), record.trial.is_none(), record.swaps.len()), (0, true, 1));
        completed.complete(Swapped { undone: None, ..swapped });
        assert_eq!(completed.overrides, ["a.b=1"]);
    }
}
