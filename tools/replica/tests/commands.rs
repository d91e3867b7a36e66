//! The command line: a drive is simulated, its capture converted, its clouds inspected, and public layouts imported.

use std::path::Path;
use std::process::{Command, Output};

fn replica(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_replica")).args(arguments).output().expect("starts")
}

fn succeeded(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{}: {said}", output.status);
    String::from_utf8_lossy(&output.stdout).into_owned() + &said
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

#[test]
fn a_simulated_capture_converts_into_clouds_that_can_be_inspected() {
    let folder = tempfile::tempdir().expect("a folder");
    let (drive, clouds) = (folder.path().join("drive"), folder.path().join("clouds"));
    succeeded(&replica(&["simulate", "--seed", "3", "--seconds", "0.3", "--out", text(&drive)]));
    assert!(drive.join("drive.toml").is_file());
    let again = replica(&["simulate", "--seconds", "0.3", "--out", text(&drive)]);
    assert_eq!(again.status.code(), Some(1), "what is there is not written over");

    let captures = std::fs::read_dir(drive.join("lidar")).expect("a folder");
    let capture = captures.flatten().next().expect("a capture").path();
    let table = succeeded(&replica(&["convert", text(&capture), text(&clouds)]));
    assert!(table.contains("revolution"), "{table}");
    let n_clouds = std::fs::read_dir(&clouds).expect("a folder").count();
    assert!(n_clouds >= 3, "three tenths of a second are three revolutions and a rest, not {n_clouds}");

    let picture = folder.path().join("picture.png");
    let table = succeeded(&replica(&["inspect", text(&clouds), "--picture", text(&picture), "--by", "intensity"]));
    assert!(table.contains("points"), "{table}");
    let png = std::fs::read(&picture).expect("a picture");
    assert!(png.starts_with(b"\x89PNG") && png.len() > 10_000, "{} bytes", png.len());
}

#[test]
fn what_is_no_capture_is_refused_with_its_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("letter.pcap");
    std::fs::write(&path, "Dear reader").expect("written");
    let output = replica(&["convert", text(&path), text(&folder.path().join("out"))]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("letter.pcap"));
}

#[test]
fn imported_sweeps_are_linked_and_not_copied() {
    let folder = tempfile::tempdir().expect("a folder");
    let (source, drive) = (folder.path().join("velodyne"), folder.path().join("drive"));
    std::fs::create_dir(&source).expect("made");
    for name in ["000000.bin", "000001.bin"] {
        let point = [5.0_f32, 1.0, -1.0, 0.5].map(f32::to_le_bytes).concat();
        std::fs::write(source.join(name), point.repeat(100)).expect("written");
    }
    succeeded(&replica(&["import", text(&source), text(&drive)]));
    assert!(drive.join("drive.toml").is_file());
    let lidar = std::fs::read_dir(drive.join("lidar")).expect("a folder").flatten();
    let links = lidar.filter(|entry| entry.path().is_symlink()).count();
    assert_eq!(links, 2);
}
