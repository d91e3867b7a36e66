//! Classes of two segmenters, point by point: two columns of the clouds of a run, or the same column of two runs.

use super::Args;
use anyhow::{Context, ensure};
use command_line::usage_error::UsageError;
use formats::ply::Vertices;
use messages::{ClassTopic, Message, class_name};
use pictures::cloud_files::cloud_files;
use scores::Confusion;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Differences that the text shows; `--json` has all.
const SHOWN_DIFFERENCES: usize = 10;
/// Classes are bytes.
const N_CLASSES: usize = 256;

/// The whole result.
#[derive(Serialize)]
pub struct ClassComparison {
    /// Whether all points of all pairs have the same class.
    pub is_equal: bool,
    pairs: Vec<Pair>,
}

/// Two columns of classes.
#[derive(Serialize)]
struct Pair {
    a: Column,
    b: Column,
    n_points: u64,
    /// Points with the same class.
    n_same: u64,
    /// Classes that at least one column has, in the order of the class table.
    classes: Vec<Class>,
    /// Points with two classes, the most frequent ones first.
    differences: Vec<Difference>,
}

/// A column and where it is.
#[derive(Clone, Serialize)]
struct Column {
    run: PathBuf,
    topic: String,
}

#[derive(Serialize)]
struct Class {
    class: &'static str,
    n_a: u64,
    n_b: u64,
    n_both: u64,
    /// Intersection over union.
    iou: f64,
}

#[derive(Serialize)]
struct Difference {
    a: &'static str,
    b: &'static str,
    n: u64,
}

impl ClassComparison {
    /// Compares the columns that the arguments name; both are in one run if no second run is given.
    pub fn from_args(args: &Args) -> anyhow::Result<Self> {
        if !args.tolerances.is_empty() {
            return Err(UsageError("--tolerance is for recordings; clouds are compared by class".to_owned()).into());
        }
        let runs = [args.a.as_path(), args.b.as_deref().unwrap_or(&args.a)];
        let files = [cloud_files(runs[0])?, cloud_files(runs[1])?];
        let names = files.each_ref().map(|files| files.iter().map(|file| file.file_name()).collect::<Vec<_>>());
        ensure!(
            names[0] == names[1] || runs.iter().all(|run| run.is_file()),
            "{} and {} have different clouds: only runs with the same submaps can be compared point by point",
            runs[0].display(),
            runs[1].display()
        );
        let first = |side: usize| load(&files[side][0]).map(|cloud| topics_of(&cloud));
        let known = if args.b.is_some() { [first(0)?, first(1)?] } else { [first(0)?, Vec::new()] };
        let topics = match args.b {
            None => columns_of_a_run(args, &known[0])?,
            Some(_) => columns_of_two_runs(args, &known)?,
        };
        let mut counts = vec![Confusion::new(N_CLASSES); topics.len()];
        for [a, b] in files[0].iter().zip(&files[1]).map(|(a, b)| [a, b]) {
            let first = load(a)?;
            let second = if args.b.is_some() { Some(load(b)?) } else { None };
            let second = second.as_ref().unwrap_or(&first);
            ensure!(
                first.len() == second.len() && first.f64s("timestamp")? == second.f64s("timestamp")?,
                "{} and {} have different points: only runs with the same submaps can be compared point by point",
                a.display(),
                b.display()
            );
            for ([topic_a, topic_b], counts) in topics.iter().zip(&mut counts) {
                let classes = [classes(&first, a, topic_a)?, classes(second, b, topic_b)?];
                classes[0].iter().zip(&classes[1]).for_each(|(a, b)| counts.add((*a).into(), (*b).into()));
            }
        }
        let column = |side: usize, topic: &String| Column { run: runs[side].to_owned(), topic: topic.clone() };
        let pairs = topics.iter().zip(&counts).map(|([a, b], counts)| Pair::new(column(0, a), column(1, b), counts));
        let pairs: Vec<Pair> = pairs.collect();
        Ok(Self { is_equal: pairs.iter().all(|pair| pair.n_same == pair.n_points), pairs })
    }

    /// Tables as text.
    pub fn text(&self) -> String {
        self.pairs.iter().map(Pair::text).collect::<Vec<_>>().join("\n")
    }
}

