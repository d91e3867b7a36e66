//! A column is declared once: the payload type of its topic, and one entry of the table of columns. This test declares one and finds
//! it in PLY, LAS, CloudCompare's PLY, `replica inspect --by` and the table that the Python package reads.

use export::{Export, Settings};
use formats::ply::Vertices;
use messages::columns::{COLUMNS, Column, ColumnField, FieldType, Presence, Shown};
use messages::{
    ByteTable, Message, NoHeader, PoseRow, StampedPose, SubmapHeader, SubmapPoint, SubmapSweep, SubmapTopic,
    TrajectoryTopic,
};
use replica_tests::{binary, output_text};
use stage::testing::{Bench, context};
use stage::{ColumnPort, ColumnTable};
use std::path::Path;
use std::process::Command;
use surveying::{CloudOptions, RunFolder, TargetFrame, Tiling, write_cloudcompare, write_tiles};

const N_POINTS: usize = 600;
/// Bytes of a LAS record before the extra bytes.
const FORMAT_7_BYTES: usize = 36;

/// The payload type of the topic.
struct MoistureTopic;

impl Message for MoistureTopic {
    const TOPIC: &'static str = "moisture";
    const VERSION: u32 = 1;
    const QUEUE: usize = 3;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = SubmapTopic::MAX_ROWS;
    type Header = NoHeader;
    type Row = f32;
}

/// The entry of the column.
static MOISTURE: Column = Column {
    name: "moisture",
    topic: MoistureTopic::TOPIC,
    layout: ByteTable::of::<MoistureTopic>,
    presence: Presence::Default,
    place: 100,
    fields: &[ColumnField::new("moisture", FieldType::F32, "water content of the surface")
        .row_field("")
        .unit("%")
        .none(-1.0)
        .extra_byte(100, "water content, %")
        .shown(Shown::Ramp)],
    header_lines: &["moisture -1 where unknown"],
    description: "Water content of each point",
};

/// The table of the pipeline and the added column.
struct WithMoisture;

impl ColumnTable for WithMoisture {
    fn ports() -> Vec<ColumnPort> {
        [ColumnPort::all(), vec![ColumnPort::new::<MoistureTopic>(&MOISTURE)]].concat()
    }
}

/// The table of the pipeline and the added column, for readers of files.
fn table() -> &'static [Column] {
    // A test creates one, and needs it until its end.
    Box::leak([COLUMNS, &[MOISTURE]].concat().into_boxed_slice())
}

/// Moisture of a point at its position, %.
fn moisture(x: f32) -> f32 {
    if x < 1.0 { -1.0 } else { x * 2.5 }
}

fn points() -> Vec<SubmapPoint> {
    let point = |i: usize| SubmapPoint {
        x: (i % 30) as f32,
        y: (i / 30) as f32,
        offset_nanos: i as u32 * 1000,
        intensity: (i % 256) as u8,
        ..SubmapPoint::default()
    };
    (0..N_POINTS).map(point).collect()
}

/// Runs the stage over one submap with the column.
fn write_run(folder: &Path) {
    let pose = PoseRow { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };
    let origin = [0.0, 0.0, 1.5, 0.0, 0.0, 0.0, 1.0];
    let mut header = SubmapHeader { odom_from_submap: pose, n_sweeps: 1, n_rings: 32, ..SubmapHeader::default() };
    header.stamp_end = 100_000_000;
    header.sweeps[0] = SubmapSweep {
        duration_nanos: 100_000_000,
        n_points: N_POINTS as u32,
        submap_from_lidar_begin: origin,
        submap_from_lidar_end: origin,
        ..SubmapSweep::default()
    };
    let mut context = context(folder);
    context.connected = ["submap", "trajectory", "moisture"].map(str::to_owned).to_vec();
    let mut bench = Bench::<Export<WithMoisture>>::new(&Settings::default(), &context).expect("starts");
    let poses = [0, 100_000_000].map(|stamp| StampedPose { stamp, odom_from_body: pose });
    bench.send::<TrajectoryTopic>(0, NoHeader::default(), poses.to_vec());
    bench.send::<SubmapTopic>(0, header, points());
    bench.tick().expect("steps");
    assert_eq!(bench.counter("clouds"), 0, "the cloud waits for the column");
    bench.send::<MoistureTopic>(0, NoHeader::default(), points().iter().map(|point| moisture(point.x)).collect());
    bench.tick().expect("steps");
    bench.finish().expect("finishes");
}

