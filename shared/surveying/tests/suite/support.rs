//! Runs with known points, and readers of the delivered files.

use delivery::{CloudEntry, Index};
use formats::ply::{Header, Kind, PlyWriter, Row};
use formats::trajectory::tum_from_trajectory;
use geometry::{Isometry3, Stamp, Trajectory};
use laz::{LasZipDecompressor, LazVlr};
use std::io::Cursor;
use std::path::Path;
use surveying::{CloudOptions, Georeference, TargetFrame};

/// 2021-06-01T00:00:00Z, s.
pub const BEGIN_S: i64 = 1_622_505_600;
/// Frame of the clouds.
const FRAME: &str = "local east-north-up";

/// A point of a cloud: coordinates and class; all other values are derived from its number.
pub type Point = ([f64; 3], u8);

/// A street of two walls and a road along x, `n` points, 20 m for each submap.
pub fn street(n: usize) -> Vec<Point> {
    let point = |i: usize| {
        let x = i as f64 / n as f64 * 40.0 - 15.0;
        let y = (i % 7) as f64 * 2.0 - 6.0;
        if i.is_multiple_of(3) { ([x, y, 0.01 * x], 7) } else { ([x, 8.0, (i % 11) as f64], 1) }
    };
    (0..n).map(point).collect()
}

/// Writes a run with these clouds at the Pantheon. `is_placed` states which of them are in the frame of the run.
pub fn write_run(run: &Path, clouds: &[(Vec<Point>, bool)]) {
    std::fs::create_dir_all(run.join("clouds")).expect("made");
    let entries: Vec<CloudEntry> =
        clouds.iter().enumerate().map(|(seq, (points, is_placed))| write_cloud(run, seq, points, *is_placed)).collect();
    std::fs::write(run.join("clouds/index.json"), Index::new(&entries, FRAME).to_json()).expect("writes");
    let mut trajectory = Trajectory::default();
    for i in 0..40 {
        trajectory.push(Stamp((BEGIN_S * 10 + i) * 100_000_000), Isometry3::translation(i as f64 - 15.0, 0.0, 1.5));
    }
    std::fs::write(run.join("trajectory.txt"), tum_from_trajectory(&trajectory)).expect("writes");
    let georeference = r#"{"frame":"local east-north-up","trajectory_frame":"local east-north-up",
        "origin":{"latitude_deg":48.846222,"longitude_deg":2.346414,"altitude_m":104.6}}"#;
    std::fs::write(run.join("georeference.json"), georeference).expect("writes");
}

/// Writes a cloud. Class, intensity and the other values of point `i` are derived from its number.
fn write_cloud(run: &Path, seq: usize, points: &[Point], is_placed: bool) -> CloudEntry {
    let file = format!("clouds/submap_{seq:04}.ply");
    let positions = ["x", "y", "z", "x_lidar_position", "y_lidar_position", "z_lidar_position"];
    let header = Header::new(positions.map(|name| (name, Kind::Double)).into_iter().chain([
        ("timestamp", Kind::Double),
        ("index_frame", Kind::Int),
        ("intensity", Kind::UChar),
        ("ring", Kind::UChar),
        ("dynamic", Kind::UChar),
        ("instance", Kind::Int),
        ("semantic", Kind::UChar),
        ("score", Kind::Float),
        ("red", Kind::UChar),
        ("green", Kind::UChar),
        ("blue", Kind::UChar),
        ("camera", Kind::UChar),
    ]));
    let mut writer = PlyWriter::create(&run.join(&file), &header, points.len()).expect("creates");
    let encode = |i: usize, row: &mut Row<'_>| {
        let ([x, y, z], class) = points[i];
        row.f64(x).f64(y).f64(z).f64(x).f64(0.0).f64(1.5);
        row.f64(time_s(seq, i)).i32((seq * 100 + i / 50) as i32).u8((i % 256) as u8).u8((i % 32) as u8);
        row.u8(u8::from(i.is_multiple_of(5))).i32((i % 4) as i32).u8(class).f32(200.0 / 255.0);
        row.u8(10).u8(20).u8((i % 100) as u8).u8(3);
    };
    writer.write_each(points.len(), encode).expect("writes");
    let bytes = writer.finish().expect("finishes");
    let finite = || points.iter().map(|(xyz, _)| *xyz).filter(|xyz| xyz.iter().all(|value| value.is_finite()));
    let extreme = |take: fn(f64, f64) -> f64| finite().reduce(|a, b| std::array::from_fn(|k| take(a[k], b[k])));
    CloudEntry {
        seq: seq as u64,
        file,
        bytes,
        n_points: points.len() as u64,
        stamp_begin: (BEGIN_S + seq as i64) * 1_000_000_000,
        stamp_end: (BEGIN_S + seq as i64 + 1) * 1_000_000_000,
        bounds: extreme(f64::min).zip(extreme(f64::max)).map(|(low, high)| [low, high]),
        translation: [0.0; 3],
        rotation: [0.0, 0.0, 0.0, 1.0],
        sigma_m: is_placed.then_some([0.1; 3]),
        sigma_rad: is_placed.then_some([0.01; 3]),
        n_colored: None,
        classes: None,
        n_instances: None,
        spectra: None,
        lost: Vec::new(),
    }
}

