//! Whether the result can be relied on, in five lines.

use super::finished_run::FinishedRun;
use doubts::{DoubtKind, Severity, Subject};
use page::{Level, grouped};
use run::health::ReportedDoubt;
use run::{Outcome, exit};
use serde::{Serialize, Serializer};

/// The levels of all subjects.
#[derive(Debug, Serialize)]
pub struct Verdict {
    /// The worst level of all subjects.
    #[serde(serialize_with = "word")]
    pub level: Level,
    /// Exit code of `replica-launch`, not regarding a recording.
    pub exit_code: u8,
    pub n_doubts: usize,
    pub findings: Vec<Finding>,
}

/// One subject.
#[derive(Debug, Serialize)]
pub struct Finding {
    #[serde(serialize_with = "word")]
    pub level: Level,
    pub subject: &'static str,
    /// The doubts, or a summary of the data.
    pub text: String,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde asks for")]
fn word<S: Serializer>(level: &Level, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(level.word())
}

/// The subject of a doubt. A name that a third-party stage uses as well has the subject of that stage.
fn subject_of(stage: &str, doubt: &ReportedDoubt) -> Subject {
    let kind = doubt.kind().filter(|kind| kind.stage().name() == stage);
    kind.map_or_else(|| Subject::from_stage(stage), DoubtKind::subject)
}

fn level_of_doubt(doubt: &ReportedDoubt) -> Level {
    match doubt.kind().map(DoubtKind::severity) {
        Some(Severity::Empty) => Level::Red,
        Some(Severity::Check | Severity::Unplaced) | None => Level::Amber,
    }
}

fn title(subject: Subject) -> &'static str {
    match subject {
        Subject::Run => "Run",
        Subject::Input => "Input",
        Subject::Place => "Path and place",
        Subject::Color => "Color and spectra",
        Subject::Classes => "Classes and instances",
    }
}

impl Verdict {
    /// Verdict on a run.
    pub fn from_run(run: &FinishedRun) -> Self {
        let exit_code = run.summary.exit_code(run.is_live());
        let findings: Vec<Finding> = Subject::ALL.map(|subject| finding(run, subject, exit_code)).into();
        let level = findings.iter().map(|finding| finding.level).max().unwrap_or(Level::Green);
        Self { level, exit_code, n_doubts: run.summary.doubts().count(), findings }
    }

    /// The verdict in one line.
    pub fn title(&self) -> &'static str {
        match (self.level, self.exit_code) {
            (Level::Green, _) => "Consistent: no stage doubts its result",
            (Level::Amber, _) => "Complete, with doubts: see the lines in orange",
            (Level::Red, exit::FAILED) => "The run has failed",
            (Level::Red, _) => "There is no result",
        }
    }
}

fn finding(run: &FinishedRun, subject: Subject, exit_code: u8) -> Finding {
    let doubts: Vec<_> = run.summary.doubts().filter(|(stage, doubt)| subject_of(stage, doubt) == subject).collect();
    let mut texts: Vec<String> = doubts.iter().map(|(_, doubt)| doubt.text.clone()).collect();
    let mut level = doubts.iter().map(|(_, doubt)| level_of_doubt(doubt)).max().unwrap_or(Level::Green);
    match subject {
        Subject::Run => {
            level = level.max(level_of_run(run, exit_code));
            texts.insert(0, text_of_run(run));
        }
        _ if !texts.is_empty() => {}
        Subject::Input => texts.push(text_of_input(run)),
        Subject::Place => texts.push(text_of_place(run)),
        Subject::Color => texts.push(text_of_color(run)),
        Subject::Classes => texts.push(text_of_classes(run)),
    }
    Finding { level, subject: title(subject), text: texts.join("; ") }
}

fn level_of_run(run: &FinishedRun, exit_code: u8) -> Level {
    let total = &run.summary.total;
    match exit_code {
        exit::FAILED => Level::Red,
        _ if total.points == 0 => Level::Red,
        // Doubts of stages have their own lines.
        exit::INCOMPLETE if run.summary.outcome == Outcome::Drained || !total.dropped.is_empty() => Level::Amber,
        exit::INCOMPLETE if run.is_live() && !run.summary.faults.is_empty() => Level::Amber,
        _ => Level::Green,
    }
}

fn text_of_run(run: &FinishedRun) -> String {
    let total = &run.summary.total;
    let how = match run.summary.outcome {
        Outcome::Done if run.is_live() => "ended on request or with the sensors".to_owned(),
        Outcome::Done => "the whole drive was processed".to_owned(),
        Outcome::Drained => "ended early on request".to_owned(),
        Outcome::Failed => {
            format!("failed: {}", run.summary.faults.last().map_or("no fault was recorded", String::as_str))
        }
        Outcome::Stopped => Outcome::Stopped.to_string(),
    };
    let counted = |n: u64, what: &str| if n > 0 { format!(", {n} {what}") } else { String::new() };
    format!(
        "{how}: {:.1} s of drive in {:.1} s, {} points{}{}",
        total.drive_s,
        total.wall_s,
        grouped(total.points),
        counted(u64::from(total.restarts), "restarts"),
        counted(total.dropped.values().sum(), "messages dropped")
    )
}

