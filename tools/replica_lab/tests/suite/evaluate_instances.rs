//! `replica-lab evaluate instances` on a drive with labels and on clouds as a run writes them.

use crate::returns::Returns;
use crate::support::{printed, replica_lab, simulate, text};
use messages::ClassId;
use simulation::DriveSpec;
use std::path::Path;
use std::process::Output;

/// Class, number of true and of predicted instances, and SM of each line of the table.
fn lines(table: &str) -> Vec<(String, u32, u32, String)> {
    let cells = |line: &str| line.trim_matches(['|', ' ']).split('|').map(|cell| cell.trim().to_owned()).collect();
    let line = |cells: Vec<String>| {
        let number = |idx: usize| cells[idx].parse().expect("a count");
        (cells[0].clone(), number(1), number(2), cells[3].clone())
    };
    table.lines().skip(2).map(cells).map(line).collect()
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn true_labels_score_100_and_errors_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = folder.path().join("drive");
    let run = folder.path().join("run");
    simulate(&DriveSpec::urban(1, 0.3), &drive);
    let mut returns = Returns::read(&drive);
    returns.write(&run.join("clouds/00000.ply"));

    let evaluate = |run: &Path, more: &[&str]| {
        replica_lab(&[&["evaluate", "instances", text(&drive), text(run)][..], more].concat())
    };
    let table = |output: &Output| {
        assert_eq!(output.status.code(), Some(0), "{}", printed(output));
        lines(&String::from_utf8_lossy(&output.stdout))
    };
    let full = table(&evaluate(&run, &["--min-points", "5", "--classes", "pedestrian"]));
    let n_people = full[0].1;
    assert!(n_people >= 1, "the street has people");
    assert_eq!(full, [("pedestrian".to_owned(), n_people, n_people, "100.00".to_owned())]);

    // All people in one instance: at most the one that is larger than all others together is matched.
    returns.0.iter_mut().filter(|row| row.2 == ClassId::Pedestrian as u8).for_each(|row| row.3 = 9);
    let joined = folder.path().join("joined.ply");
    returns.write(&joined);
    let one = table(&evaluate(&joined, &["--min-points", "5", "--classes", "pedestrian"]));
    assert!(one[0].2 <= 1 && one[0].1 == n_people, "{one:?}");

    // A return at a time without returns in the drive.
    returns.0[0].0 += 1000.0;
    let odd = folder.path().join("odd.ply");
    returns.write(&odd);
    let output = evaluate(&odd, &[]);
    assert_eq!(output.status.code(), Some(3), "{}", printed(&output));
    assert!(printed(&output).contains("1 points have no ground truth"), "{}", printed(&output));

    let output = evaluate(&run, &["--classes", "vehicles,cars"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(printed(&output).contains("unknown class \"cars\""), "{}", printed(&output));
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).expect("made");
    let output = evaluate(&empty, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(printed(&output).contains("no clouds (*.ply)"), "{}", printed(&output));
    std::fs::remove_dir_all(drive.join("truth")).expect("removed");
    let output = evaluate(&run, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(printed(&output).contains("labels"), "{}", printed(&output));
}
