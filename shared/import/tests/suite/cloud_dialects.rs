//! Clouds of other writers: units, names, types and frames that differ from the page of the drive folder.

use super::las_file;
use super::support::{Import, error, folder, import_from, write_file};
use drive::Drive;
use lidar::SweepPoint;
use std::path::Path;
use tempfile::TempDir;

/// Points of a revolution: position, beam from the lowest, part of the revolution.
fn revolution() -> Vec<([f64; 3], u8, f64)> {
    let one = |k: usize| {
        let beam = (k % 16) as u8;
        let elevation = (2.0 * f64::from(beam) - 15.0).to_radians();
        let part = k as f64 / 1600.0;
        let azimuth = -part * std::f64::consts::TAU;
        let [sin, cos] = [elevation.sin(), elevation.cos()];
        ([9.0 * cos * azimuth.cos(), 9.0 * cos * azimuth.sin(), 9.0 * sin], beam, part)
    };
    (0..1600).map(one).collect()
}

/// An ASCII PCD of these fields, `NAME:TYPE+SIZE`, with two sweeps 0.1 s apart. The whole part of a row's part is the
/// sweep.
fn pcd_import(folder: &TempDir, name: &str, fields: &[&str], row: impl Fn([f64; 3], u8, f64) -> String) -> Import {
    let source = folder.path().join(name);
    let parts: Vec<(&str, &str)> = fields.iter().filter_map(|field| field.split_once(':')).collect();
    let line = |word: fn(&(&str, &str)) -> String| parts.iter().map(word).collect::<Vec<_>>().join(" ");
    let head = format!(
        "VERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nPOINTS 1600\nDATA ascii\n",
        line(|(name, _)| (*name).to_owned()),
        line(|(_, kind)| kind[1..].to_owned()),
        line(|(_, kind)| kind[..1].to_owned()),
    );
    for sweep in 0..2 {
        let part_of = |part: f64| part + f64::from(sweep);
        let rows = revolution().into_iter().map(|(position, beam, part)| row(position, beam, part_of(part)) + "\n");
        let name = format!("1583836591.{}00000000.PCD", sweep + 1);
        write_file(&source.join(name), head.clone() + &rows.collect::<String>());
    }
    let mut import = import_from(&source, folder);
    import.out = folder.path().join(format!("{name}.drive"));
    import.options.model = lidar::Model::from_name("vlp16");
    import
}

fn imported(import: &Import) -> (Vec<String>, Drive, String) {
    let report = import.run().expect("imports");
    let manifest = std::fs::read_to_string(import.out.join("drive.toml")).expect("reads");
    (report, Drive::open(&import.out).expect("opens"), manifest)
}

fn returns(drive: &Drive) -> Vec<SweepPoint> {
    let mut found = Vec::new();
    let mut source = drive.sweeps().expect("opens");
    source.next_sweep(|some| found.extend_from_slice(some)).expect("reads").expect("a sweep");
    assert_eq!(source.damage(), <[String; 0]>::default());
    found
}

const XYZ: [&str; 3] = ["x:F4", "y:F4", "z:F4"];