#[test]
fn added_column_is_in_clouds_deliveries_and_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    std::fs::create_dir(&run).expect("made");
    write_run(&run);

    let cloud = Vertices::load(&run.join("clouds/submap_0000.ply")).expect("reads");
    assert_eq!(cloud.properties().last().map(|property| property.name.as_str()), Some("moisture"));
    let expected: Vec<f32> = points().iter().map(|point| moisture(point.x)).collect();
    assert_eq!(cloud.f32s("moisture").expect("is there"), expected);
    assert!(cloud.infos().iter().any(|line| line == "moisture -1 where unknown"), "{:?}", cloud.infos());

    let finished = RunFolder::open_with(&run, table()).expect("opens");
    let frame = TargetFrame::local(None);
    let out = folder.path().join("out");
    std::fs::create_dir(&out).expect("made");
    let system = "system".to_owned();
    let software = "software".to_owned();
    let options = CloudOptions { has_bands: false, has_ground_as_2: false, system, software, note: String::new() };
    let tiling = Tiling { side_m: 0, is_compressed: false };
    let files =
        write_tiles(std::slice::from_ref(&finished), &frame, &options, tiling, &out, |_| ()).expect("writes").files;
    let las = std::fs::read(out.join(&files[0].file)).expect("reads");
    let word = |at: usize| u32::from_le_bytes(las[at..at + 4].try_into().expect("4 bytes"));
    let description = las.windows(17).position(|bytes| bytes == b"water content, %\0").expect("is described");
    assert!(las[description - 156..].starts_with(b"moisture\0"), "name and description are of one field");
    let points_at = word(96) as usize;
    let record_bytes = usize::from(las[105]);
    assert_eq!(record_bytes, FORMAT_7_BYTES + 10, "laser, moving, frame and moisture");
    let mut found: Vec<(i32, f32)> = las[points_at..]
        .chunks_exact(record_bytes)
        .map(|record| {
            let x_mm = i32::from_le_bytes(record[..4].try_into().expect("4 bytes"));
            (x_mm, f32::from_le_bytes(record[record_bytes - 4..].try_into().expect("4 bytes")))
        })
        .collect();
    assert_eq!(found.len(), N_POINTS);
    found.retain(|(x_mm, value)| *value != moisture(*x_mm as f32 / 1000.0));
    assert!(found.is_empty(), "records with another value: {found:?}");

    let names = write_cloudcompare(&finished, &frame, false, &out).expect("writes");
    let delivered = Vertices::load(&out.join(&names[0])).expect("reads");
    assert_eq!(delivered.f32s("scalar_moisture").expect("is there"), expected);

    let picture = folder.path().join("moisture.png");
    let inspect = |by: &str| {
        let mut command = Command::new(binary("replica"));
        command.arg("inspect").arg(&run).args(["--view", "top", "--by", by]).arg("--picture").arg(&picture);
        command.output().expect("starts")
    };
    let output = inspect("moisture");
    assert!(output.status.success(), "{}", output_text(&output));
    assert!(std::fs::read(&picture).expect("a picture").starts_with(b"\x89PNG"));
    let output = inspect("dryness");
    assert!(!output.status.success() && output_text(&output).contains("the clouds have no column `dryness`"));
}

#[test]
fn table_in_json_has_the_added_column_for_other_languages() {
    let json = serde_json::to_value(table()).expect("encodes");
    let added = json.as_array().and_then(|columns| columns.last()).expect("is there");
    let field = &added["fields"][0];
    assert_eq!(
        (&added["topic"], &field["property"], &field["unit"]),
        (&"moisture".into(), &"moisture".into(), &"%".into())
    );
    assert_eq!((&field["none"], &field["kind"]), (&(-1.0).into(), &"f32".into()));
}