/// Time of point `i` of a cloud.
pub fn time_s(seq: usize, i: usize) -> f64 {
    (BEGIN_S + seq as i64) as f64 + i as f64 * 1e-5
}

/// Options without bands.
pub fn options() -> CloudOptions {
    CloudOptions {
        has_bands: false,
        has_ground_as_2: false,
        system: "system".to_owned(),
        software: "software".to_owned(),
        note: String::new(),
    }
}

/// UTM at the origin of the run.
pub fn utm(georeference: &Georeference) -> TargetFrame<'_> {
    let origin = georeference.local().expect("is placed").origin();
    TargetFrame::projected(georeference, surveying::crs::Crs::utm_of(&origin).expect("has a zone")).expect("a frame")
}

/// A file of point format 7, decoded by the crate laz.
pub struct LasContent {
    pub bytes: Vec<u8>,
    pub records: Vec<Vec<u8>>,
}

impl LasContent {
    pub fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).expect("is there");
        let short = |at: usize| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
        let long = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes")) as usize;
        let points_at = long(96);
        let record_bytes = short(105);
        let n_points = u64::from_le_bytes(bytes[247..255].try_into().expect("8 bytes")) as usize;
        let mut all = vec![0; n_points * record_bytes];
        if bytes[104] & 0x80 == 0 {
            all.copy_from_slice(&bytes[points_at..]);
        } else {
            let mut at = short(94);
            let laszip = (0..long(100)).find_map(|_| {
                let begin = at;
                let length = short(at + 20);
                at += 54 + length;
                (short(begin + 18) == 22_204).then(|| LazVlr::from_buffer(&bytes[begin + 54..at]).expect("a record"))
            });
            let mut source = Cursor::new(&bytes[..]);
            source.set_position(points_at as u64);
            let laszip = laszip.expect("is compressed");
            LasZipDecompressor::new(source, laszip).expect("opens").decompress_many(&mut all).expect("decodes");
        }
        Self { records: all.chunks_exact(record_bytes).map(<[u8]>::to_vec).collect(), bytes }
    }

    /// Coordinates of a record, m.
    pub fn position(&self, record: &[u8]) -> [f64; 3] {
        let double = |at: usize| f64::from_le_bytes(self.bytes[at..at + 8].try_into().expect("8 bytes"));
        std::array::from_fn(|k| {
            let stored = i32::from_le_bytes(record[4 * k..4 * k + 4].try_into().expect("4 bytes"));
            f64::from(stored) * double(131 + 8 * k) + double(155 + 8 * k)
        })
    }
}

/// GPS time of a record, adjusted standard, s.
pub fn gps_time_s(record: &[u8]) -> f64 {
    f64::from_le_bytes(record[22..30].try_into().expect("8 bytes"))
}