#[test]
fn pcd_of_other_drivers_has_the_times_and_rings_of_its_points() {
    let folder = folder();
    let position = |[x, y, z]: [f64; 3]| format!("{x:.6} {y:.6} {z:.6}");
    let time = |unit: f64, first: f64, part: f64| format!("{:.9}", first + unit * 0.1 * part);
    for (name, fields, unit, first) in [
        ("livox", ["reflectivity:F4", "line:U1", "offset_time:U4"], 1e9, 0.0),
        ("us", ["intensity:F4", "ring:U2", "t:U4"], 1e6, 0.0),
        ("seconds", ["intensity:F4", "ring:U2", "t:F4"], 1.0, 0.0),
        ("hesai", ["intensity:F4", "ring:U2", "timestamp:F8"], 1.0, 1_583_836_591.1),
        ("upper", ["Intensity:F4", "Ring:U2", "T:U4"], 1e9, 0.0),
        ("falling", ["intensity:F4", "ring:U2", "t:U4"], 1e9, 0.0),
    ] {
        let fields = [&XYZ[..], &fields].concat();
        let is_whole = unit > 1.0;
        let import = pcd_import(&folder, name, &fields, |at, beam, part| {
            let time = time(unit, first, if name == "hesai" { part } else { part.fract() });
            let time = if is_whole { time.split('.').next().unwrap_or_default().to_owned() } else { time };
            let ring = if name == "falling" { 15 - beam } else { beam };
            format!("{} {} {ring} {time}", position(at), 2 * beam)
        });
        let (_, drive, manifest) = imported(&import);
        let found = returns(&drive);
        assert!(!manifest.contains("intensity_scale") && !manifest.contains("map_origin"), "{name}: {manifest}");
        assert_eq!(found.len(), 1600, "{name}");
        for (point, (_, beam, part)) in found.iter().zip(revolution()) {
            let nanos = (part * 1e8).round();
            assert!((f64::from(point.offset_nanos) - nanos).abs() < 1100.0, "{name}: {} {nanos}", point.offset_nanos);
            assert_eq!((point.ring, point.intensity), (beam, 2 * beam), "{name}");
        }
    }
}

#[test]
fn negative_times_belong_to_stamps_at_the_end_of_the_sweep() {
    let folder = folder();
    let fields = [&XYZ[..], &["time:F4"]].concat();
    let import = pcd_import(&folder, "negative", &fields, |[x, y, z], _, part| {
        format!("{x:.6} {y:.6} {z:.6} {:.9}", 0.1 * part.fract() - 0.1)
    });
    let (_, drive, _) = imported(&import);
    let mut source = drive.sweeps().expect("opens");
    let mut first = None;
    let sweep = source.next_sweep(|points| first = first.or(points.first().map(|point| point.offset_nanos)));
    let sweep = sweep.expect("reads").expect("a sweep");
    assert_eq!(sweep.stamp.0 + i64::from(first.expect("a point")), 1_583_836_591_000_000_000);
}

#[test]
fn intensities_of_16_bits_get_one_scale_that_the_drive_names() {
    let folder = folder();
    let fields = [&XYZ[..], &["intensity:U2"]].concat();
    for (name, step, scale) in [("spread", 257, 1.0 / 257.0), ("counts", 120, 1.0 / 8.0)] {
        let import = pcd_import(&folder, name, &fields, |[x, y, z], beam, _| {
            format!("{x:.6} {y:.6} {z:.6} {}", step * u32::from(beam))
        });
        let (report, drive, manifest) = imported(&import);
        assert!(report.iter().any(|line| line.starts_with("intensities: intensity (u16, up to ")), "{report:?}");
        assert!(manifest.contains(&format!("intensity_scale = {scale}")), "{manifest}");
        let expected = |beam: u8| (f64::from(step * u32::from(beam)) * scale).round() as u8;
        assert!(returns(&drive).iter().all(|point| point.intensity == expected(point.ring)), "{name}");
        // A user's scale has priority.
        let path = import.out.join("drive.toml");
        let text = manifest.replace(&format!("intensity_scale = {scale}"), "intensity_scale = 0.001");
        std::fs::write(&path, text).expect("writes");
        let drive = Drive::open(&import.out).expect("opens");
        assert!(returns(&drive).iter().all(|point| point.intensity < 5), "{name}");
    }
    let rows: Vec<las_file::Row> = revolution()
        .into_iter()
        .map(|(position, beam, part)| (position, u16::from(beam) * 257 * 16, 300_000.0 + 0.1 * part))
        .collect();
    let source = folder.path().join("las");
    write_file(&source.join("1583836591182590976.LAS"), las_file::las(&rows, false));
    let mut import = import_from(&source, &folder);
    import.out = folder.path().join("las.drive");
    import.options.model = lidar::Model::from_name("vlp16");
    let (_, drive, manifest) = imported(&import);
    assert!(manifest.contains("intensity_scale = 0.0038910505836575876"), "{manifest}");
    assert!(returns(&drive).iter().all(|point| point.intensity == point.ring * 16));
}

