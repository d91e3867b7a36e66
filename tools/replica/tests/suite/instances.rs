//! `replica instances` on clouds as a run writes them.

use crate::returns::Returns;
use crate::support::{printed, replica, succeeded, text};
use formats::ply::{Header, Kind, PlyWriter, Row};
use messages::ClassId;

#[test]
fn list_has_a_line_for_each_instance() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = folder.path().join("drive");
    let run = folder.path().join("run");
    succeeded(&replica(&["simulate", "--seed", "1", "--seconds", "0.3", "--out", text(&drive)]));
    let returns = Returns::read(&drive);
    returns.write(&run.join("clouds/00000.ply"));
    let objects = replica(&["instances", text(&run)]);
    assert!(objects.status.success(), "{}", printed(&objects));
    let mut numbers: Vec<i32> = returns.0.iter().map(|row| row.3).filter(|&instance| instance != 0).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let of_line = |line: &str| line.split(',').next().and_then(|id| id.parse::<i32>().ok());
    let found: Vec<i32> = String::from_utf8_lossy(&objects.stdout).lines().skip(1).filter_map(of_line).collect();
    assert_eq!(found, numbers);
    assert!(!numbers.is_empty(), "the street has objects");

    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).expect("made");
    let output = replica(&["instances", text(&empty)]);
    assert_eq!(output.status.code(), Some(1));
    assert!(printed(&output).contains("no clouds (*.ply)"), "{}", printed(&output));
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
