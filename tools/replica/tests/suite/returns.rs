//! Clouds with the true labels of a drive, as a run writes them.

use drive::{Drive, Shot};
use formats::ply::{Header, Kind, PlyWriter, Row};
use std::path::Path;

/// The returns of a drive: time, ring, class and instance.
pub struct Returns(pub Vec<(f64, u8, u8, i32)>);

impl Returns {
    /// The returns of a drive with labels.
    pub fn read(drive: &Path) -> Self {
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
    pub fn write(&self, path: &Path) {
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
