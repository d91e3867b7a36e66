//! `run/swaps.json`: which swaps hold in a run, so that a killed supervisor's successor goes on with them.

use serde::{Deserialize, Serialize};
use stage::control::{SwapRequest, Swapped};

/// All swaps of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SwapRecord {
    /// What holds beyond the launch file and the command line, in the form of `--set`.
    pub overrides: Vec<String>,
    /// A swap that has been begun. Until it holds, the run goes back to its barrier and to what held before.
    pub trying: Option<Trying>,
    /// All swaps in their order, undone ones too.
    pub swaps: Vec<Swapped>,
}

/// A swap of which it is not known yet whether the run goes on with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trying {
    /// Where it changes.
    pub barrier: u64,
    /// [`SwapRecord::overrides`] from then on.
    pub overrides: Vec<String>,
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

    /// The swap that is being tried holds, or is undone.
    pub fn settle(&mut self, swapped: Swapped) {
        if let Some(trying) = self.trying.take()
            && swapped.undone.is_none()
        {
            self.overrides = trying.overrides;
        }
        self.swaps.push(swapped);
    }
}

/// What the request itself brings, in the form of `--set`.
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
    fn swaps_add_up_and_going_back_forgets_those_of_one_stage() {
        let mut record = SwapRecord::default();
        let unset = vec!["model".to_owned()];
        let program = Some("/p".into());
        record.overrides = record.overrides_with(&SwapRequest { unset, program, ..request("infer", false, &[]) });
        assert_eq!(record.overrides, ["!infer.model", "infer.program=/p"]);
        record.overrides = record.overrides_with(&request("infer_2", false, &["a=1"]));
        assert_eq!(record.overrides_with(&request("infer", true, &["b=2"])), ["infer_2.a=1", "infer.b=2"]);
    }

    #[test]
    fn a_swap_that_is_undone_changes_nothing() {
        let trying = Some(Trying { barrier: 3, overrides: vec!["a.b=1".to_owned()] });
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
        let mut record = SwapRecord { trying, ..SwapRecord::default() };
        let mut holds = record.clone();
        record.settle(swapped.clone());
        assert_eq!((record.overrides.len(), record.trying, record.swaps.len()), (0, None, 1));
        holds.settle(Swapped { undone: None, ..swapped });
        assert_eq!(holds.overrides, ["a.b=1"]);
    }
}
