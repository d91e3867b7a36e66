//! `replica evaluate instances` and `replica instances` on a drive with labels and on clouds like those of a run.

use crate::support::{printed, replica, text};
use drive::{Drive, Shot};
use formats::ply::{Header, Kind, PlyWriter, Row};
use messages::ClassId;
use std::path::Path;
use std::process::Output;

/// The returns of a drive: time, ring, class and instance.
struct Returns(Vec<(f64, u8, u8, i32)>);

impl Returns {
    fn of(drive: &Path) -> Self {
        let drive = Drive::open(drive).expect("opens");
        let labels = drive.true_labels().expect("has labels");
        let mut source = drive.sweeps().expect("opens");
        let mut all = Vec::new();
        loop {
            let mut returns = Vec::new();
            let Some(sweep) = source.next_sweep(|found| returns.extend_from_slice(found)).expect("reads") else {
                return Self(all);
            };
            for found in returns {
                let nanos = sweep.stamp.0 + i64::from(found.offset_nanos);
                let shot = Shot { stamp: nanos, ring: found.ring, azimuth: Some(found.azimuth), range_m: None };
                let label = labels.find(&shot).expect("every return has a label");
                all.push((nanos as f64 * 1e-9, found.ring, label.class, i32::from(label.instance)));
            }
        }
    }

    /// Writes the fields of `replica-export` that the commands read.
    fn write(&self, path: &Path) {
        let columns = [
            ("x", Kind::Float),
            ("y", Kind::Float),
            ("z", Kind::Float),
            ("timestamp", Kind::Double),
            ("ring", Kind::UChar),
            ("semantic", Kind::UChar),
            ("instance", Kind::Int),
        ];
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        let mut writer = PlyWriter::create(path, &Header::new(columns), self.0.len()).expect("creates");
        let encode = |i: usize, row: &mut Row<'_>| {
            let (time_s, ring, class, instance) = self.0[i];
            row.f32(i as f32 * 0.001).f32(0.0).f32(f32::from(ring)).f64(time_s).u8(ring).u8(class).i32(instance);
        };
        writer.write_each(self.0.len(), encode).expect("writes");
        writer.finish().expect("finishes");
    }
}

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
fn true_labels_score_100_and_errors_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let (drive, run) = (folder.path().join("drive"), folder.path().join("run"));
    let simulated = replica(&["simulate", "--seed", "1", "--seconds", "0.3", "--out", text(&drive)]);
    assert!(simulated.status.success(), "{}", printed(&simulated));
    let mut returns = Returns::of(&drive);
    returns.write(&run.join("clouds/00000.ply"));

    let evaluate =
        |run: &Path, more: &[&str]| replica(&[&["evaluate", "instances", text(&drive), text(run)][..], more].concat());
    let table = |output: &Output| {
        assert_eq!(output.status.code(), Some(0), "{}", printed(output));
        lines(&String::from_utf8_lossy(&output.stdout))
    };
    let full = table(&evaluate(&run, &["--min-points", "5", "--classes", "pedestrian"]));
    let n_people = full[0].1;
    assert!(n_people >= 1, "the street has people");
    assert_eq!(full, [("pedestrian".to_owned(), n_people, n_people, "100.00".to_owned())]);

    // The list of objects has one line per instance id.
    let objects = replica(&["instances", text(&run)]);
    assert!(objects.status.success(), "{}", printed(&objects));
    let mut numbers: Vec<i32> = returns.0.iter().map(|row| row.3).filter(|&instance| instance != 0).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let of_line = |line: &str| line.split(',').next().and_then(|id| id.parse::<i32>().ok());
    let found: Vec<i32> = String::from_utf8_lossy(&objects.stdout).lines().skip(1).filter_map(of_line).collect();
    assert_eq!(found, numbers);

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
    for output in [evaluate(&empty, &[]), replica(&["instances", text(&empty)])] {
        assert_eq!(output.status.code(), Some(1));
        assert!(printed(&output).contains("no clouds (*.ply)"), "{}", printed(&output));
    }
    std::fs::remove_dir_all(drive.join("truth")).expect("removed");
    let output = evaluate(&run, &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(printed(&output).contains("labels"), "{}", printed(&output));
}

