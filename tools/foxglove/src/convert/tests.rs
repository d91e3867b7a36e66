use super::*;
use foxglove::Decode;
use foxglove::messages::{FrameTransforms, PointCloud, SceneUpdate};
use messages::pod::bytes_from_rows;
use messages::{
    ByteTable, ClassHeader, ClassRow, ClassTopic, ColorHeader, ColorRow, ColorTopic, Envelope, InstanceHeader,
    InstanceTopic, Message, PoseRow, SubmapHeader, SubmapPoint, SubmapTopic, UNSEEN,
};
use recording::RecordingWriter;
use std::collections::BTreeMap;
use std::path::PathBuf;

const STAMP: i64 = 1_700_000_000_250_000_000;
const N: usize = 10;

/// A submap of ten points along x, 5 m to the left of the odometry's origin; odd points are green cars, the others unseen.
fn recording(folder: &Path, tables: &[ByteTable]) -> PathBuf {
    let path = folder.join("run.mcap");
    let mut writer = RecordingWriter::create(&path, &BTreeMap::new(), tables).expect("creates");
    let envelope = Envelope { seq: 3, stamp: STAMP, len: N as u32, ..Envelope::default() };
    let odom_from_submap = PoseRow { translation: [0.0, 5.0, 0.0], rotation: [0.0, 0.0, 0.0, 1.0] };
    let mut header = SubmapHeader { odom_from_submap, n_sweeps: 1, ..SubmapHeader::default() };
    header.sweeps[0].stamp = STAMP;
    header.sweeps[0].submap_from_lidar_begin = [0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0];
    let points: Vec<SubmapPoint> =
        (0..N).map(|i| SubmapPoint { x: i as f32, intensity: 7, ..SubmapPoint::default() }).collect();
    let is_car = |i: usize| i % 2 == 1;
    let colors: Vec<ColorRow> =
        (0..N).map(|i| ColorRow { r: 0, g: 200, b: 0, camera: if is_car(i) { 1 } else { UNSEEN } }).collect();
    let classes: Vec<ClassRow> =
        (0..N).map(|i| ClassRow { class_id: if is_car(i) { 10 } else { 1 }, score: 255 }).collect();
    let instances: Vec<u32> = (0..N).map(|i| if is_car(i) { 42 } else { 0 }).collect();
    for table in tables {
        let (header, rows) = match table.topic.as_str() {
            SubmapTopic::TOPIC => (bytes_from_rows(std::slice::from_ref(&header)).to_vec(), bytes_from_rows(&points)),
            ColorTopic::TOPIC => (bytes_from_rows(&[ColorHeader { n_seen: 5 }]).to_vec(), bytes_from_rows(&colors)),
            ClassTopic::TOPIC => (bytes_from_rows(&[ClassHeader::default()]).to_vec(), bytes_from_rows(&classes)),
            _ => (bytes_from_rows(&[InstanceHeader::default()]).to_vec(), bytes_from_rows(&instances)),
        };
        writer.message(&table.topic, STAMP, &envelope, &header, rows).expect("writes");
    }
    writer.finish().expect("writes");
    path
}

fn tables() -> Vec<ByteTable> {
    vec![
        ByteTable::of::<SubmapTopic>(),
        ByteTable::of::<ColorTopic>(),
        ByteTable::of::<ClassTopic>(),
        ByteTable::of::<InstanceTopic>(),
    ]
}

/// The only message of a channel of a converted file.
fn only<T: Decode>(file: &Path, topic: &str) -> T {
    let bytes = std::fs::read(file).expect("written");
    let of_topic = mcap::MessageStream::new(&bytes).expect("an MCAP file").map(|message| message.expect("readable"));
    let found: Vec<_> = of_topic.filter(|message| message.channel.topic == topic).collect();
    assert_eq!(found.len(), 1, "{topic}");
    assert_eq!((found[0].log_time, found[0].channel.message_encoding.as_str()), (STAMP as u64, "protobuf"));
    T::decode(&found[0].data[..]).map_err(|error| error.to_string()).expect("decodes")
}

