//! Real packets of several LiDAR models, with the cloud of one revolution that the driver Nebula decoded from them.

use crate::support::bag::capture_of_bag;
use crate::support::sweeps;
use lidar::{Lidar, Model, SweepPoint, SweepReader, velodyne};
use std::collections::HashMap;
use std::path::Path;

/// A unit with its calibration file.
fn lidar(model: &str, calibration: &str) -> Lidar {
    let path = real_data::path(&format!("lidars/nebula/calibration/{calibration}"));
    let text = std::fs::read_to_string(path).expect("a file");
    Lidar::with_calibration(Model::from_name(model).expect("a model"), calibration, text).expect("a calibration")
}

/// Points of the driver: x y z, m, and the rest of the row.
fn driver_points(cloud: &str) -> Vec<([f32; 3], Vec<u8>)> {
    let bytes = std::fs::read(real_data::path(&format!("lidars/nebula/{cloud}"))).expect("a cloud");
    let mark = b"DATA binary\n";
    let begin = bytes.windows(mark.len()).position(|window| window == mark).expect("a header") + mark.len();
    let header = String::from_utf8_lossy(&bytes[..begin]).into_owned();
    let n: usize =
        header.lines().find_map(|line| line.strip_prefix("POINTS ")).expect("a number").parse().expect("a number");
    let f32_at = |row: &[u8], at: usize| f32::from_le_bytes(row[at..at + 4].try_into().expect("four bytes"));
    let rows = bytes[begin..].chunks_exact((bytes.len() - begin) / n);
    rows.map(|row| ([0, 4, 8].map(|at| f32_at(row, at)), row[12..].to_vec())).collect()
}

/// Our points: number of the revolution with the azimuth as its fraction, and the point.
fn turned_points(bag: &str, lidar: &Lidar, message: Option<usize>) -> (Vec<(f64, SweepPoint)>, SweepReader) {
    let folder = tempfile::tempdir().expect("a folder");
    let bag = real_data::path(&format!("lidars/nebula/{bag}"));
    let capture = capture_of_bag(&bag, &folder.path().join("a.pcap"), message);
    let mut reader = SweepReader::open(vec![capture.clone()], Some(lidar)).expect("opens");
    let mut points = Vec::new();
    for (info, returns) in sweeps(&mut reader) {
        for found in returns {
            let encoder = f64::from(found.azimuth) / 36_000.0;
            let direction = f64::from(-found.y).atan2(f64::from(found.x)) / std::f64::consts::TAU;
            let off = (direction - encoder + 0.5).rem_euclid(1.0) - 0.5;
            points.push((info.seq as f64 + encoder + off, found));
        }
    }
    check_detection(&capture, lidar);
    (points, reader)
}

/// The model is detected from its packets.
fn check_detection(capture: &Path, lidar: &Lidar) {
    let reader = SweepReader::open(vec![capture.to_owned()], None).expect("opens");
    assert_eq!(reader.model(), lidar.model());
}

/// Distances of the points of the driver to our points, one to one.
fn match_points(ours: &[[f32; 3]], theirs: &[[f32; 3]], limit_m: f32) -> f32 {
    let cell = |p: &[f32; 3]| p.map(|v| (v / 0.02).floor() as i32);
    let mut cells: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
    for (index, point) in ours.iter().enumerate() {
        cells.entry(cell(point)).or_default().push(index);
    }
    let mut used = vec![false; ours.len()];
    let mut worst = 0.0_f32;
    for point in theirs {
        let [i, j, k] = cell(point);
        let near = (-1..=1).flat_map(|a| (-1..=1).flat_map(move |b| (-1..=1).map(move |c| [i + a, j + b, k + c])));
        let distance = |index: usize| (0..3).map(|axis| (ours[index][axis] - point[axis]).abs()).fold(0.0, f32::max);
        let candidates = near.filter_map(|cell| cells.get(&cell)).flatten().copied().filter(|index| !used[*index]);
        let best = candidates.min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        let best = best.unwrap_or_else(|| panic!("no point near {point:?}"));
        assert!(distance(best) < limit_m, "{point:?}: {}", distance(best));
        (used[best], worst) = (true, worst.max(distance(best)));
    }
    worst
}

