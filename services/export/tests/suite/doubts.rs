//! Doubtful results: doubts at the end of the run, and UTM coordinates that are refused.

use crate::support::{Street, context, received};
use delivery::Index;
use export::{Coordinates, Export, Frame, Settings};
use formats::ply::Vertices;
use messages::{
    ColorTopic, FRAME_EAST_NORTH_UP, FRAME_LOCAL, InstanceTopic, PlacementHeader, PlacementRow, PlacementTopic,
};
use stage::testing::Bench;
use stage::{Context, Mode, Stage, StepError};
use std::path::Path;

const N: u64 = 3;
const GOOD_M: [f32; 3] = [0.3, 0.4, 0.6];

/// A run up to its end, with the given standard deviations of its second submap; the deviations of the other submaps
/// are small.
fn driven(folder: &Path, settings: &Settings, frame: u32, sigma_m: [f32; 3], heading_deg: f32) -> Bench<Export> {
    driven_at(48.846_222, folder, settings, frame, sigma_m, heading_deg)
}

/// A run at a latitude.
fn driven_at(
    latitude_deg: f64,
    folder: &Path,
    settings: &Settings,
    frame: u32,
    sigma_m: [f32; 3],
    heading_deg: f32,
) -> Bench<Export> {
    let mut bench = Bench::<Export>::new(settings, &context(folder)).expect("starts");
    let street = Street::new(5, 200);
    for seq in 0..N {
        street.send_submap(&mut bench, seq);
        street.send_columns(&mut bench, seq, &["color", "spectra", "class", "instance"]);
        bench.tick().expect("steps");
    }
    let header = PlacementHeader {
        latitude_deg,
        longitude_deg: 2.346_414,
        altitude_m: 104.6,
        frame,
        n_fixes: 40,
        ..PlacementHeader::default()
    };
    let row = |seq: u64| PlacementRow {
        submap: seq,
        stamp: street.sweep_stamp(seq, 0),
        world_from_submap: street.header(seq).odom_from_submap,
        odom_from_submap: street.header(seq).odom_from_submap,
        sigma_m: if seq == 1 { sigma_m } else { GOOD_M },
        sigma_rad: [0.01, 0.01, if seq == 1 { heading_deg.to_radians() } else { 0.01 }],
    };
    bench.send::<PlacementTopic>(street.sweep_stamp(0, 0), header, (0..N).map(row).collect());
    bench.tick().expect("steps");
    bench
}

fn utm() -> Settings {
    Settings { frame: Frame::Utm, coordinates: Coordinates::Double, ..Settings::default() }
}

fn georeference(folder: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(folder.join("georeference.json")).expect("is there");
    serde_json::from_str(&text).expect("JSON")
}

fn infos(folder: &Path, seq: u64) -> Vec<String> {
    Vertices::load(&folder.join(format!("clouds/submap_{seq:04}.ply"))).expect("reads").infos().to_vec()
}

const DEVIATIONS: [&str; 3] = ["position_uncertain", "height_uncertain", "heading_undetermined"];

#[test]
fn standard_deviations_are_in_georeference_and_headers() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = driven(folder.path(), &Settings::default(), FRAME_EAST_NORTH_UP, [3.0, 4.0, 2.0], 4.0);
    bench.finish().expect("finishes");
    let deviations = &georeference(folder.path())["standard_deviations"];
    let number = |of: &str, which: &str| deviations[of][which].as_f64().expect("a number");
    assert!((number("position_m", "largest") - 5.0).abs() < 1e-6, "{deviations}");
    assert!((number("position_m", "median") - 0.5).abs() < 1e-6, "{deviations}");
    assert!((number("height_m", "largest") - 2.0).abs() < 1e-6, "{deviations}");
    assert!((number("heading_deg", "largest") - 4.0).abs() < 1e-5, "{deviations}");
    let line = "standard_deviation position_m 5.000 height_m 2.000 heading_deg 4.000";
    assert!(infos(folder.path(), 1).contains(&line.to_owned()), "{:?}", infos(folder.path(), 1));
    assert_eq!(DEVIATIONS.map(|name| bench.doubt(name)), [None; 3], "at the limits, not beyond");
}

#[test]
fn large_standard_deviations_are_doubted() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = driven(folder.path(), &Settings::default(), FRAME_EAST_NORTH_UP, [30.0, 40.0, 12.0], 42.0);
    bench.finish().expect("finishes");
    let [position, height, heading] = DEVIATIONS.map(|name| bench.doubt(name).expect(name));
    assert!((position - 50.0).abs() < 1e-4 && (height - 12.0).abs() < 1e-4 && (heading - 42.0).abs() < 1e-4);

    let settings = Settings {
        max_position_deviation_m: 60.0,
        max_height_deviation_m: 60.0,
        max_heading_deviation_deg: 60.0,
        ..Settings::default()
    };
    let mut accepted = driven(folder.path(), &settings, FRAME_EAST_NORTH_UP, [30.0, 40.0, 12.0], 42.0);
    accepted.finish().expect("finishes");
    assert_eq!(DEVIATIONS.map(|name| accepted.doubt(name)), [None; 3], "limits are settings");
    // Without an origin on the Earth, deviations are against the first submap.
    let mut local = driven(folder.path(), &Settings::default(), FRAME_LOCAL, [30.0, 40.0, 12.0], 42.0);
    local.finish().expect("finishes");
    assert_eq!(DEVIATIONS.map(|name| local.doubt(name)), [None; 3]);
}

