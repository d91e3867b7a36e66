use super::*;
use crate::bench::machine::Machine;
use random::Random;
use run::health::{Latency, Traffic};
use run::summary::{StageSummary, Total};
use std::path::Path;

/// What a synthetic report is made from.
#[derive(Clone, Copy)]
struct Build {
    runs: usize,
    /// Processor time of the stage `infer`, s; the other figures of the run follow from it.
    infer_s: f64,
    /// Standard deviation of all times, as a share.
    noise: f64,
    seed: u64,
    /// Points of the drive.
    points: u64,
}

const BUILD: Build = Build { runs: 5, infer_s: 20.0, noise: 0.01, seed: 1, points: 6_000_000 };

fn summary(build: &Build, random: &mut Random) -> Summary {
    let mut time = |seconds: f64| seconds * (1.0 + build.noise * f64::from(random.gauss()));
    let traffic = Traffic { messages: 120, rows: build.points, bytes: build.points * 20, ..Traffic::default() };
    let acquire = StageSummary {
        name: "acquire".to_owned(),
        outputs: [("sweep".to_owned(), traffic)].into(),
        cpu_s: time(3.0),
        ..StageSummary::default()
    };
    let infer_s = time(build.infer_s);
    let infer = StageSummary {
        name: "infer".to_owned(),
        cpu_s: infer_s,
        points: build.points,
        step: Latency { p50_ms: time(build.infer_s * 10.0), p99_ms: time(build.infer_s * 14.0), ..Latency::default() },
        peak_private_bytes: time(300e6) as u64,
        read_bytes: 5_000_000,
        ..StageSummary::default()
    };
    let wall_s = time(infer_s);
    let total = Total {
        drive_s: 12.0,
        wall_s,
        points: build.points,
        points_per_s: build.points as f64 / wall_s,
        cpu_s: acquire.cpu_s + infer.cpu_s,
        ..Total::default()
    };
    Summary { total, stages: vec![acquire, infer], ..Summary::default() }
}

fn report(build: Build) -> NamedReport {
    let mut random = Random::new(build.seed);
    let runs = (0..build.runs).map(|_| summary(&build, &mut random)).collect();
    let series = vec![Series { configuration: Configuration { cores: 2 }, runs }];
    let machine = Machine { load: 0.0, ..Machine::detect(Path::new("launch.toml")) };
    let report = Report::new(Path::new("launch.toml"), build.runs as u32, machine, series);
    // The file is what is compared.
    let bytes = serde_json::to_vec(&report).expect("JSON");
    NamedReport { name: format!("{}.json", build.seed), report: serde_json::from_slice(&bytes).expect("a report") }
}

fn worse(comparison: &Comparison) -> Vec<(Option<&str>, &str)> {
    let rows = comparison.rows.iter().filter(|row| row.verdict == Verdict::Worse);
    rows.map(|row| (row.stage.as_deref(), row.figure)).collect()
}

#[test]
fn slower_stage_is_a_regression_in_its_rows_and_in_the_run() {
    let slower = Build { infer_s: 23.0, seed: 2, ..BUILD };
    let found = compare(&report(BUILD), &report(slower), 5.0).expect("comparable");
    let expected = [
        (None, "wall, s"),
        (None, "M points/s"),
        (None, "processor, s"),
        (Some("infer"), "processor, s"),
        (Some("infer"), "step p50, ms"),
        (Some("infer"), "step p99, ms"),
    ];
    assert_eq!(worse(&found), expected, "{}", found.text());
    assert!(found.has_regression());
    assert!(
        found.text().contains("| 2 | infer | processor, s |") && found.text().contains("**worse**"),
        "{}",
        found.text()
    );
    // The other direction is not a regression.
    let back = compare(&report(slower), &report(BUILD), 5.0).expect("comparable");
    assert!(!back.has_regression() && back.text().contains("0 worse, 6 better"), "{}", back.text());
    // Nor is it one within a limit of 20 %.
    assert!(!compare(&report(BUILD), &report(slower), 20.0).expect("comparable").has_regression());
}