#[test]
fn map_coordinates_keep_their_precision_or_are_refused() {
    let folder = folder();
    let origin = [452_150.0, 5_410_700.0, 94.0];
    let on_map = |at: [f64; 3]| {
        let [x, y, z] = [0, 1, 2].map(|axis| at[axis] + origin[axis]);
        format!("{x:.6} {y:.6} {z:.6}")
    };
    let import = pcd_import(&folder, "double", &["x:F8", "y:F8", "z:F8"], |at, _, _| on_map(at));
    let (report, drive, manifest) = imported(&import);
    assert!(manifest.contains("map_origin = [452150, 5410700, 94]"), "{manifest}");
    assert!(report.iter().any(|line| line.starts_with("map coordinates: 452150 5410700 94 m")), "{report:?}");
    let check = |points: &[SweepPoint]| {
        assert_eq!(points.len(), 1600);
        for (point, ([x, y, z], ..)) in points.iter().zip(revolution()) {
            for (found, expected) in [(point.x, x), (point.y, y), (point.z, z)] {
                assert!((f64::from(found) - expected).abs() < 1e-4, "{found} {expected}");
            }
        }
    };
    check(&returns(&drive));
    let ply = |kind: &str| {
        let head = format!(
            "ply\nformat ascii 1.0\nelement vertex 1600\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\nend_header\n"
        );
        head + &revolution().into_iter().map(|(at, ..)| on_map(at) + "\n").collect::<String>()
    };
    write_file(&folder.path().join("ply/000000.ply"), ply("double"));
    let mut import = import_from(folder.path().join("ply"), &folder);
    import.out = folder.path().join("ply.drive");
    let (_, drive, manifest) = imported(&import);
    assert!(manifest.contains("map_origin = [452150, 5410700, 94]"), "{manifest}");
    check(&returns(&drive));

    let import = pcd_import(&folder, "single", &XYZ, |at, _, _| on_map(at));
    let rule = "5410700 m is a map coordinate, stored as f32 in steps of 0.5 m; export the sweeps in the frame";
    let text = error(&import);
    assert!(text.contains("a run cannot read its sweeps, 2 of 2") && text.contains(rule), "{text}");
    write_file(&folder.path().join("ply/000000.ply"), ply("float"));
    let mut import = import_from(folder.path().join("ply"), &folder);
    import.out = folder.path().join("ply_single.drive");
    assert!(error(&import).contains(rule), "{}", error(&import));
}

#[test]
fn map_of_a_drive_and_unreadable_files_are_not_sweeps() {
    let folder = folder();
    let import = pcd_import(&folder, "map", &XYZ, |[x, y, z], _, _| format!("{} {} {z}", 100.0 * x, 100.0 * y));
    let text = error(&import);
    assert!(text.contains("of the points are more than 300 m from the origin of the LiDAR: a map"), "{text}");
    assert!(!import.out.exists());
    let import = pcd_import(&folder, "twice", &XYZ, |[x, y, z], _, _| format!("{x} {y} {z}"));
    for file in std::fs::read_dir(folder.path().join("twice")).expect("lists") {
        let path = file.expect("is there").path();
        let text =
            std::fs::read_to_string(&path).expect("reads").replace("POINTS 1600", "WIDTH 4\nHEIGHT 4\nPOINTS 1600");
        write_file(Path::new(&path), text);
    }
    let text = error(&import);
    assert!(text.contains("POINTS 1600, but WIDTH 4 times HEIGHT 4"), "{text}");
}