#[test]
fn utm_with_undetermined_heading_is_refused_and_clouds_stay_local() {
    for (frame, reason) in [(FRAME_EAST_NORTH_UP, "heading undetermined"), (FRAME_LOCAL, "is not georeferenced")] {
        let folder = tempfile::tempdir().expect("a folder");
        let error = driven(folder.path(), &utm(), frame, GOOD_M, 42.0).finish().expect_err("refused");
        assert!(matches!(error, StepError::Configuration(_)), "{error}");
        assert!(error.to_string().contains(reason), "{error}");
        let accepts = "max_heading_deviation_deg = 180 accepts the heading";
        assert_eq!(error.to_string().contains(accepts), frame == FRAME_EAST_NORTH_UP, "{error}");
        let index = std::fs::read(folder.path().join("clouds/index.json")).expect("is there");
        let index: Index = serde_json::from_slice(&index).expect("is an index");
        assert!(index.frame.starts_with("local"), "{}", index.frame);
        assert!(!infos(folder.path(), 1).iter().any(|info| info.starts_with("crs")), "{:?}", infos(folder.path(), 1));
        assert_eq!(georeference(folder.path())["frame"], index.frame);
    }
}

/// No setting makes UTM of it: the error must not name one.
#[test]
fn utm_near_a_pole_is_refused_with_its_latitude() {
    let folder = tempfile::tempdir().expect("a folder");
    let error =
        driven_at(85.35, folder.path(), &utm(), FRAME_EAST_NORTH_UP, GOOD_M, 0.5).finish().expect_err("refused");
    let error = error.to_string();
    assert!(error.contains("latitude 85.35 degrees is outside UTM; expected -80 to 84"), "{error}");
    assert!(error.ends_with("use frame = \"world\"") && !error.contains("max_heading_deviation_deg"), "{error}");
}

#[test]
fn utm_with_accepted_heading_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = Settings { max_heading_deviation_deg: 180.0, ..utm() };
    driven(folder.path(), &settings, FRAME_EAST_NORTH_UP, GOOD_M, 42.0).finish().expect("finishes");
    assert!(infos(folder.path(), 1).contains(&"crs EPSG:32631".to_owned()));
}

#[test]
fn utm_without_placement_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut context = context(folder.path());
    let mut bench = Bench::<Export>::new(&utm(), &context).expect("starts");
    Street::new(6, 50).send_submap(&mut bench, 0);
    Street::new(6, 50).send_columns(&mut bench, 0, &["color", "spectra", "class", "instance"]);
    bench.tick().expect("steps");
    let error = bench.finish().expect_err("refused").to_string();
    assert!(error.contains("no placement arrived"), "{error}");
    context.connected.retain(|topic| topic != "placement");
    let problems = <Export>::check(&utm(), &context);
    assert!(problems.len() == 1 && problems[0].text.contains("no stage publishes placement"), "{problems:?}");
}

#[test]
fn run_without_submaps_or_without_points_is_doubted() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |n_submaps: u64, n_points: usize, settings: &Settings| {
        let mut bench = Bench::<Export>::new(settings, &context(folder.path())).expect("starts");
        let street = Street::new(7, n_points);
        for seq in 0..n_submaps {
            street.send_submap(&mut bench, seq);
            street.send_columns(&mut bench, seq, &["color", "spectra", "class", "instance"]);
            bench.tick().expect("steps");
        }
        bench.finish().expect("finishes");
        ["no_submaps", "no_points"].map(|name| bench.doubt(name).is_some())
    };
    assert_eq!(run(0, 10, &Settings::default()), [true, false]);
    assert_eq!(run(2, 0, &Settings::default()), [false, true]);
    assert_eq!(run(2, 10, &Settings::default()), [false, false]);
    assert_eq!(run(0, 10, &Settings { formats: Vec::new(), ..Settings::default() }), [false, false]);
}

#[test]
fn lost_columns_are_doubted_with_their_share() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = Context { mode: Mode::Live, ..context(folder.path()) };
    let street = Street::new(13, 100);
    let run = |settings: &Settings| {
        let mut bench = Bench::<Export>::new(settings, &context).expect("starts");
        for seq in 0..2 {
            street.send_submap(&mut bench, seq);
            bench.forward::<ColorTopic>(received(seq, messages::ColorHeader::default(), &street.color(seq)));
            bench.forward::<InstanceTopic>(received(seq, messages::InstanceHeader::default(), &street.instance(seq)));
        }
        street.send_columns(&mut bench, 1, &["spectra", "class"]);
        bench.tick().expect("steps");
        bench.finish().expect("finishes");
        bench.doubt("lost_columns")
    };
    assert_eq!(run(&Settings::default()), Some(0.25), "two of eight");
    assert_eq!(run(&Settings { max_lost_columns_share: 0.25, ..Settings::default() }), None);
}