#[test]
fn noise_is_not_a_regression_and_is_named() {
    let mut n_noise = 0;
    for seed in 10..60 {
        let noisy = |seed| report(Build { noise: 0.08, seed, ..BUILD });
        let found = compare(&noisy(seed), &noisy(seed + 1000), 5.0).expect("comparable");
        assert!(!found.has_regression(), "seed {seed}: {}", found.text());
        n_noise += found.rows.iter().filter(|row| row.verdict == Verdict::Noise).count();
    }
    // Medians of such runs often differ by more than 5 %: the limit alone would report them.
    assert!(n_noise > 50, "{n_noise}");
}

/// Share of the comparisons of equal builds in which a figure with 10 % of normal noise is worse.
fn share_of_false_alarms(n_runs: usize) -> f64 {
    let mut random = Random::new(11);
    let mut interval =
        || Interval::from_values((0..n_runs).map(|_| 100.0 * (1.0 + 0.1 * f64::from(random.gauss()))).collect());
    let figure = Figure { name: "wall, s", better: Better::Lower, floor: 0.0 };
    let n_worse = (0..20_000).filter(|_| verdict(&interval(), &interval(), &figure, 5.0) == Verdict::Worse).count();
    n_worse as f64 / 20_000.0
}

#[test]
fn false_alarms_are_rarer_with_more_runs() {
    let [three, five, nine] = [3, 5, 9].map(share_of_false_alarms);
    // The documentation of `verdict` states them.
    assert!((0.015..0.025).contains(&three), "{three}");
    assert!((0.0001..0.002).contains(&five), "{five}");
    assert!(nine < 0.002, "{nine}");
}

#[test]
fn regression_is_found_in_noise_with_more_runs() {
    let noisy = |infer_s, seed| report(Build { runs: 15, noise: 0.05, infer_s, seed, ..BUILD });
    let found = compare(&noisy(20.0, 3), &noisy(23.0, 4), 5.0).expect("comparable");
    assert!(worse(&found).contains(&(Some("infer"), "processor, s")), "{}", found.text());
}

#[test]
fn two_runs_are_refused_with_the_number_that_is_needed() {
    let error = compare(&report(BUILD), &report(Build { runs: 2, seed: 7, ..BUILD }), 5.0).expect_err("refused");
    assert_eq!(
        error.to_string(),
        "7.json: 2 runs with 2 cores: a median needs at least 3; measure again with --runs 5"
    );
}

#[test]
fn reports_of_other_drives_stages_or_cores_are_refused() {
    let refusal = |other: NamedReport| compare(&report(BUILD), &other, 5.0).expect_err("refused").to_string();
    let other_drive = refusal(report(Build { points: 7_000_000, seed: 2, ..BUILD }));
    assert!(other_drive.contains("different drives: 1.json read 12.0 s with 6000000 points"), "{other_drive}");
    let mut other = report(BUILD);
    other.report.series[0].runs.iter_mut().for_each(|run| run.stages[1].name = "label".to_owned());
    let other_stages = refusal(other);
    assert!(other_stages.contains("1.json has acquire, infer, 1.json has acquire, label"), "{other_stages}");
    let mut other = report(BUILD);
    other.report.series[0].configuration.cores = 64;
    let other_cores = refusal(other);
    assert!(other_cores.contains("1.json has 2 cores, 1.json has 64 cores"), "{other_cores}");
    let mut other = report(BUILD);
    other.report.series[0].runs[2] = summary(&Build { points: 1, ..BUILD }, &mut Random::new(1));
    let mixed = refusal(other);
    assert!(mixed.contains("runs 1 and 3 with 2 cores read different data"), "{mixed}");
}

#[test]
fn other_machines_are_compared_with_a_note() {
    let mut other = report(BUILD);
    other.report.machine.cpu = "a faster one".to_owned();
    other.report.machine.load = 3.5;
    let found = compare(&report(BUILD), &other, 5.0).expect("comparable");
    assert_eq!(found.notes.len(), 2, "{:?}", found.notes);
    assert!(found.notes[0].ends_with("a faster one in B"), "{:?}", found.notes);
    assert_eq!(found.notes[1], "B was measured on a busy machine: load 3.50 before its first run");
}