/// Compares the revolution `turn` with the driver's cloud. The driver cuts revolutions by the direction of each point, and skips ranges
/// below `min_m`. Its x is to the right, its y forward.
fn compare_hesai(bag: &str, cloud: &str, lidar: &Lidar, turn: f64, min_m: f32) {
    let (points, reader) = turned_points(bag, lidar, None);
    let stats = reader.stats();
    assert!(!stats.has_lost_data() && stats.foreign_packets == 0, "{stats:?}");
    let range_m = |p: &SweepPoint| (p.x * p.x + p.y * p.y + p.z * p.z).sqrt();
    let is_of_turn = |(at, p): &&(f64, SweepPoint)| (turn..turn + 1.0).contains(at) && range_m(p) > min_m - 1e-4;
    let ours: Vec<[f32; 3]> = points.iter().filter(is_of_turn).map(|(_, p)| [-p.y, p.x, p.z]).collect();
    let theirs: Vec<[f32; 3]> = driver_points(cloud).into_iter().map(|(point, _)| point).collect();
    assert_eq!(ours.len(), theirs.len());
    let worst_m = match_points(&ours, &theirs, 1e-4);
    eprintln!("{} points, worst {:.4} mm", ours.len(), worst_m * 1e3);
}

#[real_data::test("lidars/nebula/40p/1673400149412331409/1673400149412331409_0.db3")]
fn pandar40p_revolution_equals_driver_cloud() {
    let bag = "40p/1673400149412331409/1673400149412331409_0.db3";
    compare_hesai(bag, "40p/1673400149711850138.pcd", &lidar("pandar40p", "Pandar40P.csv"), 2.0, 0.3);
}

#[real_data::test("lidars/nebula/xt32/1673400677802009732/1673400677802009732_0.db3")]
fn pandar_xt32_revolution_equals_driver_cloud() {
    let bag = "xt32/1673400677802009732/1673400677802009732_0.db3";
    compare_hesai(bag, "xt32/1673400678101968885.pcd", &lidar("pandarxt32", "PandarXT32.csv"), 3.0, 0.05);
}

#[real_data::test("lidars/nebula/qt64/1673401195788312575/1673401195788312575_0.db3")]
fn pandar_qt64_revolution_equals_driver_cloud() {
    let bag = "qt64/1673401195788312575/1673401195788312575_0.db3";
    compare_hesai(bag, "qt64/1673401196087570870.pcd", &lidar("pandarqt64", "PandarQT64.csv"), 2.0, 0.1);
}

/// Compares our points with the points of the driver in order. `later_deg`: angle by which the driver turns the encoder
/// more than we do. The driver was configured to leave out the angles `left_out`. Between two blocks it turns the encoder
/// by their own difference, not by the median of the packet, and not at all in the last shots of a packet: some azimuths
/// differ by up to `step_deg`, the step from block to block.
fn compare_velodyne(
    ours: &[SweepPoint],
    theirs: &[([f32; 3], Vec<u8>)],
    later_deg: impl Fn(&SweepPoint) -> f64,
    step_deg: f64,
    left_out: impl Fn(u16) -> bool,
) {
    let polar = |[x, y, z]: [f32; 3]| {
        let across = x.hypot(y);
        (across.hypot(z), z.atan2(across).to_degrees(), f64::from(-y).atan2(f64::from(x)).to_degrees())
    };
    let mut next = 0;
    let mut n_turned = 0;
    let mut skipped = Vec::new();
    let mut worst = [0.0_f64; 3];
    for point in ours {
        let Some((of_driver, rest)) = theirs.get(next) else {
            skipped.push(point.azimuth);
            continue;
        };
        let (range_m, elevation, azimuth) = polar([point.x, point.y, point.z]);
        let (their_range_m, their_elevation, their_azimuth) = polar(*of_driver);
        let off_deg = (their_azimuth - azimuth + 180.0).rem_euclid(360.0) - 180.0;
        let off = [(their_range_m - range_m).abs(), (their_elevation - elevation).abs()].map(f64::from);
        // Intensity, return type and ring, where the cloud has them.
        let same_rest = rest.is_empty() || (rest[0], rest[2]) == (point.intensity, point.ring);
        if off[0] > 1e-4 || off[1] > 1e-3 || off_deg.abs() > 2.0 * step_deg || !same_rest {
            skipped.push(point.azimuth);
            continue;
        }
        next += 1;
        let after_turn_deg = (off_deg - later_deg(point)).abs();
        if after_turn_deg < 0.03 {
            n_turned += 1;
            worst = [worst[0].max(off[0]), worst[1].max(off[1]), worst[2].max(after_turn_deg)];
        } else {
            assert!(off_deg.abs() < step_deg, "{point:?}: {off_deg}");
        }
    }
    let share = f64::from(n_turned) / theirs.len() as f64;
    eprintln!(
        "{} points, worst {worst:?} (m, deg, deg) in {share:.3} of them, {} skipped",
        theirs.len(),
        skipped.len()
    );
    assert_eq!(next, theirs.len());
    // Ten of twelve blocks, if there are two echoes.
    assert!(share > 0.82, "{share}");
    assert!(skipped.iter().all(|azimuth| left_out(*azimuth)), "{:?}", skipped.iter().min());
}

