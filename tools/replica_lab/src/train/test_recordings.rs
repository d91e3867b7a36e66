//! Recordings of simulated submaps, for tests.

use super::camera_columns::CameraColumns;
use geometry::Pose;
use messages::pod::bytes_from_rows;
use messages::{
    ByteTable, ClassHeader, ClassRow, ClassTopic, ColorHeader, ColorTopic, Envelope, Message, SpectraTopic, SubmapTopic,
};
use recording::RecordingWriter;
use std::collections::BTreeMap;
use std::path::Path;
use town_sweeps::{Mount, TownDrive, TownSubmap};

/// Three submaps of two sweeps.
pub fn submaps() -> Vec<TownSubmap> {
    let drive = TownDrive { town: simulation::Town::Urban, seed: 41, seconds: 4.0 };
    let mut submaps = drive.submaps(3, 2, 5, Mount::Rig).expect("long enough");
    for submap in &mut submaps {
        submap.header.odom_from_submap = Pose::identity().into();
    }
    submaps
}

/// Writes labeled clouds as `replica import` does, and also the columns of cameras; the topics are taken from the first submap.
pub fn write_recording(path: &Path, submaps: &[TownSubmap], about: &str, camera: &[CameraColumns]) {
    let about = BTreeMap::from([(about.to_owned(), String::new())]);
    let mut tables = vec![ByteTable::of::<SubmapTopic>(), ByteTable::of::<ClassTopic>()];
    let first = camera.first();
    tables.extend(first.and_then(|columns| columns.colors.as_ref()).map(|_| ByteTable::of::<ColorTopic>()));
    tables.extend(first.and_then(|columns| columns.spectra.as_ref()).map(|_| ByteTable::of::<SpectraTopic>()));
    let mut writer = RecordingWriter::create(path, &about, &tables).expect("created");
    for (seq, submap) in submaps.iter().enumerate() {
        let mut write = |topic: &str, header: &[u8], rows: &[u8], n_rows: usize| {
            let envelope = Envelope { seq: seq as u64, len: n_rows as u32, ..Envelope::default() };
            writer.message(topic, 0, &envelope, header, rows).expect("written");
        };
        let n_points = submap.points.len();
        let header = bytes_from_rows(std::slice::from_ref(&*submap.header));
        write(SubmapTopic::TOPIC, header, bytes_from_rows(&submap.points), n_points);
        // Scores distinguish the classes.
        let class = |class: &u8| ClassRow { class_id: *class, score: 10 * class };
        let classes: Vec<ClassRow> = submap.truth.iter().map(class).collect();
        let header = ClassHeader::default();
        write(ClassTopic::TOPIC, bytes_from_rows(&[header]), bytes_from_rows(&classes), n_points);
        let columns = camera.get(seq);
        if let Some(colors) = columns.and_then(|columns| columns.colors.as_ref()) {
            let header = ColorHeader::default();
            write(ColorTopic::TOPIC, bytes_from_rows(&[header]), bytes_from_rows(colors), n_points);
        }
        if let Some((header, rows)) = columns.and_then(|columns| columns.spectra.as_ref()) {
            let header = bytes_from_rows(std::slice::from_ref(&**header));
            write(SpectraTopic::TOPIC, header, bytes_from_rows(rows), rows.len());
        }
    }
    writer.finish().expect("written");
}