impl Pair {
    fn new(a: Column, b: Column, counts: &Confusion) -> Self {
        let name = |class: usize| class_name(class as u8);
        let mut classes = Vec::new();
        let mut differences = Vec::new();
        for class in 0..N_CLASSES {
            let scores = counts.class(class);
            if let Some(iou) = scores.iou {
                let n_a = scores.n_truth;
                let n_b = scores.n_predicted;
                let n_both = counts.count(class, class);
                classes.push(Class { class: name(class), n_a, n_b, n_both, iou });
            }
            let others =
                (0..N_CLASSES).filter(|other| *other != class).map(|other| (other, counts.count(class, other)));
            let others = others.filter(|(_, n)| *n > 0);
            differences.extend(others.map(|(other, n)| Difference { a: name(class), b: name(other), n }));
        }
        // Stable, so that equal counts stay in the order of the classes.
        differences.sort_by_key(|difference| std::cmp::Reverse(difference.n));
        let n_same = classes.iter().map(|class| class.n_both).sum();
        Self { a, b, n_points: counts.n(), n_same, classes, differences }
    }

    fn text(&self) -> String {
        let percent = |n: u64| 100.0 * n as f64 / self.n_points.max(1) as f64;
        let mut text = String::new();
        for (name, column) in [("a", &self.a), ("b", &self.b)] {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name}: {} of {}", column.topic, column.run.display());
        }
        let n_same = self.n_same;
        let n_points = self.n_points;
        let _ = writeln!(text, "{n_points} points, {n_same} of the same class ({:.1} %)", percent(n_same));
        let _ = writeln!(text, "\nclass              points in a      %  points in b      %      in both    IoU");
        for Class { class, n_a, n_b, n_both, iou } in &self.classes {
            let share_a = percent(*n_a);
            let share_b = percent(*n_b);
            let _ =
                writeln!(text, "{class:<16} {n_a:>13} {share_a:>6.1} {n_b:>12} {share_b:>6.1} {n_both:>12} {iou:>6.3}");
        }
        if self.differences.is_empty() {
            return text;
        }
        let _ = writeln!(text, "\nin a             in b                    points      %");
        for Difference { a, b, n } in self.differences.iter().take(SHOWN_DIFFERENCES) {
            let _ = writeln!(text, "{a:<16} {b:<16} {n:>13} {:>6.1}", percent(*n));
        }
        if self.differences.len() > SHOWN_DIFFERENCES {
            let n: u64 = self.differences[SHOWN_DIFFERENCES..].iter().map(|difference| difference.n).sum();
            let _ = writeln!(text, "{:<33} {n:>13} {:>6.1}", "others", percent(n));
        }
        text
    }
}

/// The first topic of `--topics` with each other one, or `class` with each further column.
fn columns_of_a_run(args: &Args, known: &[String]) -> anyhow::Result<Vec<[String; 2]>> {
    let topics = if args.topics.is_empty() { known } else { &args.topics };
    let [first, others @ ..] = topics else { return Err(no_classes(&args.a)) };
    if others.is_empty() {
        let run = args.a.display();
        let known = known.join(", ");
        let text = format!(
            "{run}: needs two columns of classes, its clouds have {known}; set export.further_classes, or name a second run"
        );
        return Err(UsageError(text).into());
    }
    Ok(others.iter().map(|other| [first.clone(), other.clone()]).collect())
}

/// Each topic of `--topics`, or each that both runs have, with itself.
fn columns_of_two_runs(args: &Args, known: &[Vec<String>; 2]) -> anyhow::Result<Vec<[String; 2]>> {
    let is_in_both = |topic: &&String| known[1].contains(topic);
    let both = known[0].iter().filter(is_in_both).cloned().collect();
    let topics: Vec<String> = if args.topics.is_empty() { both } else { args.topics.clone() };
    if topics.is_empty() {
        let lacks = if known[0].is_empty() { Some(&args.a) } else { args.b.as_ref() };
        return Err(no_classes(lacks.unwrap_or(&args.a)));
    }
    Ok(topics.into_iter().map(|topic| [topic.clone(), topic]).collect())
}

fn no_classes(run: &Path) -> anyhow::Error {
    anyhow::anyhow!("{}: its clouds have no classes", run.display())
}

fn load(file: &Path) -> anyhow::Result<Vertices> {
    Vertices::load(file).with_context(|| file.display().to_string())
}

/// Topics whose classes a cloud has, `class` first.
fn topics_of(cloud: &Vertices) -> Vec<String> {
    let has_score = |topic: &&str| cloud.has(&format!("{topic}_score"));
    let names = cloud.properties().iter().map(|property| property.name.as_str());
    let further = names.filter(|name| name.starts_with("class_")).filter(has_score);
    let class = cloud.has("semantic").then_some(ClassTopic::TOPIC);
    class.into_iter().chain(further).map(str::to_owned).collect()
}

fn classes(cloud: &Vertices, file: &Path, topic: &str) -> anyhow::Result<Vec<u8>> {
    let property = if topic == ClassTopic::TOPIC { "semantic" } else { topic };
    let known = || topics_of(cloud).join(", ");
    ensure!(cloud.has(property), "{}: no classes of topic {topic}; it has {}", file.display(), known());
    Ok(cloud.u8s(property)?)
}