fn text_of_input(run: &FinishedRun) -> String {
    let sources = run.summary.stages.iter().filter(|stage| stage.inputs.is_empty());
    let topics: Vec<String> = sources
        .flat_map(|stage| &stage.outputs)
        .filter(|(_, traffic)| traffic.messages > 0)
        .map(|(topic, traffic)| format!("{topic} {}", grouped(traffic.messages)))
        .collect();
    if topics.is_empty() { "nothing was read".to_owned() } else { format!("messages: {}", topics.join(", ")) }
}

fn text_of_place(run: &FinishedRun) -> String {
    let length_m = run.trajectory.length_m();
    let deviations = run.georeference.as_ref().and_then(|found| found.standard_deviations.as_ref());
    match deviations {
        Some(deviations) if run.has_north() => format!(
            "path of {length_m:.0} m; standard deviations up to {:.2} m horizontally, {:.2} m in height, {:.2} degrees in heading",
            deviations.position_m.largest, deviations.height_m.largest, deviations.heading_deg.largest
        ),
        _ if run.trajectory.poses().is_empty() => "no path".to_owned(),
        _ => format!(
            "path of {length_m:.0} m in a local frame: no fixes place it on the earth, and its heading is relative to the start"
        ),
    }
}

fn text_of_color(run: &FinishedRun) -> String {
    let clouds = run.index.iter().flat_map(|index| &index.clouds);
    let n_points: u64 = clouds.clone().map(|cloud| cloud.n_points).sum();
    let n_colored: u64 = clouds.clone().filter_map(|cloud| cloud.n_colored).sum();
    let n_spectra: u64 = clouds.filter_map(|cloud| cloud.spectra.as_ref()).map(|spectra| spectra.n_spectra).sum();
    if n_colored + n_spectra == 0 {
        return "no point has a color or a spectrum: there are no camera images".to_owned();
    }
    let percent = 100.0 * n_colored as f64 / n_points.max(1) as f64;
    format!("{percent:.1} % of the points have a color, {} have a spectrum", grouped(n_spectra))
}

fn text_of_classes(run: &FinishedRun) -> String {
    let clouds = || run.index.iter().flat_map(|index| &index.clouds);
    let n_classified: u64 =
        clouds().filter_map(|cloud| cloud.classes.as_ref()).flat_map(|classes| classes.values()).sum();
    if n_classified == 0 {
        return "the points were not classified".to_owned();
    }
    let has_instances = clouds().any(|cloud| cloud.n_instances.is_some());
    let n_instances = run.n_instances();
    let instances = if has_instances { format!(", {n_instances} instances") } else { String::new() };
    format!("{} points have a class{instances}", grouped(n_classified))
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::summary::{StageSummary, Summary};

    fn verdict(outcome: Outcome, doubts: &[(&str, &str)]) -> Verdict {
        let stage = |(stage, name): &(&str, &str)| StageSummary {
            name: (*stage).to_owned(),
            doubts: vec![ReportedDoubt { name: (*name).to_owned(), size: 1.0, text: format!("text of {name}") }],
            ..StageSummary::default()
        };
        let stages = doubts.iter().map(stage).collect();
        let mut summary = Summary { outcome, stages, ..Summary::default() };
        summary.total.points = 7;
        Verdict::from_run(&FinishedRun::from_summary(summary))
    }

    fn level(verdict: &Verdict, subject: &str) -> Level {
        verdict.findings.iter().find(|finding| finding.subject == subject).expect("is there").level
    }

    #[test]
    fn verdict_is_the_worst_of_its_five_subjects() {
        let done = verdict(Outcome::Done, &[]);
        assert_eq!((done.level, done.exit_code, done.findings.len()), (Level::Green, 0, 5));
        assert_eq!((verdict(Outcome::Drained, &[]).level, verdict(Outcome::Drained, &[]).exit_code), (Level::Amber, 3));
        assert_eq!((verdict(Outcome::Failed, &[]).level, verdict(Outcome::Failed, &[]).exit_code), (Level::Red, 1));
        let empty = verdict(Outcome::Done, &[("export", "no_points"), ("infer", "points_unseen")]);
        assert_eq!((empty.level, empty.exit_code, empty.n_doubts), (Level::Red, 3, 2));
    }

    #[test]
    fn doubt_is_shown_at_its_subject_alone() {
        for (stage, doubt, subject) in [
            ("acquire", "cut_captures", "Input"),
            ("slam_aggregate", "path_lost", "Path and place"),
            ("export", "heading_undetermined", "Path and place"),
            ("colorize", "images_unused", "Color and spectra"),
            ("instance", "a", "Classes and instances"),
            ("export", "lost_columns", "Run"),
            ("stage_of_others", "b", "Run"),
        ] {
            let verdict = verdict(Outcome::Done, &[(stage, doubt)]);
            assert_eq!((verdict.level, level(&verdict, subject)), (Level::Amber, Level::Amber), "{doubt}");
            let with_text =
                verdict.findings.iter().filter(|finding| finding.text.contains(&format!("text of {doubt}")));
            assert_eq!(with_text.map(|finding| finding.subject).collect::<Vec<_>>(), [subject]);
            assert_eq!(verdict.findings.iter().filter(|finding| finding.level > Level::Green).count(), 1, "{doubt}");
        }
    }
}