#[real_data::test("lidars/nebula/vlp16/1673400471837873222/1673400471837873222_0.db3")]
fn vlp16_revolution_with_two_echoes_equals_driver_cloud() {
    let bag = "vlp16/1673400471837873222/1673400471837873222_0.db3";
    let (points, reader) = turned_points(bag, &lidar("vlp16", "VLP16.yaml"), None);
    assert!(!reader.stats().has_lost_data());
    let is_of_turn = |(at, _): &&(f64, SweepPoint)| (3.0..4.0).contains(at);
    let ours: Vec<SweepPoint> = points.iter().filter(is_of_turn).map(|(_, point)| *point).collect();
    compare_velodyne(
        &ours,
        &driver_points("vlp16/1673400472138016708.pcd"),
        |_| 0.0,
        0.41,
        |azimuth| (azimuth + 100) % 36_000 < 120,
    );
}

#[real_data::test("lidars/nebula/vlp32/1713492677464078412/1713492677464078412_0.db3")]
fn vlp32c_points_equal_driver_cloud() {
    let bag = "vlp32/1713492677464078412/1713492677464078412_0.db3";
    let unit = lidar("vlp32c", "VLP32.yaml");
    let rings = unit.rings();
    let laser_of_ring: Vec<usize> =
        (0..32).map(|ring| rings.iter().position(|of| *of == ring).expect("a laser")).collect();
    let (points, reader) = turned_points(bag, &unit, Some(0));
    assert!(!reader.stats().has_lost_data());
    // Lasers fire in pairs (manual 63-9325); the driver turns the encoder as if they fired one by one. A block is 20 counts.
    let later_deg = |point: &SweepPoint| {
        let laser = laser_of_ring[usize::from(point.ring)];
        (laser - laser / 2) as f64 * 2.304 / 55.296 * 0.2
    };
    let ours: Vec<SweepPoint> = points.iter().map(|(_, point)| *point).collect();
    compare_velodyne(&ours, &driver_points("vlp32/1713492677464078412.pcd"), later_deg, 0.21, |azimuth| {
        (9000..27_020).contains(&azimuth)
    });
}

#[real_data::test("velodyne/hdl64e_db.xml", "lidars/nebula/calibration/HDL64e_s3.yaml")]
fn calibration_files_of_velodyne_units_replace_the_table() {
    let text = std::fs::read_to_string(real_data::path("velodyne/hdl64e_db.xml")).expect("a file");
    let lasers = velodyne::lasers_from_file(&text, velodyne::Model::Hdl64e).expect("reads");
    for (found, table) in lasers.iter().zip(velodyne::Model::Hdl64e.lasers()) {
        let off = [
            found.elevation_deg - table.elevation_deg,
            found.azimuth_deg - table.azimuth_deg,
            found.range_m - table.range_m,
            found.up_m - table.up_m,
            found.left_m - table.left_m,
        ];
        assert!(off.iter().all(|off| off.abs() < 1e-6), "{found:?} {table:?}");
    }
    let [s2, s3] = ["HDL64e_s2.yaml", "HDL64e_s3.yaml"].map(|name| lidar("hdl64e", name));
    for unit in [&s2, &s3] {
        let elevations = unit.elevations_deg();
        assert_eq!(elevations.len(), 64);
        assert!(elevations.iter().all(|deg| (-26.0..6.0).contains(deg)), "{elevations:?}");
    }
    assert_ne!(s2.elevations_deg(), s3.elevations_deg());
    for (name, model) in [("HDL-32E.xml", velodyne::Model::Hdl32e), ("VLP-16.xml", velodyne::Model::Vlp16)] {
        let text = std::fs::read_to_string(real_data::path(&format!("velodyne/{name}"))).expect("a file");
        let lasers = velodyne::lasers_from_file(&text, model).expect("reads");
        let near = |(found, table): (&velodyne::Laser, &velodyne::Laser)| {
            (found.elevation_deg - table.elevation_deg).abs() < 0.01
        };
        assert_eq!(lasers.len(), model.lasers().len());
        assert!(lasers.iter().zip(model.lasers()).all(near), "{lasers:?}");
    }
}
