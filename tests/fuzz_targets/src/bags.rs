//! Bags of ROS: containers, their metadata, and messages.

use crate::accepted::accepted;
use crate::scratch::{with_file, with_files};
use formats::sqlite::{Database, Value};
use import::{Kind, LiveTopic, Options};
use std::path::Path;

/// Imports a bag of these bytes.
pub(crate) fn bag(bytes: &[u8]) {
    with_file("bag", bytes, |path| import(path, Kind::Ros));
}

/// Imports into a folder next to the source. A failed import leaves no files behind.
pub(crate) fn import(source: &Path, kind: Kind) {
    let out = source.with_extension("drive");
    let options = Options { kind: Some(kind), ..Options::default() };
    let imported = import::import(source, &out, &options);
    assert_eq!(imported.is_ok(), out.exists(), "{imported:?}");
    assert!(!out.with_extension("drive.partial").exists(), "{imported:?}");
    accepted(&imported);
    if out.exists() {
        std::fs::remove_dir_all(out).expect("removes");
    }
}

/// All rows of the tables of a ROS 2 bag.
pub(crate) fn sqlite(bytes: &[u8]) {
    with_file("a.db3", bytes, |path| {
        let opened = Database::open(path);
        accepted(&opened);
        let Ok(database) = opened else { return };
        for table in ["topics", "messages"] {
            let Ok(Some(mut rows)) = database.rows(table) else { continue };
            let mut n_bytes = 0;
            while let Ok(Some(mut row)) = rows.next_row() {
                if rows.load(&mut row).is_err() {
                    break;
                }
                for column in 0..5 {
                    if let Ok(Some(Value::Text(value) | Value::Blob(value))) = row.value(column) {
                        n_bytes += value.len();
                    }
                }
            }
            // Values of a row may overlap, rows may not.
            assert!(n_bytes <= 5 * bytes.len(), "{n_bytes} bytes of values in {}", bytes.len());
        }
    });
}

/// A file of a bag: the target adds its description.
const PART: &[u8] = include_bytes!("../corpus/ros2_mcap/seed_0");

/// The description of a bag in several files.
pub(crate) fn metadata(bytes: &[u8]) {
    with_files(&[("bag/metadata.yaml", bytes), ("bag/a_0.mcap", PART)], |folder| {
        import(&folder.join("bag"), Kind::Ros);
    });
}

/// Name and type of each topic.
const TOPICS: [(&str, &str); 14] = [
    ("/points", "sensor_msgs/msg/PointCloud2"),
    ("/imu", "sensor_msgs/msg/Imu"),
    ("/fix", "sensor_msgs/msg/NavSatFix"),
    ("/cam/image_raw", "sensor_msgs/msg/Image"),
    ("/cam/camera_info", "sensor_msgs/msg/CameraInfo"),
    ("/tf_static", "tf2_msgs/msg/TFMessage"),
    ("/side/image_raw/compressed", "sensor_msgs/msg/CompressedImage"),
    ("/side/camera_info", "sensor_msgs/msg/CameraInfo"),
    ("/nmea", "nmea_msgs/msg/Sentence"),
    ("/livox", "livox_ros_driver2/msg/CustomMsg"),
    ("/velodyne", "velodyne_msgs/msg/VelodyneScan"),
    ("/nebula", "nebula_msgs/msg/NebulaPackets"),
    ("/ouster/lidar_packets", "ouster_sensor_msgs/msg/PacketMsg"),
    ("/ouster/metadata", "std_msgs/msg/String"),
];
/// Largest number of messages of an input: the rest is one message.
const MAX_MESSAGES: usize = 64;

/// Messages of a bag. The first byte of an input selects the serialization. Then follow the messages: number of the
/// topic, length (u16, little-endian), and bytes.
pub(crate) fn ros_messages(bytes: &[u8]) {
    with_file("a.mcap", &messages(bytes), |path| import(path, Kind::Ros));
    for (topic, message) in parts(bytes) {
        for is_mosaic in [false, true] {
            if let Some(mut topic) = LiveTopic::new(&TOPICS[topic].1.replace("/msg/", "/"), is_mosaic) {
                // A seed is accepted if the import accepts it.
                let _ = topic.read(message, 1);
            }
        }
    }
}

/// Topics and messages of such an input.
fn parts(bytes: &[u8]) -> Vec<(usize, &[u8])> {
    let mut rest = bytes.get(1..).unwrap_or_default();
    let mut found = Vec::new();
    while let Some(([topic, low, high], behind)) = rest.split_first_chunk() {
        let n_bytes = usize::from(u16::from_le_bytes([*low, *high])).min(behind.len());
        let n_bytes = if found.len() == MAX_MESSAGES { behind.len() } else { n_bytes };
        let (message, behind) = behind.split_at(n_bytes);
        found.push((usize::from(*topic) % TOPICS.len(), message));
        rest = behind;
    }
    found
}

/// The bag of such an input.
fn messages(bytes: &[u8]) -> Vec<u8> {
    let encoding: &[u8] = if bytes.first().is_none_or(|first| first % 2 == 0) { b"cdr" } else { b"ros1" };
    let found = parts(bytes);
    let text = |text: &[u8]| [&(text.len() as u32).to_le_bytes()[..], text].concat();
    let mut bag = b"\x89MCAP0\r\n".to_vec();
    let mut record = |kind: u8, body: &[u8]| {
        bag.push(kind);
        bag.extend((body.len() as u64).to_le_bytes());
        bag.extend(body);
    };
    for (id, (name, kind)) in (0_u16..).zip(TOPICS) {
        let number = (id + 1).to_le_bytes();
        record(3, &[&number[..], &text(kind.as_bytes()), &text(b"ros2msg"), &text(b"")].concat());
        record(4, &[&id.to_le_bytes()[..], &number, &text(name.as_bytes()), &text(encoding), &text(b"")].concat());
    }
    for (time, (topic, message)) in (1_700_000_000_000_000_000_u64..).step_by(100_000_000).zip(found) {
        let head = [&(topic as u16).to_le_bytes()[..], &[0; 4], &time.to_le_bytes(), &time.to_le_bytes()].concat();
        record(5, &[&head, message].concat());
    }
    record(15, &[0; 4]);
    record(2, &[0; 20]);
    bag.extend(b"\x89MCAP0\r\n");
    bag
}
