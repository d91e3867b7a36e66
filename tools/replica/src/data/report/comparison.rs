//! Several runs in one table.

use super::facts::Points;
use super::finished_run::FinishedRun;
use super::verdict::Verdict;
use page::{Level, Page, Table, grouped};
use run::Outcome;
use run::summary::{REPORT_FILES, Total};
use serde::Serialize;
use std::path::PathBuf;

/// `comparison.json`.
#[derive(Serialize)]
pub struct Comparison {
    /// Version of this file format.
    pub version: u32,
    pub runs: Vec<ComparedRun>,
}

/// A row of the table.
#[derive(Serialize)]
pub struct ComparedRun {
    pub run: PathBuf,
    pub outcome: Outcome,
    pub verdict: Verdict,
    pub path_m: f64,
    /// Largest standard deviation of a submap: horizontal (m), height (m), heading (degrees). `None` without an origin on the
    /// earth.
    pub deviations: Option<[f64; 3]>,
    pub points: Points,
    pub instances: u64,
    pub total: Total,
}

impl ComparedRun {
    pub fn from_run(run: &FinishedRun) -> Self {
        let georeference = run.georeference.as_ref().filter(|_| run.has_north());
        let deviations = georeference.and_then(|found| found.standard_deviations.as_ref());
        Self {
            run: run.folder.clone(),
            outcome: run.summary.outcome,
            verdict: Verdict::from_run(run),
            path_m: run.trajectory.length_m(),
            deviations: deviations
                .map(|found| [found.position_m.largest, found.height_m.largest, found.heading_deg.largest]),
            points: Points::from_run(run, None),
            instances: run.n_instances(),
            total: run.summary.total.clone(),
        }
    }
}

impl Comparison {
    /// The page.
    pub fn page(&self) -> String {
        let mut page = Page::new(&format!("{} runs", self.runs.len()));
        let headings = [
            "run",
            "exit code",
            "drive, s",
            "path, m",
            "times real time",
            "million points",
            "colored",
            "spectra",
            "instances",
            "deviation, m",
            "height, m",
            "heading, °",
            "restarts",
            "doubts",
        ];
        let mut table = Table::new(&headings, 1);
        for run in &self.runs {
            table.row_of(run.verdict.level, run.cells());
        }
        page.table(&table);
        page.remark("Deviations: largest standard deviation of a submap: horizontal, height, heading.");
        page.section("Verdicts");
        for run in &self.runs {
            page.subsection(&run.run.display().to_string());
            let findings = run.verdict.findings.iter().filter(|finding| finding.level > Level::Green);
            let lines: Vec<String> = findings.map(|finding| format!("{}: {}", finding.subject, finding.text)).collect();
            page.notice(run.verdict.level, run.verdict.title(), lines);
            let report = run.run.join(REPORT_FILES[0]);
            if report.is_file() {
                page.remark(&report.display().to_string());
            }
        }
        page.section("Classes");
        page.table(&self.classes());
        page.finish()
    }

    /// Share of each class in each run.
    fn classes(&self) -> Table {
        let mut names: Vec<&String> = self.runs.iter().flat_map(|run| run.points.classes.keys()).collect();
        names.sort();
        names.dedup();
        let folders: Vec<String> = self.runs.iter().map(|run| run.run.display().to_string()).collect();
        let headings: Vec<&str> = std::iter::once("class").chain(folders.iter().map(String::as_str)).collect();
        let mut table = Table::new(&headings, 1);
        for name in names {
            let share = |run: &ComparedRun| {
                let n_all: u64 = run.points.classes.values().sum();
                let n = run.points.classes.get(name).copied().unwrap_or_default();
                if n_all == 0 { "-".to_owned() } else { format!("{:.2} %", 100.0 * n as f64 / n_all as f64) }
            };
            table.row(std::iter::once(name.clone()).chain(self.runs.iter().map(share)));
        }
        table
    }
}

impl ComparedRun {
    fn cells(&self) -> Vec<String> {
        let total = &self.total;
        let colored = self.points.n_colored.map(|n| 100.0 * n as f64 / self.points.n.max(1) as f64);
        let deviation = |k: usize| self.deviations.map_or("-".to_owned(), |found| format!("{:.2}", found[k]));
        let n_doubts = self.verdict.n_doubts;
        vec![
            self.run.display().to_string(),
            self.verdict.exit_code.to_string(),
            format!("{:.1}", total.drive_s),
            format!("{:.1}", self.path_m),
            format!("{:.2}", total.times_real_time),
            format!("{:.2}", total.points as f64 * 1e-6),
            colored.map_or("-".to_owned(), |percent| format!("{percent:.1} %")),
            grouped(self.points.n_spectra),
            self.instances.to_string(),
            deviation(0),
            deviation(1),
            deviation(2),
            total.restarts.to_string(),
            n_doubts.to_string(),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::summary::Summary;

    #[test]
    fn each_run_has_a_row_and_its_name_is_escaped() {
        let run = |name: &str, outcome: Outcome| {
            let mut run = FinishedRun::from_summary(Summary { outcome, ..Summary::default() });
            run.folder = name.into();
            run.summary.total.points = 1_230_000;
            ComparedRun::from_run(&run)
        };
        let comparison =
            Comparison { version: 1, runs: vec![run("out/<a>", Outcome::Done), run("out/b", Outcome::Failed)] };
        let page = comparison.page();
        assert!(page.contains("<tr class=\"green\"><td>out/&lt;a&gt;</td>") && !page.contains("<a>"), "{page}");
        assert!(page.contains("<tr class=\"red\"><td>out/b</td><td class=\"n\">1</td>"), "{page}");
        assert_eq!(page.matches(">1.23</td>").count(), 2, "{page}");
    }
}
