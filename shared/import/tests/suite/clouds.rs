//! Labeled clouds of other data sets, in the format in which they are published.

use crate::support::{error, folder, import_from, write_file};
use messages::pod::rows_from_bytes;
use messages::{
    ClassId, ClassRow, ColorRow, Envelope, MAX_SWEEPS_PER_SUBMAP, Message, StampedPose, SubmapHeader, SubmapPoint,
    SubmapTopic,
};
use recording::TickReader;
use std::io::Write;
use std::path::Path;

/// A street of 50 m along x: the ground, a wall at y = 8 m up to 6 m, a car. Position and kind of each point.
fn street() -> Vec<([f64; 3], Thing)> {
    let mut points = Vec::new();
    for i in 0..500 {
        let x = f64::from(i) * 0.1;
        // The vehicle drives along y = 0 and leaves the most points there.
        for k in -60..60_i32 {
            let y = f64::from(k.pow(3)) / 27_000.0;
            points.push(([x, y, 0.0], Thing::Ground));
        }
        for k in 1..30 {
            points.push(([x, 8.0, f64::from(k) * 0.2], Thing::Building));
        }
        if (20.0..24.0).contains(&x) {
            for k in 0..15 {
                points.push(([x, 3.0, 0.3 + f64::from(k) * 0.1], Thing::Car));
            }
        }
    }
    points
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Thing {
    Ground,
    Building,
    Car,
}

/// A PLY file: `property` lines and packed rows.
fn ply(properties: &str, n: usize, rows: &[u8]) -> Vec<u8> {
    let head = format!("ply\nformat binary_little_endian 1.0\nelement vertex {n}\n{properties}\nend_header\n");
    [head.as_bytes(), rows].concat()
}

fn properties(kind: &str, names: &str) -> String {
    let lines: Vec<String> = names.split(' ').map(|name| format!("property {kind} {name}")).collect();
    lines.join("\n")
}

/// Content of a tick of a recording.
struct Tile {
    header: SubmapHeader,
    points: Vec<SubmapPoint>,
    classes: Vec<ClassRow>,
    poses: Vec<StampedPose>,
}

fn rows<T: messages::Pod>(bytes: &[u8], header_bytes: usize) -> Vec<T> {
    rows_from_bytes(&bytes[size_of::<Envelope>() + header_bytes..]).expect("whole rows")
}

/// The submaps of a recording, which must have its end.
fn tiles(path: &Path) -> Vec<Tile> {
    let mut reader = TickReader::open(path, &["submap", "class", "trajectory"]).expect("opens");
    let mut tiles = Vec::new();
    while let Some(tick) = reader.next().expect("reads") {
        let [submap, class, trajectory] = &tick.messages[..] else { panic!("three topics") };
        if tick.row.end != 0 {
            assert!(submap.is_empty());
            continue;
        }
        let header_bytes = size_of::<<SubmapTopic as Message>::Header>();
        let header = rows_from_bytes(&submap[0].bytes[size_of::<Envelope>()..][..header_bytes]).expect("a header")[0];
        tiles.push(Tile {
            header,
            points: rows(&submap[0].bytes, header_bytes),
            classes: rows(&class[0].bytes, 16),
            poses: trajectory.iter().flat_map(|message| rows::<StampedPose>(&message.bytes, 8)).collect(),
        });
    }
    assert!(reader.ended(), "the recording has its last tick");
    tiles
}

/// The position of each point in the world and its class. Checks the common properties of all submaps.
fn placed(tiles: &[Tile]) -> Vec<([f64; 3], u8)> {
    let mut placed = Vec::new();
    for tile in tiles {
        assert_eq!(tile.points.len(), tile.classes.len());
        let header = &tile.header;
        let n_sweeps = header.n_sweeps as usize;
        assert!((1..=MAX_SWEEPS_PER_SUBMAP).contains(&n_sweeps));
        let mut first = 0;
        for (sweep_idx, sweep) in header.sweeps[..n_sweeps].iter().enumerate() {
            assert_eq!(sweep.first_point, first);
            first += sweep.n_points;
            let of_sweep = &tile.points[sweep.first_point as usize..first as usize];
            assert!(of_sweep.iter().all(|point| usize::from(point.sweep_idx) == sweep_idx));
            assert!(of_sweep.iter().all(|point| point.offset_nanos <= sweep.duration_nanos));
        }
        assert_eq!(first as usize, tile.points.len());
        assert_eq!(tile.poses.len(), 2 * n_sweeps);
        let origin = header.odom_from_submap.translation;
        for (point, class) in tile.points.iter().zip(&tile.classes) {
            let position = [point.x, point.y, point.z];
            assert!((0..3).all(|k| (header.min[k]..=header.max[k]).contains(&position[k])));
            placed.push((std::array::from_fn(|k| origin[k] + f64::from(position[k])), class.class_id));
        }
    }
    placed
}

fn sorted(mut points: Vec<([f64; 3], u8)>) -> Vec<[i64; 4]> {
    points.sort_by(|a, b| a.0.partial_cmp(&b.0).expect("finite"));
    let millimeters = |(p, class): ([f64; 3], u8)| {
        let [x, y, z] = p.map(|value| (value * 1e3).round() as i64);
        [x, y, z, i64::from(class)]
    };
    let mut points: Vec<[i64; 4]> = points.into_iter().map(millimeters).collect();
    points.sort_unstable();
    points
}

/// The expected street in a recording, minus an origin.
fn expected(class: fn(Thing) -> ClassId, origin: [f64; 3]) -> Vec<[i64; 4]> {
    let point = |(p, thing): ([f64; 3], Thing)| (std::array::from_fn(|k| p[k] - origin[k]), class(thing) as u8);
    sorted(street().into_iter().map(point).collect())
}

fn class_of(thing: Thing) -> ClassId {
    match thing {
        Thing::Ground => ClassId::Road,
        Thing::Building => ClassId::Building,
        Thing::Car => ClassId::Vehicles,
    }
}

/// The scanner is 2 m above the road, level with the point along the road, and drives at 5 m/s.
fn scanner(p: [f64; 3]) -> ([f64; 3], f64) {
    ([p[0], 0.0, 2.0], 100.0 + p[0] / 5.0)
}

fn paris_carla(points: &[([f64; 3], Thing)]) -> Vec<u8> {
    let mut rows = Vec::new();
    for (p, thing) in points {
        let (scanner, time_s) = scanner(*p);
        let values = [p[0], p[1], p[2], scanner[0], scanner[1], scanner[2], 0.5, time_s];
        rows.extend(values.iter().flat_map(|value| (*value as f32).to_le_bytes()));
        let instance = u32::from(*thing == Thing::Car) * 77;
        for value in [0, instance, class_of(*thing) as u32, 0] {
            rows.extend(value.to_le_bytes());
        }
        rows.extend([1, 2, 3]);
    }
    let names = "x y z x_lidar_position y_lidar_position z_lidar_position cos_angle_lidar_surface timestamp";
    let list = [
        properties("float", names),
        properties("uint", "index_frame instance semantic semantic_image"),
        properties("uchar", "red green blue"),
    ];
    ply(&list.join("\n"), points.len(), &rows)
}

#[test]
fn paris_carla_becomes_submaps_with_true_positions_and_classes() {
    let folder = folder();
    let source = folder.path().join("Paris");
    let mut points = street();
    // Published files need not be sorted by time.
    points.reverse();
    write_file(&source.join("Soufflot0.ply"), paris_carla(&points));
    let mut import = import_from(&source, &folder);
    let refused = error(&import);
    assert!(refused.contains("Paris-CARLA-3D becomes a recording; its name must end in .mcap"), "{refused}");
    import.out = folder.path().join("drive.mcap");
    let report = import.run().expect("imports").join("\n");
    for words in [
        "drive.mcap: 3 submaps (Paris-CARLA-3D)",
        "imported: positions of the scanner and times, as 100 sweeps of 0.1 s",
        "not imported: columns index_frame, semantic_image",
        "points without a class: 0 (0.0 %)",
    ] {
        assert!(report.contains(words), "{words:?} is not in\n{report}");
    }
    let tiles = tiles(&import.out);
    assert_eq!(sorted(placed(&tiles)), expected(class_of, [0.0; 3]));
    assert_eq!(tiles.len(), 3, "50 m in tiles of 20 m");
    for tile in &tiles {
        for pose in &tile.poses {
            let [x, y, z] = pose.odom_from_body.translation;
            assert!(y.abs() < 1e-6 && (z - 2.0).abs() < 1e-6, "{pose:?}");
            let time_s = pose.stamp as f64 * 1e-9;
            // Times are stored as f32.
            assert!((time_s - (100.0 + x / 5.0)).abs() < 1e-4, "{pose:?}");
        }
        let origin = tile.header.odom_from_submap.translation;
        for point in &tile.points {
            let [x, y, z] = [point.x, point.y, point.z].map(f64::from);
            assert_eq!(point.incidence, 127);
            // The scanner is level with the point along the road: the ray has no component along the road.
            let ray = [origin[1] + y, origin[2] + z - 2.0];
            let elevation_deg = ray[1].atan2(ray[0].abs()).to_degrees();
            assert!((elevation_deg - f64::from(point.elevation) * 0.01).abs() < 0.02, "{point:?} {elevation_deg} {x}");
            let side = if ray[0] > 1e-3 { 27_000 } else { 9_000 };
            assert!(ray[0].abs() <= 1e-3 || point.azimuth.abs_diff(side) < 5, "{point:?} {ray:?}");
        }
    }
    let mut ids = TickReader::open(&import.out, &["instance"]).expect("has instances");
    let mut n_of_car = 0;
    while let Some(tick) = ids.next().expect("reads") {
        for message in &tick.messages[0] {
            n_of_car += rows::<u32>(&message.bytes, 8).iter().filter(|id| **id == 77).count();
        }
    }
    assert_eq!(n_of_car, 40 * 15);
    let n_points: usize = tiles.iter().map(|tile| tile.points.len()).sum();
    assert_eq!(colors(&import.out), vec![ColorRow { r: 1, g: 2, b: 3, camera: 0 }; n_points]);
}

/// All colors of a recording.
fn colors(path: &Path) -> Vec<ColorRow> {
    let mut reader = TickReader::open(path, &["color"]).expect("has colors");
    let mut found = Vec::new();
    while let Some(tick) = reader.next().expect("reads") {
        tick.messages[0].iter().for_each(|message| found.extend(rows::<ColorRow>(&message.bytes, 8)));
    }
    found
}

#[test]
fn colors_follow_their_points_and_are_left_out_if_a_file_has_none() {
    let folder = folder();
    let source = folder.path().join("Toronto");
    let color_of = |p: [f64; 3]| [40, 7, (p[2] * 10.0).round() as u8];
    write_file(&source.join("L001.ply"), toronto(Some(&color_of)));
    let mut import = import_from(&source, &folder);
    import.out = folder.path().join("toronto.mcap");
    import.run().expect("imports");
    let mut n_checked = 0;
    let points = tiles(&import.out).into_iter().flat_map(|tile| {
        let z = tile.header.odom_from_submap.translation[2] - TORONTO_M[2];
        tile.points.into_iter().map(move |point| f64::from(point.z) + z)
    });
    for (z, color) in points.zip(colors(&import.out)) {
        assert_eq!([color.r, color.g, color.b], color_of([0.0, 0.0, z]));
        n_checked += 1;
    }
    assert_eq!(n_checked, street().len());

    write_file(&source.join("L002.ply"), toronto(None));
    import.out = folder.path().join("both.mcap");
    let report = import.run().expect("imports").join("\n");
    assert!(report.contains("not imported: colors, which only 1 of 2 files have"), "{report}");
    assert!(TickReader::open(&import.out, &["color"]).is_err(), "no colors");
}

#[test]
fn files_that_begin_at_the_same_time_follow_each_other() {
    let folder = folder();
    let source = folder.path().join("CARLA");
    write_file(&source.join("Town01.ply"), paris_carla(&street()));
    write_file(&source.join("Town02.ply"), paris_carla(&street()));
    let mut import = import_from(&source, &folder);
    import.out = folder.path().join("drive.mcap");
    import.run().expect("imports");
    let tiles = tiles(&import.out);
    let stamps: Vec<i64> = tiles.iter().flat_map(|tile| tile.poses.iter().map(|pose| pose.stamp)).collect();
    assert!(stamps.is_sorted(), "{stamps:?}");
    let seqs: Vec<u64> = tiles
        .iter()
        .flat_map(|tile| tile.header.sweeps[..tile.header.n_sweeps as usize].iter().map(|sweep| sweep.seq))
        .collect();
    assert_eq!(seqs, (0..200).collect::<Vec<u64>>());
    // The same import gives the same bytes.
    let first = std::fs::read(&import.out).expect("reads");
    std::fs::remove_file(&import.out).expect("removes");
    import.run().expect("imports");
    assert!(std::fs::read(&import.out).expect("reads") == first);
    assert!(!folder.path().join("drive.mcap.partial").exists());
}

#[test]
fn paris_lille_is_read_in_both_forms() {
    let folder = folder();
    let tree = |thing: Thing| match thing {
        Thing::Ground => 202_020_000_u32,
        Thing::Building => 203_000_000,
        Thing::Car => 303_040_204,
    };
    let mut rows = Vec::new();
    for (p, thing) in street() {
        let (scanner, time_s) = scanner(p);
        rows.extend([p, scanner].as_flattened().iter().flat_map(|value| (*value as f32).to_le_bytes()));
        rows.extend((time_s + 40_000.0).to_le_bytes());
        rows.push(130);
        rows.extend(9_u32.to_le_bytes());
        rows.extend(tree(thing).to_le_bytes());
    }
    let list = [
        properties("float", "x y z x_origin y_origin z_origin"),
        properties("double", "GPS_time"),
        properties("uchar", "reflectance"),
        properties("uint", "label class"),
    ];
    let whole = folder.path().join("Lille1.ply");
    write_file(&whole, ply(&list.join("\n"), street().len(), &rows));
    let mut import = import_from(&whole, &folder);
    import.out = folder.path().join("whole.mcap");
    let report = import.run().expect("imports").join("\n");
    assert!(report.contains("(Paris-Lille-3D)") && report.contains("as 100 sweeps"), "{report}");
    let found = tiles(&import.out);
    assert_eq!(sorted(placed(&found)), expected(class_of, [0.0; 3]));
    assert!(found.iter().flat_map(|tile| &tile.points).all(|point| point.intensity == 130));

    // The benchmark has neither positions nor times.
    let mut rows = Vec::new();
    for (p, thing) in street() {
        rows.extend(p.iter().flat_map(|value| (*value as f32).to_le_bytes()));
        rows.push(130);
        let class: i32 = match thing {
            Thing::Ground => 1,
            Thing::Building => 2,
            Thing::Car => 8,
        };
        rows.extend(class.to_le_bytes());
    }
    let list = [properties("float", "x y z"), properties("uchar", "reflectance"), properties("int", "class")];
    let reduced = folder.path().join("Lille1_1.ply");
    write_file(&reduced, ply(&list.join("\n"), street().len(), &rows));
    import.source = reduced;
    import.out = folder.path().join("reduced.mcap");
    let report = import.run().expect("imports").join("\n");
    assert!(report.contains("the files have no positions of the scanner"), "{report}");
    let ground = |thing: Thing| if thing == Thing::Ground { ClassId::Ground } else { class_of(thing) };
    assert_eq!(sorted(placed(&tiles(&import.out))), expected(ground, [0.0; 3]));
}

/// Place of the street in map coordinates.
const TORONTO_M: [f64; 3] = [627_285.0, 4_841_948.0, 140.0];

/// The street as a cloud of Toronto-3D.
fn toronto(color: Option<&dyn Fn([f64; 3]) -> [u8; 3]>) -> Vec<u8> {
    let mut rows = Vec::new();
    for (p, thing) in street() {
        rows.extend((0..3).flat_map(|k| (p[k] + TORONTO_M[k]).to_le_bytes()));
        rows.extend(color.into_iter().flat_map(|color| color(p)));
        let label = match thing {
            Thing::Ground => 1.0,
            Thing::Building => 4.0,
            Thing::Car => 7.0,
        };
        for value in [31.0_f32, 324_786.78, -4.0, label] {
            rows.extend(value.to_le_bytes());
        }
    }
    let mut list = vec![properties("double", "x y z")];
    list.extend(color.map(|_| properties("uchar", "red green blue")));
    list.push(properties("float", "scalar_Intensity scalar_GPSTime scalar_ScanAngleRank scalar_Label"));
    ply(&list.join("\n"), street().len(), &rows)
}

#[test]
fn toronto_gets_positions_above_its_densest_ground() {
    let folder = folder();
    let source = folder.path().join("Toronto_3D");
    write_file(&source.join("L001.ply"), toronto(Some(&|_| [90; 3])));
    let mut import = import_from(&source, &folder);
    import.out = folder.path().join("toronto.mcap");
    let report = import.run().expect("imports").join("\n");
    assert!(report.contains("coordinates are reduced by 627000 4841000 m (x, y)"), "{report}");
    assert!(report.contains("are invented, 2 m above the ground"), "{report}");
    let found = tiles(&import.out);
    let origin = [627_000.0 - TORONTO_M[0], 4_841_000.0 - TORONTO_M[1], -TORONTO_M[2]];
    assert_eq!(sorted(placed(&found)), expected(class_of, origin));
    for pose in found.iter().flat_map(|tile| &tile.poses) {
        let [_, y, z] = pose.odom_from_body.translation;
        // The cells at y = 0, where the street is densest.
        assert!((y - 948.0).abs() <= 1.0 && (z - 142.0).abs() < 1e-6, "{pose:?}");
    }
    // A range image needs rings: every point has a ring, and most points have a fine one.
    let points = || found.iter().flat_map(|tile| &tile.points);
    assert!(points().all(|point| u32::from(point.ring) < found[0].header.n_rings));
    let n_fine = points().filter(|point| (16..48).contains(&point.ring)).count();
    assert!(n_fine * 10 > points().count() * 9, "{n_fine} of {} points have fine rings", points().count());
}

#[test]
fn street3d_is_read_as_text_with_or_without_a_title() {
    let folder = folder();
    let line = |(p, thing): ([f64; 3], Thing)| {
        let class = match thing {
            Thing::Building => 1,
            Thing::Car => 2,
            Thing::Ground => 3,
        };
        format!("{:.4} {:.4} {:.4} {class}\n", p[0], p[1], p[2])
    };
    let text: String = street().into_iter().map(line).collect();
    let source = folder.path().join("train");
    write_file(&source.join("5D4KVPBP.txt"), &text);
    let mut import = import_from(&source, &folder);
    import.out = folder.path().join("a.mcap");
    import.run().expect("imports");
    let ground = |thing: Thing| if thing == Thing::Ground { ClassId::Ground } else { class_of(thing) };
    let found = sorted(placed(&tiles(&import.out)));
    // The invented positions are not multiples of a millimeter, and coordinates are f32.
    for (found, expected) in found.iter().zip(expected(ground, [0.0; 3])) {
        assert!((0..3).all(|k| found[k].abs_diff(expected[k]) <= 1) && found[3] == expected[3]);
    }
    write_file(&source.join("5D4KVPBP.txt"), format!("//X Y Z Label\n{text}"));
    import.out = folder.path().join("b.mcap");
    import.run().expect("imports");
    assert_eq!(sorted(placed(&tiles(&import.out))), found);

    write_file(&source.join("5D4KVPBP.txt"), format!("{text}1.0 2.0 3.0\n"));
    import.out = folder.path().join("drive.mcap");
    let refused = error(&import);
    assert!(refused.contains("\"1.0 2.0 3.0\" must be 4 numbers, as in the previous lines"), "{refused}");
}

#[test]
fn oakland_is_read_as_plain_or_compressed_text() {
    let folder = folder();
    let line = |(p, thing): ([f64; 3], Thing)| {
        let label = match thing {
            Thing::Building => 1400,
            Thing::Car => 1501,
            Thing::Ground => 1203,
        };
        format!("{:.4} {:.4} {:.4} {label} 2\n", p[0], p[1], p[2])
    };
    let text: String = street().into_iter().map(line).collect();
    let plain = folder.path().join("block_1.xyz_label_conf");
    write_file(&plain, &text);
    let mut import = import_from(&plain, &folder);
    import.out = folder.path().join("a.mcap");
    import.run().expect("imports");
    let road = |thing: Thing| if thing == Thing::Ground { ClassId::Road } else { class_of(thing) };
    let found = sorted(placed(&tiles(&import.out)));
    for (found, expected) in found.iter().zip(expected(road, [0.0; 3])) {
        assert!((0..3).all(|k| found[k].abs_diff(expected[k]) <= 1) && found[3] == expected[3]);
    }
    let compressed = folder.path().join("gz/block_1.xyz_label_conf.gz");
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(text.as_bytes()).expect("compresses");
    let bytes = encoder.finish().expect("compresses");
    write_file(&compressed, &bytes);
    import.source = folder.path().join("gz");
    import.out = folder.path().join("b.mcap");
    import.run().expect("imports");
    assert_eq!(sorted(placed(&tiles(&import.out))), found);

    write_file(&compressed, &bytes[..bytes.len() / 2]);
    import.out = folder.path().join("c.mcap");
    let refused = error(&import);
    assert!(refused.contains("block_1.xyz_label_conf.gz"), "{refused}");
}

#[test]
fn damaged_or_foreign_clouds_are_refused() {
    let folder = folder();
    let source = folder.path().join("Soufflot0.ply");
    let whole = paris_carla(&street());
    let mut import = import_from(&source, &folder);
    import.out = folder.path().join("drive.mcap");
    write_file(&source, &whole[..whole.len() / 2]);
    import.options.kind = import::Kind::from_name("paris-carla-3d");
    assert!(error(&import).contains("Soufflot0.ply"), "{}", error(&import));

    write_file(&source, paris_carla(&[]));
    assert!(error(&import).contains("has no valid points"), "{}", error(&import));

    let far: Vec<_> = street().into_iter().map(|(p, thing)| ([p[0] * 1e12, p[1], p[2]], thing)).collect();
    write_file(&source, paris_carla(&far));
    // Only the points at x = 0 are left.
    import.out = folder.path().join("far.mcap");
    let report = import.run().expect("imports").join("\n");
    assert!(report.contains("points whose numbers are not finite or too large: 74"), "{report}");

    import.options.lidar_only = true;
    import.out = folder.path().join("other.mcap");
    assert!(error(&import).contains("--model and --lidar-only: Paris-CARLA-3D has no sweeps of a LiDAR"));
}
