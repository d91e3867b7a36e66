//! The offset between points and images of a run, from its summary.

use anyhow::{Context, ensure};
use run::summary::Summary;
use std::path::Path;

/// The notes of `colorize` about the offset, one per line.
pub fn report(run: &Path) -> anyhow::Result<String> {
    let summary = Summary::load(run).context("hint: --offset needs the output folder of a run that has ended")?;
    let path = run.join("summary.json");
    let stage = summary.stages.iter().find(|stage| stage.name == "colorize");
    let stage = stage
        .with_context(|| format!("{}: the run had no stage colorize, which measures the offset", path.display()))?;
    let is_about_offset = |note: &&String| note.starts_with("offset ") || note.starts_with("images were taken ");
    let lines: Vec<&str> = stage.notes.iter().filter(is_about_offset).map(String::as_str).collect();
    ensure!(!lines.is_empty(), "{}: colorize found no outline in any image, so the offset is unknown", path.display());
    let count = |name: &str| stage.counters.get(name).copied().unwrap_or_default();
    let (known, far) = (count("cameras_with_known_offset"), count("cameras_with_large_offset"));
    let end = format!("{known} cameras with a known offset, {far} of them beyond max_offset_mrad");
    Ok(format!("{}\n{end}\n", lines.join("\n")))
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
        let report = report(folder.path()).expect("is there");
        let end = "1 cameras with a known offset, 1 of them beyond max_offset_mrad";
        assert_eq!(report.lines().collect::<Vec<_>>(), [notes[0], notes[1], end]);
    }

    #[test]
    fn run_without_measurement_is_an_error() {
        let error = |folder: &Path| report(folder).expect_err("nothing").to_string();
        let seen_nothing = written(StageSummary { name: "colorize".to_owned(), ..StageSummary::default() });
        assert!(error(seen_nothing.path()).contains("the offset is unknown"));
        assert!(error(written(StageSummary::default()).path()).contains("no stage colorize"));
        assert!(error(&seen_nothing.path().join("elsewhere")).contains("hint: --offset needs"));
    }
}
