//! `replica-lab evaluate instances`: scores the instances of all clouds of a run together. An object that changes its id from one
//! submap to the next counts as a miss and a false positive.

use crate::true_points::TruePoints;
use anyhow::{Context, bail, ensure};
use command_line::answer::Answer;
use command_line::exit_code;
use command_line::say_error;
use drive::{Drive, MANIFEST_FILE, NoLabel};
use formats::ply::Vertices;
use messages::ClassId;
use pictures::cloud_files::cloud_files;
use scores::{InstanceScores, Overlaps, PointLabel};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Score instances: SM, PQ, SQ, RQ and mIoU of each class.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done, but some points have no ground truth\n\n\
                  Example: replica-lab evaluate instances drives/sample out/sample")]
pub struct Args {
    /// Drive folder with labels, or clouds with the same points in the same order
    truth: PathBuf,
    /// Output folder of a run or a PLY file, with the fields semantic and instance
    prediction: PathBuf,
    /// Classes to score
    #[arg(long, value_delimiter = ',', default_value = "vehicles,pedestrian")]
    classes: Vec<ClassId>,
    /// True instances with fewer points, over all clouds, are ignored
    #[arg(long, value_name = "N", default_value_t = 100)]
    min_points: u64,
    #[command(flatten)]
    answer: Answer,
}

/// Prints the table.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let ComparedPoints { mut overlaps, n_unknown } = overlaps(&args.truth, &args.prediction)?;
    let void = ClassId::Unlabeled as u8;
    let scores = args.classes.iter().map(|&class| overlaps.score(class as u8, void, args.min_points));
    let scores: Vec<InstanceScores> = scores.collect();
    args.answer.print(&json!({"classes": facts(&scores), "points_without_truth": n_unknown}), || table(&scores))?;
    if n_unknown == 0 {
        return Ok(ExitCode::SUCCESS);
    }
    say_error!("{n_unknown} points have no ground truth and were ignored");
    Ok(ExitCode::from(exit_code::INCOMPLETE))
}

/// All points of a run.
struct ComparedPoints {
    overlaps: Overlaps,
    /// Number of points without truth.
    n_unknown: u64,
}

fn overlaps(truth: &Path, prediction: &Path) -> anyhow::Result<ComparedPoints> {
    let mut overlaps = Overlaps::default();
    let mut n_unknown = 0;
    let predicted_files = cloud_files(prediction)?;
    if truth.join(MANIFEST_FILE).is_file() {
        let mut labels = TruePoints::open(Drive::open(truth)?)?;
        for file in &predicted_files {
            let cloud = Vertices::load(file)?;
            let truth = labels.labels_of(&cloud).with_context(|| file.display().to_string())?;
            for (predicted, truth) in point_labels(&cloud, file)?.into_iter().zip(truth) {
                match truth {
                    Ok(truth) => {
                        overlaps.add(truth, predicted);
                    }
                    Err(NoLabel::UnlabeledSweep) => {}
                    Err(_) => n_unknown += 1,
                }
            }
        }
        return Ok(ComparedPoints { overlaps, n_unknown });
    }
    let true_files = cloud_files(truth)?;
    let n_true = true_files.len();
    let n_predicted = predicted_files.len();
    ensure!(n_true == n_predicted, "{n_true} true clouds, but {n_predicted} predicted clouds");
    for (true_file, file) in true_files.iter().zip(&predicted_files) {
        let truth = point_labels(&Vertices::load(true_file)?, true_file)?;
        let predicted = point_labels(&Vertices::load(file)?, file)?;
        let n_true = truth.len();
        let n_points = predicted.len();
        ensure!(n_true == n_points, "{}: {n_points} points, but {n_true} in the truth", file.display());
        truth.into_iter().zip(predicted).for_each(|(truth, predicted)| overlaps.add(truth, predicted));
    }
    Ok(ComparedPoints { overlaps, n_unknown })
}

/// Class and instance of each point of a cloud.
fn point_labels(cloud: &Vertices, file: &Path) -> anyhow::Result<Vec<PointLabel>> {
    let instances = cloud.i64s("instance")?;
    let label = |(class, (point_idx, instance)): (u8, (usize, i64))| match u32::try_from(instance) {
        Ok(instance) => Ok(PointLabel { class, instance }),
        Err(_) => bail!("{}: instance of point {point_idx} is {instance}; must be 0 to 2^32 - 1", file.display()),
    };
    cloud.u8s("semantic")?.into_iter().zip(instances.into_iter().enumerate()).map(label).collect()
}

/// An object per class.
pub fn facts(scores: &[InstanceScores]) -> Value {
    let of_class = |score: &InstanceScores| {
        json!({
            "class": messages::class_name(score.class), "true": score.n_true, "found": score.n_predicted,
            "sm": score.sm(), "pq": score.pq(), "sq": score.sq(), "rq": score.rq(), "miou": score.miou(),
        })
    };
    scores.iter().map(of_class).collect()
}

/// A line per class.
pub fn table(scores: &[InstanceScores]) -> String {
    let mut text =
        "| class | true | found | SM % | PQ % | SQ % | RQ % | mIoU % |\n|---|---|---|---|---|---|---|---|\n".to_owned();
    for score in scores {
        let shares = [score.sm(), score.pq(), score.sq(), score.rq(), score.miou()];
        let shares = shares.map(|share| if share.is_nan() { "-".to_owned() } else { format!("{:.2}", 100.0 * share) });
        let class = messages::class_name(score.class);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {class} | {} | {} | {} |", score.n_true, score.n_predicted, shares.join(" | "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::ply::{Header, Kind, PlyWriter, Row};

    fn write_cloud(path: &Path, labels: &[(u8, i32)]) {
        let header = Header::new([("x", Kind::Float), ("semantic", Kind::UChar), ("instance", Kind::Int)]);
        let mut writer = PlyWriter::create(path, &header, labels.len()).expect("creates");
        let encode = |i: usize, row: &mut Row<'_>| {
            row.f32(0.0).u8(labels[i].0).i32(labels[i].1);
        };
        writer.write_each(labels.len(), encode).expect("writes");
        writer.finish().expect("finishes");
    }

    #[test]
    fn clouds_are_scored_together_and_mismatches_are_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        let truth = folder.path().join("truth");
        let found = folder.path().join("found");
        for (name, n) in [("a", 6), ("b", 4)] {
            for (side, id) in [(&truth, 3), (&found, 7)] {
                std::fs::create_dir_all(side).expect("made");
                write_cloud(&side.join(format!("{name}.ply")), &[vec![(10, id); n], vec![(7, 0); 5]].concat());
            }
        }
        let ComparedPoints { mut overlaps, n_unknown } = overlaps(&truth, &found).expect("compares");
        let score = overlaps.score(10, 0, 10);
        assert_eq!((score.n_true, score.matches.as_slice(), n_unknown), (1, [1.0].as_slice(), 0));
        assert!(table(&[score]).contains("| vehicles | 1 | 1 | 100.00 | 100.00 |"));

        write_cloud(&found.join("b.ply"), &[(10, 3)]);
        let error = super::overlaps(&truth, &found).err().expect("differs in length").to_string();
        assert!(error.contains("b.ply: 1 points, but 9 in the truth"), "{error}");
        write_cloud(&found.join("b.ply"), &[(10, -3)]);
        let error = super::overlaps(&truth, &found).err().expect("is negative").to_string();
        assert!(error.contains("instance of point 0 is -3"), "{error}");
    }
}
