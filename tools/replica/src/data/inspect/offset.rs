//! The offset between points and images of a run, from its summary.

use anyhow::{Context, ensure};
use run::summary::Summary;
use serde::Serialize;
use std::path::Path;

/// The offset of a run.
#[derive(Serialize)]
pub struct OffsetFacts {
    /// The notes of `colorize` about the offset.
    notes: Vec<String>,
    cameras_with_known_offset: u64,
    /// Cameras with an offset above `max_offset_mrad`.
    cameras_with_large_offset: u64,
}

impl OffsetFacts {
    /// The notes, one per line, and the counts.
    pub fn text(&self) -> String {
        let known = self.cameras_with_known_offset;
        let far = self.cameras_with_large_offset;
        let notes = self.notes.join("\n");
        format!("{notes}\n{known} cameras with a known offset, {far} of them beyond max_offset_mrad\n")
    }
}

/// Reads the offset from the summary of a run.
pub fn read(run: &Path) -> anyhow::Result<OffsetFacts> {
    let summary = Summary::load(run).context("hint: --offset needs the output folder of a run that has ended")?;
    let path = run.join("summary.json");
    let stage = summary.stages.iter().find(|stage| stage.name == "colorize");
    let stage = stage
        .with_context(|| format!("{}: the run had no stage colorize, which measures the offset", path.display()))?;
    let is_about_offset = |note: &&String| note.starts_with("offset ") || note.starts_with("images were taken ");
    let notes: Vec<String> = stage.notes.iter().filter(is_about_offset).cloned().collect();
    ensure!(!notes.is_empty(), "{}: colorize found no outline in any image, so the offset is unknown", path.display());
    let count = |name: &str| stage.counters.get(name).copied().unwrap_or_default();
    Ok(OffsetFacts {
        notes,
        cameras_with_known_offset: count("cameras_with_known_offset"),
        cameras_with_large_offset: count("cameras_with_large_offset"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::summary::StageSummary;

    fn written(stage: StageSummary) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        let summary = Summary { stages: vec![stage], ..Summary::default() };
        let text = serde_json::to_string(&summary).expect("encodes");
        std::fs::write(folder.path().join("summary.json"), text).expect("writes");
        folder
    }

    #[test]
    fn report_contains_only_the_offset_notes() {
        let notes = ["offset in mrad: front 9.1 +- 0.2; no delay found", "offset of front: 9.10 mrad", "no cubes"];
        let counters = [("cameras_with_known_offset", 1), ("cameras_with_large_offset", 1)];
        let folder = written(StageSummary {
            name: "colorize".to_owned(),
            notes: notes.map(str::to_owned).to_vec(),
            counters: counters.map(|(name, n)| (name.to_owned(), n)).into(),
            ..StageSummary::default()
        });
        let report = read(folder.path()).expect("is there").text();
        let end = "1 cameras with a known offset, 1 of them beyond max_offset_mrad";
        assert_eq!(report.lines().collect::<Vec<_>>(), [notes[0], notes[1], end]);
    }

    #[test]
    fn run_without_measurement_is_an_error() {
        let error = |folder: &Path| read(folder).map(|offset| offset.text()).expect_err("nothing").to_string();
        let seen_nothing = written(StageSummary { name: "colorize".to_owned(), ..StageSummary::default() });
        assert!(error(seen_nothing.path()).contains("the offset is unknown"));
        assert!(error(written(StageSummary::default()).path()).contains("no stage colorize"));
        assert!(error(&seen_nothing.path().join("elsewhere")).contains("hint: --offset needs"));
    }
}