#[test]
fn submap_becomes_a_cloud_with_its_columns_and_boxes() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = recording(folder.path(), &tables());
    let out = folder.path().join("foxglove.mcap");
    convert(&recording, &out, 100).expect("converts");
    let cloud: PointCloud = only(&out, "/points");
    assert_eq!((cloud.frame_id.as_str(), cloud.data.len()), ("odom", N * cloud.point_stride as usize));
    assert_eq!(cloud.pose.and_then(|pose| pose.position).map(|position| position.y), Some(5.0));
    let at = |name: &str, point: usize| {
        let field = cloud.fields.iter().find(|field| field.name == name).expect("a field");
        &cloud.data[point * cloud.point_stride as usize + field.offset as usize..]
    };
    for point in 0..N {
        assert_eq!(f32::from_le_bytes(at("x", point)[..4].try_into().expect("4 bytes")), point as f32);
        let of_car = [at("green", point)[0], at("class", point)[0], at("instance", point)[0]];
        assert_eq!(of_car, if point % 2 == 1 { [200, 10, 42] } else { [150, 1, 0] });
        assert_eq!(at("intensity", point)[0], 7);
    }
    let objects: SceneUpdate = only(&out, "/objects");
    let [car] = &objects.entities[..] else { panic!("{objects:?}") };
    assert_eq!((car.id.as_str(), car.metadata[0].value.as_str()), ("42", "vehicles"));
    let cube = &car.cubes[0];
    assert!((cube.size.expect("a size").x - 8.0).abs() < 1e-9, "{cube:?}");
    assert!((cube.pose.and_then(|pose| pose.position).expect("a place").x - 5.0).abs() < 1e-9, "{cube:?}");
    let moved: FrameTransforms = only(&out, "/tf");
    let lidar = &moved.transforms[0];
    assert_eq!((lidar.parent_frame_id.as_str(), lidar.child_frame_id.as_str()), ("odom", "lidar"));
    let place = lidar.translation.expect("a place");
    assert_eq!([place.x, place.y, place.z], [0.0, 5.0, 2.0]);
}

#[test]
fn more_points_than_wanted_are_left_out_evenly() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = recording(folder.path(), &tables());
    let out = folder.path().join("foxglove.mcap");
    // Every second point would suffice, but with alternating beams it would keep only half of the beams.
    convert(&recording, &out, 5).expect("converts");
    let cloud: PointCloud = only(&out, "/points");
    let x = |point: usize| f32::from_le_bytes(cloud.data[point * 24..][..4].try_into().expect("4 bytes"));
    assert_eq!((0..cloud.data.len() / 24).map(x).collect::<Vec<_>>(), [0.0, 3.0, 6.0, 9.0]);
}

#[test]
fn submap_without_columns_is_shown_and_an_existing_file_is_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = recording(folder.path(), &tables()[..1]);
    let out = folder.path().join("foxglove.mcap");
    convert(&recording, &out, 100).expect("converts");
    let cloud: PointCloud = only(&out, "/points");
    assert_eq!(cloud.data.len(), N * 24);
    let before = std::fs::read(&out).expect("written");
    let error = format!("{:#}", convert(&recording, &out, 100).expect_err("the file exists"));
    assert!(error.contains("foxglove.mcap"), "{error}");
    assert_eq!(std::fs::read(&out).expect("kept"), before);
}

#[test]
fn recording_of_another_layout_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = ByteTable { version: 99, ..ByteTable::of::<SubmapTopic>() };
    let recording = recording(folder.path(), &[table]);
    let error =
        format!("{:#}", convert(&recording, &folder.path().join("out.mcap"), 100).expect_err("another version"));
    assert!(error.contains("submap") && error.contains("99"), "{error}");
}
