//! How far the points and the images of a run are apart, as its summary has it.

use anyhow::{Context, ensure};
use stage::summary::Summary;
use std::path::Path;

/// What the stage that measures it said, line by line.
pub fn report(run: &Path) -> anyhow::Result<String> {
    let path = run.join("summary.json");
    let text = std::fs::read_to_string(&path).with_context(|| {
        format!("{}: cannot be read; --offset needs the output folder of a run that has ended", path.display())
    })?;
    let summary: Summary = serde_json::from_str(&text).with_context(|| format!("{}: is no summary", path.display()))?;
    let stage = summary.stages.iter().find(|stage| stage.name == "colorize");
    let stage = stage.with_context(|| format!("{}: the run had no colorize, which measures it", path.display()))?;
    let is_about_it = |note: &&String| note.starts_with("offset ") || note.starts_with("images were taken ");
    let lines: Vec<&str> = stage.notes.iter().filter(is_about_it).map(String::as_str).collect();
    ensure!(!lines.is_empty(), "{}: colorize saw no outline in any image: nothing is known", path.display());
    let count = |name: &str| stage.counters.get(name).copied().unwrap_or_default();
    let (known, far) = (count("cameras_with_known_offset"), count("cameras_with_large_offset"));
    let end = format!("{known} cameras with a known offset, {far} of them beyond max_offset_mrad");
    Ok(format!("{}\n{end}\n", lines.join("\n")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use stage::summary::StageSummary;

    fn written(stage: StageSummary) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        let summary = Summary { stages: vec![stage], ..Summary::default() };
        let text = serde_json::to_string(&summary).expect("encodes");
        std::fs::write(folder.path().join("summary.json"), text).expect("writes");
        folder
    }

    #[test]
    fn what_colorize_said_of_it_is_shown_and_nothing_else() {
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
    fn a_run_that_measured_nothing_says_so() {
        let error = |folder: &Path| report(folder).expect_err("nothing").to_string();
        let seen_nothing = written(StageSummary { name: "colorize".to_owned(), ..StageSummary::default() });
        assert!(error(seen_nothing.path()).contains("nothing is known"));
        assert!(error(written(StageSummary::default()).path()).contains("no colorize"));
        assert!(error(&seen_nothing.path().join("elsewhere")).contains("cannot be read"));
    }
}