#[test]
fn cloud_without_instances_or_with_nan_points_does_not_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, columns: &[(&'static str, Kind)], rows: &[[f32; 3]]| {
        let path = folder.path().join(name);
        let mut writer = PlyWriter::create(&path, &Header::new(columns.iter().copied()), rows.len()).expect("creates");
        let encode = |i: usize, row: &mut Row<'_>| {
            let [x, y, z] = rows[i];
            row.f32(x).f32(y).f32(z);
            if columns.len() > 3 {
                row.u8(ClassId::Vehicles as u8).i32(7);
            }
        };
        writer.write_each(rows.len(), encode).expect("writes");
        writer.finish().expect("finishes");
        path
    };
    let axes = [("x", Kind::Float), ("y", Kind::Float), ("z", Kind::Float)];
    let all = [&axes[..], &[("semantic", Kind::UChar), ("instance", Kind::Int)]].concat();

    let bare = write("bare.ply", &axes, &[[1.0; 3]]);
    let output = replica(&["instances", text(&bare)]);
    assert_eq!(output.status.code(), Some(1));
    assert!(printed(&output).contains("bare.ply") && printed(&output).contains("semantic"), "{}", printed(&output));

    let none = write("none.ply", &all, &[]);
    let output = replica(&["instances", text(&none)]);
    assert_eq!((output.status.code(), printed(&output).lines().count()), (Some(0), 1), "{}", printed(&output));

    let odd = write("odd.ply", &all, &[[1.0, 2.0, 3.0], [f32::NAN, 2.0, 3.0], [1.0, f32::INFINITY, 9.0]]);
    let output = replica(&["instances", text(&odd)]);
    assert_eq!(output.status.code(), Some(0), "{}", printed(&output));
    let table = printed(&output);
    assert!(table.lines().nth(1).is_some_and(|line| line.starts_with("7,vehicles,1,1,")), "{table}");
}

#[test]
fn geojson_needs_a_run_with_a_geographic_origin() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    Returns((0..100).map(|i| (f64::from(i), 0, ClassId::Vehicles as u8, 3)).collect())
        .write(&run.join("clouds/00000.ply"));
    let geojson = |georeference: Option<&str>| {
        let path = run.join("georeference.json");
        let _ = std::fs::remove_file(&path);
        if let Some(text) = georeference {
            std::fs::write(&path, text).expect("writes");
        }
        replica(&["instances", "--geojson", text(&run)])
    };
    let place = |frame: &str, origin: &str| {
        format!(r#"{{"version":1,"frame":"{frame}","trajectory_frame":"local","origin":{origin},"utm":null}}"#)
    };
    let paris = r#"{"latitude_deg":48.8,"longitude_deg":2.3,"altitude_m":100.0}"#;

    let output = geojson(Some(&place("local", paris)));
    assert_eq!(output.status.code(), Some(0), "{}", printed(&output));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(found["type"], "FeatureCollection");
    let corner = &found["features"][0]["geometry"]["coordinates"][0][0];
    let degrees = [0, 1].map(|idx| corner[idx].as_f64().expect("a number"));
    assert!((degrees[0] - 2.3).abs() < 1e-5 && (degrees[1] - 48.8).abs() < 1e-5, "longitude first: {degrees:?}");

    let nowhere = place("local", r#"{"latitude_deg":98.8,"longitude_deg":2.3,"altitude_m":100.0}"#);
    for (georeference, reason) in [
        (None, "georeference.json"),
        (Some("{"), "georeference.json"),
        (Some(&*place("local", "null")), "has no `origin`"),
        (Some(&*place("UTM 31N", paris)), "the clouds are in frame \"UTM 31N\""),
        (Some(&*nowhere), "98.8 2.3 100 is not a valid position"),
    ] {
        let output = geojson(georeference);
        assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
        assert!(printed(&output).contains(reason), "{}", printed(&output));
    }
}
