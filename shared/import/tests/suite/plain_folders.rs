//! Imports of folders of sweeps with stamps, poses and IMU samples next to them.

use super::las_file;
use super::support::{Import, error, folder, import_from, write_file};
use drive::Drive;
use formats::cloud::CloudPoint;
use formats::pcd::pcd_from_points;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Start, ns.
const BEGIN: i64 = 1_583_836_591_182_590_976;

fn points(x: f32) -> Vec<CloudPoint> {
    (0..3).map(|i| CloudPoint { x, y: i as f32, z: 0.5, intensity: 40.0 * (i + 1) as f32 }).collect()
}

/// Sweeps with these names; the point of sweep k is k + 5 m in front.
fn sweeps(folder: &TempDir, names: &[&str]) -> PathBuf {
    let root = folder.path().join("recording/scans");
    for (k, name) in names.iter().enumerate() {
        write_file(&root.join(format!("{name}.pcd")), pcd_from_points(&points(k as f32 + 5.0)));
    }
    root
}

fn imported(import: &Import) -> (Vec<String>, Drive) {
    let report = import.run().expect("imports");
    (report, Drive::open(&import.out).expect("opens"))
}

/// Stamps after the start, ns, and distances of the first points, m.
fn sweeps_of(drive: &Drive) -> Vec<(i64, f32)> {
    let mut source = drive.sweeps().expect("opens");
    let mut found = Vec::new();
    loop {
        let mut first = None;
        let sweep = source.next_sweep(|returns| first = first.or(returns.first().map(|r| r.x))).expect("reads");
        let Some(sweep) = sweep else { return found };
        found.push((sweep.stamp.0 - BEGIN, first.expect("has points")));
    }
}

#[test]
fn stamps_in_names_give_the_order_of_the_sweeps() {
    let folder = folder();
    // Names as in Newer College, and numbers that sort differently as text.
    for names in [
        ["cloud_1583836591_182590976", "cloud_1583836591_282590976", "cloud_1583836592_82590976"],
        ["b_1583836591182590976", "c_1583836591282590976", "a_1583836592082590976"],
        ["1583836591.182590976", "1583836591.282590976", "1583836592.082590976"],
    ] {
        let source = sweeps(&folder, &names);
        let import = import_from(&source, &folder);
        let (report, drive) = imported(&import);
        assert!(report[1].contains("3 sweeps and their times"), "{report:?}");
        assert_eq!(sweeps_of(&drive), [(0, 5.0), (100_000_000, 6.0), (900_000_000, 7.0)]);
        std::fs::remove_dir_all(source).expect("removes");
        std::fs::remove_dir_all(import.out).expect("removes");
    }
}

#[test]
fn stamps_of_a_table_are_those_of_the_lines_or_of_the_names() {
    let by_line = "1583836591.182590976\n1583836591.282590976\n1583836592.082590976\n";
    let by_name =
        "# made by hand\nstamp,file\n1583836592082590976,2.pcd\n1583836591182590976,0.pcd\n1583836591282590976,1.pcd\n";
    let with_spaces = "0 1583836591.182590976\n1 1583836591.282590976\n2 1583836592.082590976\n";
    for (place, text) in [("times.txt", by_line), ("../timestamps.csv", by_name), ("timestamps.txt", with_spaces)] {
        let folder = folder();
        let source = sweeps(&folder, &["0", "1", "2"]);
        write_file(&source.join(place), text);
        let (report, drive) = imported(&import_from(&source, &folder));
        assert_eq!(sweeps_of(&drive), [(0, 5.0), (100_000_000, 6.0), (900_000_000, 7.0)], "{place}");
        assert!(!report.iter().any(|line| line.starts_with("not imported")), "{report:?}");
    }
}

#[test]
fn numbers_without_zeros_are_in_the_order_of_their_values_and_get_the_stamps_of_their_lines() {
    let folder = folder();
    let names: Vec<String> = (0..12).map(|number| format!("full{number}")).collect();
    let source = sweeps(&folder, &names.iter().map(String::as_str).collect::<Vec<_>>());
    let lines: Vec<String> = (0..12).map(|k| format!("{}.{}", 1_583_836_591 + k / 10, k % 10)).collect();
    write_file(&source.join("times.txt"), lines.join("\n"));
    let (_, drive) = imported(&import_from(&source, &folder));
    let found = sweeps_of(&drive);
    assert!(found.iter().enumerate().all(|(k, (_, x))| *x == 5.0 + k as f32), "{found:?}");
    assert!(found.windows(2).all(|pair| pair[1].0 - pair[0].0 == 100_000_000), "{found:?}");
}

#[test]
fn decimal_commas_and_columns_of_ns_give_the_fraction_of_the_second() {
    let comma = "name;stamp\n0.pcd;1583836591,25\n1.pcd;1583836592,5\n2.pcd;1583836593,75\n";
    let nsec = "file,sec,nsec\n0.pcd,1583836591,250000000\n1.pcd,1583836592,500000000\n2.pcd,1583836593,750000000\n";
    for text in [comma, nsec] {
        let folder = folder();
        let source = sweeps(&folder, &["0", "1", "2"]);
        write_file(&source.join("timestamps.csv"), text);
        let (_, drive) = imported(&import_from(&source, &folder));
        let stamps: Vec<i64> = sweeps_of(&drive).into_iter().map(|(stamp, _)| stamp - 67_409_024).collect();
        assert_eq!(stamps, [0, 1_250_000_000, 2_500_000_000], "{text}");
    }
    // With fewer than nine digits, only a header shows that they are ns. It may be a comment.
    for header in ["file,sec,nsec", "# file,sec,nsec"] {
        let folder = folder();
        let source = sweeps(&folder, &["0", "1"]);
        write_file(
            &source.join("timestamps.csv"),
            format!("{header}\n0.pcd,1583836591,5000000\n1.pcd,1583836591,105000000\n"),
        );
        let (_, drive) = imported(&import_from(&source, &folder));
        let stamps: Vec<i64> = sweeps_of(&drive).into_iter().map(|(stamp, _)| stamp).collect();
        assert_eq!(stamps[1] - stamps[0], 100_000_000, "{header}");
    }
}

#[test]
fn implausible_stamps_are_refused() {
    for (file, text, rule) in [
        (
            "times.csv",
            "0.pcd,1583836591,4\n1.pcd,1583836592,11\n2.pcd,1583836593,18\n",
            "times.csv:1: \"1583836591\" and \"4\" may be",
        ),
        (
            "times.txt",
            "1583836591.1\n1583836591.2\n1583835991.3\n",
            "times.txt:3: stamp 1583835991300000000 ns is 599.900000 s before",
        ),
        // 95 ms, 1.195 s and 2.295 s as ns without leading zeros.
        (
            "times.csv",
            "0.pcd;1583836591.95000000\n1.pcd;1583836592.195000000\n2.pcd;1583836593.295000000\n",
            "times.csv:1: the decimals \"95000000\" may be a number of ns",
        ),
        ("times.txt", "1583836591.0001\n1583836591.0002\n1583836591.0003\n", "have a median interval of 100000 ns"),
    ] {
        let folder = folder();
        let source = sweeps(&folder, &["0", "1", "2"]);
        write_file(&source.join(file), text);
        let found = error(&import_from(&source, &folder));
        assert!(found.contains(rule), "{rule}: {found}");
    }
    // 5 ms, 105 ms, 950 ms as ns without leading zeros.
    let folder = folder();
    let source = sweeps(&folder, &["1583836591.5000000", "1583836591.105000000", "1583836591.950000000"]);
    let found = error(&import_from(&source, &folder));
    assert!(found.contains("1583836591.5000000.pcd: the decimals \"5000000\" may be a number of ns"), "{found}");
}

#[test]
fn tables_of_windows_programs_are_read_or_refused_at_their_place() {
    let text = "1583836591.1\r\n1583836591.2\r\n";
    let utf16 = |unit: fn(u16) -> [u8; 2]| format!("\u{feff}{text}").encode_utf16().flat_map(unit).collect::<Vec<u8>>();
    let named = "\u{feff}\"name\";\"stamp\"\r\n\"0.pcd\";\"1583836591,1\"\r\n\"1.pcd\";\"1583836591,2\"\r\n\r\n";
    for (file, bytes) in [
        ("times.txt", format!("\u{feff}{text}").into_bytes()),
        ("times.txt", utf16(u16::to_le_bytes)),
        ("times.txt", utf16(u16::to_be_bytes)),
        ("times.csv", named.to_owned().into_bytes()),
        ("times.csv", "\u{feff}0.pcd,1583836591100000000\r\n1.pcd,1583836591200000000\r\n".to_owned().into_bytes()),
    ] {
        let folder = folder();
        let source = sweeps(&folder, &["0", "1"]);
        std::fs::write(source.join(file), &bytes).expect("writes");
        let (_, drive) = imported(&import_from(&source, &folder));
        let stamps: Vec<i64> = drive.sweep_stamps().iter().map(|stamp| stamp.0).collect();
        assert_eq!(stamps, [1_583_836_591_100_000_000, 1_583_836_591_200_000_000], "{bytes:?}");
    }
    let folder = folder();
    let source = sweeps(&folder, &["0", "1"]);
    std::fs::write(source.join("times.txt"), b"1583836591.1\n\xe9\n").expect("writes");
    let found = error(&import_from(&source, &folder));
    assert!(found.contains("times.txt: byte 13 (line 2) is 0xe9, which is not UTF-8"), "{found}");
}

#[test]
fn imu_tables_with_decimal_commas_are_read_or_refused_at_their_line() {
    let header = "timestamp;ax;ay;az;wx;wy;wz";
    let line = |number: i64| {
        format!("{};0.112;-0.204;9.791;0.011;-0.021;0.033", 1_583_836_591_100_000_000 + number * 5_000_000)
    };
    let table = |number_of: fn(&str) -> String, separator: &str| -> String {
        let lines = std::iter::once(header.to_owned()).chain((0..40).map(line));
        lines.map(|line| number_of(&line).replace(';', separator) + "\n").collect()
    };
    let point = |line: &str| line.to_owned();
    let comma = |line: &str| line.replace('.', ",");
    let samples = |text: &str| {
        let folder = folder();
        let source = sweeps(&folder, &["1583836591.1", "1583836591.2"]);
        write_file(&source.join("imu.csv"), text);
        let import = import_from(&source, &folder);
        if text.contains("0,112,") {
            return Err(error(&import));
        }
        let (_, drive) = imported(&import);
        let samples: Vec<_> =
            drive.imu().expect("opens").expect("has one").map(|sample| sample.expect("is valid")).collect();
        Ok(samples)
    };
    let expected = samples(&table(point, ",")).expect("reads");
    assert_eq!((expected.len(), expected[0].acceleration), (40, [0.112, -0.204, 9.791]));
    for text in [table(comma, ";"), table(comma, "\t"), table(point, ";"), format!("\u{feff}{}", table(comma, ";"))] {
        assert_eq!(samples(&text).expect("reads"), expected, "{text}");
    }
    let found = samples(&table(comma, ",")).expect_err("is refused");
    assert!(found.contains("imu.csv:2: ") && found.contains("has 13 cells, the first line names 7"), "{found}");
}

#[test]
fn names_that_contradict_the_stamps_are_reported() {
    let folder = folder();
    let source = sweeps(&folder, &["0", "1"]);
    write_file(&source.join("times.csv"), "0.pcd,1583836591.2\n1.pcd,1583836591.1\n");
    let (report, drive) = imported(&import_from(&source, &folder));
    assert!(
        report.iter().any(|line| line.contains("the numbers in the names contradict the stamps: 0.pcd has")),
        "{report:?}"
    );
    assert_eq!(sweeps_of(&drive).iter().map(|(_, x)| *x).collect::<Vec<_>>(), [6.0, 5.0]);
}

#[test]
fn folder_with_several_kinds_is_refused_unless_one_is_chosen() {
    let folder = folder();
    let source = sweeps(&folder, &["0", "1"]);
    write_file(&source.join("drive.bag"), "#ROSBAG V2.0\n");
    write_file(&source.join("more.mcap"), "x");
    let mut import = import_from(&source, &folder);
    let found = error(&import);
    let words = [
        "2 *.pcd (first: 0.pcd; ",
        "1 *.bag (first: drive.bag; 13 bytes)",
        "1 *.mcap (first: more.mcap; 1 bytes)",
        "--kind",
    ];
    assert!(words.iter().all(|words| found.contains(words)), "{found}");
    import.options.kind = Some(import::Kind::Pcd);
    let (report, _) = imported(&import);
    assert!(
        report.contains(&"not imported: drive.bag".to_owned())
            && report.contains(&"not imported: more.mcap".to_owned()),
        "{report:?}"
    );
}

#[test]
fn poses_and_imu_beside_the_sweeps_are_imported() {
    let folder = folder();
    let source = sweeps(&folder, &["cloud_1583836591_182590976", "cloud_1583836591_282590976"]);
    let poses =
        "#sec,nsec,x,y,z,qx,qy,qz,qw\n1583836591,182590976,1.5,0,0,0,0,0,1\n1583836591,282590976,2.5,0,0,0,0,0,1\n";
    write_file(&source.join("../registered_poses.csv"), poses);
    let imu = "sec,nsec,wx,wy,wz,ax,ay,az\n1583836591,190000000,0.1,0.2,0.3,0.01,-0.02,1.0\n1583836591,200000000,0.1,0.2,0.3,0,0,1\n";
    write_file(&source.join("imu.csv"), imu);
    let (report, drive) = imported(&import_from(&source, &folder));
    assert!(report.iter().any(|line| line.starts_with("imported: 2 true poses of ")), "{report:?}");
    let line = report.iter().find(|line| line.starts_with("imported: 2 IMU samples")).expect("is reported");
    assert!(line.ends_with("with accelerations in g"), "{line}");
    let truth = drive.true_trajectory().expect("has one").expect("reads");
    assert_eq!((truth.poses()[1].0.0 - BEGIN, truth.poses()[1].1.translation.x), (100_000_000, 2.5));
    let samples: Vec<_> = drive.imu().expect("opens").expect("has one").map(|sample| sample.expect("reads")).collect();
    assert_eq!(samples[0].angular_rate, [0.1, 0.2, 0.3]);
    assert!((samples[0].acceleration[2] - 9.806_65).abs() < 1e-12 && samples[0].stamp.0 == 1_583_836_591_190_000_000);
}

#[test]
fn poses_without_stamps_are_left_out() {
    let folder = folder();
    let source = sweeps(&folder, &["1583836591.182590976"]);
    write_file(&source.join("poses.txt"), "1 0 0 0 0 1 0 0 0 0 1 0\n");
    let (report, drive) = imported(&import_from(&source, &folder));
    assert!(report.iter().any(|line| line.ends_with("poses.txt, poses without stamps")), "{report:?}");
    assert!(drive.manifest().truth.is_none());
}

#[test]
fn ply_sweeps_are_converted_with_their_intensities() {
    let folder = folder();
    let source = folder.path().join("recording");
    for (k, name) in ["scan_1583836591182590976", "scan_1583836591282590976"].into_iter().enumerate() {
        let header = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty float y\nproperty float z\n\
                      property uchar red\nproperty float scalar_intensity\nend_header\n";
        write_file(&source.join(format!("{name}.ply")), format!("{header}{}.5 1 2 9 7\n3 -1 2 9 200\n", k + 5));
    }
    let (report, drive) = imported(&import_from(&source, &folder));
    assert!(report.iter().any(|line| line.starts_with("the files are converted")), "{report:?}");
    assert!(!report.iter().any(|line| line.starts_with("not imported")), "{report:?}");
    assert_eq!(sweeps_of(&drive), [(0, 5.5), (100_000_000, 6.5)]);
    let mut intensities = Vec::new();
    drive
        .sweeps()
        .expect("opens")
        .next_sweep(|found| intensities.extend(found.iter().map(|r| r.intensity)))
        .expect("reads");
    assert_eq!(intensities, [7, 200]);
}

/// Returns of a sensor with 32 beams in firing order: elevation of the beam, azimuth of the column, time in s.
fn fired() -> Vec<([f32; 3], u8, f64)> {
    let mut returns = Vec::new();
    for column in 0..100 {
        for beam in 0..32_u8 {
            let elevation = (-30.67 + 4.0 / 3.0 * f64::from(beam)).to_radians();
            let azimuth = -f64::from(column) * 0.0628;
            let range_m = 10.0 + 0.1 * f64::from(column);
            let p = [azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin()];
            returns.push((
                p.map(|value| (value * range_m) as f32),
                beam,
                f64::from(column) * 1e-3 + f64::from(beam) * 1e-6,
            ));
        }
    }
    returns
}

/// Rings and times of the returns of the first sweep in the file of the drive.
fn first_sweep(drive: &Drive) -> (lidar::SweepInfo, Vec<(u8, u32)>) {
    let mut found = Vec::new();
    let mut source = drive.sweeps().expect("opens");
    let info = source.next_sweep(|some| found.extend(some.iter().map(|r| (r.ring, r.offset_nanos)))).expect("reads");
    (info.expect("has one"), found)
}

#[test]
fn times_and_rings_of_ply_and_las_sweeps_are_carried_over() {
    let folder = folder();
    let expected: Vec<u32> = fired().iter().map(|(_, _, time_s)| (time_s * 1e9).round() as u32).collect();
    // Beams counted from the highest, times in us of a separate clock.
    for (name, kind, unit, begin) in
        [("t", "double", 1e6, 5e9), ("timestamp", "double", 1.0, 1.7e9), ("time", "float", 1.0, 0.0)]
    {
        let source = folder.path().join(name);
        let head = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             property uchar ring\nproperty {kind} {name}\nend_header\n",
            fired().len()
        );
        let row = |([x, y, z], beam, time_s): ([f32; 3], u8, f64)| {
            format!("{x} {y} {z} {} {:.9}\n", 31 - beam, time_s * unit + begin)
        };
        let rows: Vec<String> = fired().into_iter().map(row).collect();
        write_file(&source.join("1583836591182590976.ply"), head + &rows.concat());
        let mut import = import_from(&source, &folder);
        import.out = folder.path().join(format!("{name}.drive"));
        import.options.model = lidar::Model::from_name("hdl32e");
        let (report, drive) = imported(&import);
        assert!(report.iter().any(|line| line == "rings: ring, 32 beams counted from the highest"), "{report:?}");
        assert!(report.iter().any(|line| line.starts_with(&format!("point times: {name}, in "))), "{report:?}");
        let (info, found) = first_sweep(&drive);
        assert!(info.has_times && found.len() == expected.len(), "{info:?}");
        for ((ring, nanos), ((_, beam, _), expected)) in found.iter().zip(fired().iter().zip(&expected)) {
            assert_eq!(ring, beam);
            // Seconds since 1970 as f64 and tenths of a second as f32.
            assert!(nanos.abs_diff(*expected) < 300, "{name}: {nanos} {expected}");
        }
    }

    let row = |([x, y, z], _, time_s): ([f32; 3], u8, f64)| ([x, y, z].map(f64::from), 100, time_s + 300_000.0);
    let rows: Vec<las_file::Row> = fired().into_iter().map(row).collect();
    for (end, is_compressed) in [("las", false), ("laz", true)] {
        let source = folder.path().join(end);
        write_file(&source.join(format!("1583836591182590976.{end}")), las_file::las(&rows, is_compressed));
        let mut import = import_from(&source, &folder);
        import.options.kind = import::Kind::from_name("las");
        import.out = folder.path().join(format!("{end}.drive"));
        let (report, drive) = imported(&import);
        assert!(report.iter().any(|line| line.starts_with("point times: GPS time, in s")), "{report:?}");
        let (info, found) = first_sweep(&drive);
        assert!(info.has_times && found.len() == expected.len(), "{info:?}");
        assert!(found.iter().zip(&expected).all(|((_, nanos), expected)| nanos.abs_diff(*expected) < 300));
    }

    // The times of a complete drive do not fit into one sweep.
    let slow: Vec<las_file::Row> = rows.iter().map(|(p, i, time_s)| (*p, *i, (time_s - 300_000.0) * 100.0)).collect();
    let source = folder.path().join("slow");
    write_file(&source.join("1583836591182590976.las"), las_file::las(&slow, false));
    let mut import = import_from(&source, &folder);
    import.out = folder.path().join("slow.drive");
    let error = error(&import);
    assert!(error.contains("1583836591182590976.las: 90 % of its points were measured over"), "{error}");
}

/// Withheld points are deleted points that a program left in the file.
#[test]
fn withheld_points_of_las_are_left_out_and_noise_is_counted() {
    let folder = folder();
    let row = |([x, y, z], _, time_s): ([f32; 3], u8, f64)| ([x, y, z].map(f64::from), 100, time_s + 300_000.0);
    let rows: Vec<las_file::Row> = fired().into_iter().map(row).collect();
    let n = rows.len();
    // Every fourth point is withheld, of class 2 with bit 7, or with bit 2 of the flags; the point after it is noise.
    let short = |index: usize| [[0x82_u8, 0], [7, 0], [2, 0], [18, 0]][index % 4];
    let long = |index: usize| [[0x04_u8, 2], [0, 18], [0x0b, 2], [0, 7]][index % 4];
    let n_of = |part: usize| (0..n).filter(|index| index % 4 == part).count();
    let n_noise = n_of(1) + n_of(3);
    for (format, name, bytes) in [(1, "short", &short as &dyn Fn(usize) -> [u8; 2]), (6, "long", &long)] {
        let source = folder.path().join(name);
        write_file(&source.join("1583836591182590976.laz"), las_file::classified(format, &rows, bytes));
        let mut import = import_from(&source, &folder);
        import.out = folder.path().join(format!("{name}.drive"));
        let (report, drive) = imported(&import);
        let withheld = format!("{} of {n} points are flagged as withheld and left out", n_of(0));
        let noise = format!("{n_noise} of {n} points are classified as noise (7 or 18); they are kept as returns");
        assert!(report.contains(&withheld) && report.contains(&noise), "{report:?}");
        assert_eq!(first_sweep(&drive).1.len(), n - n_of(0), "{name}");
    }
}

#[test]
fn viewpoint_of_pcd_that_is_not_the_identity_is_named_with_its_value() {
    let folder = folder();
    let source = sweeps(&folder, &["1583836591.182590976", "1583836591.282590976"]);
    let import = import_from(&source, &folder);
    assert!(imported(&import).0.iter().all(|line| !line.contains("VIEWPOINT")));
    let second = source.join("1583836591.282590976.pcd");
    let bytes = std::fs::read(&second).expect("reads");
    let at = bytes.windows(23).position(|word| word == b"VIEWPOINT 0 0 0 1 0 0 0").expect("is there");
    let moved = [&bytes[..at], b"VIEWPOINT 4 0 1.5 1 0 0 0", &bytes[at + 23..]].concat();
    write_file(&second, moved);
    std::fs::remove_dir_all(&import.out).expect("removes");
    let (report, drive) = imported(&import);
    let is_named = |line: &String| line.starts_with("VIEWPOINT 4 0 1.5 1 0 0 0 is not applied");
    assert!(report.iter().any(is_named), "{report:?}");
    let source = drive.sweeps().expect("opens");
    assert!(source.form().expect("has a form").changes().iter().any(is_named), "a run says it as well");
}

#[test]
fn damaged_plain_folders_are_refused_with_file_and_rule() {
    for (file, text, rule) in [
        ("times.txt", "1583836591.1\n", "times.txt: 1 stamps for 2 sweeps"),
        ("times.txt", "0\n100000000\n", "times.txt:1: \"0\" must be a stamp: seconds with decimals"),
        ("times.txt", "0.5\n0.5\n", "1.pcd: has the stamp of 0.pcd"),
        ("times.csv", "0.pcd,1583836591.1\n1583836591.2\n", "must have a line with the name of each sweep, as 1.pcd"),
        ("times.csv", "file,time\n0,x\n", "times.csv:2: \"0,x\" must be a stamp"),
        ("imu.csv", "1,2,3\n", "imu.csv:1: the first line must name the columns"),
        (
            "imu.csv",
            "t,ax,ay,az,wx,wy,wz\n1.0,0,0,9.8,0,0\n",
            "imu.csv:2: \"1.0,0,0,9.8,0,0\": must have finite numbers",
        ),
        ("imu.csv", "t,ax,ay,az,wx,wy,wz\n1.0,0,0,nan,0,0,0\n", "imu.csv:2"),
        ("imu.csv", "t,ax,ay,az,wx,wy,wz\n2.0,0,0,9.8,0,0,0\n1.0,0,0,9.8,0,0,0\n", "imu.csv:3"),
        ("imu.csv", "t,ax,ay,az,wx,wy,wz\n2.0,0,0,980,0,0,0\n", "imu.csv: accelerations have a median of 980"),
        ("trajectory.txt", "0.5 0 0 0 0 0 0 2\n", "trajectory.txt:1: quaternion"),
        ("registered_poses.csv", "sec,nsec,x\n1,x,3\n", "registered_poses.csv:2: \"1,x,3\" must be sec,nsec,x,y,z"),
    ] {
        let folder = folder();
        let source = sweeps(&folder, &["0", "1"]);
        write_file(&source.join(file), text);
        let found = error(&import_from(&source, &folder));
        assert!(found.contains(rule), "{rule}: {found}");
    }
    let folder = folder();
    let source = sweeps(&folder, &["1583836591.2", "1583836591.3"]);
    write_file(&source.join("trajectory.txt"), "99.5 0 0 0 0 0 0 1\n");
    assert!(error(&import_from(&source, &folder)).contains("no pose lies between the first and the last sweep"));
    let cut = folder.path().join("cut");
    write_file(&cut.join("0.ply"), "ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\n");
    assert!(error(&import_from(&cut, &folder)).contains("0.ply: "), "{}", error(&import_from(&cut, &folder)));
}

/// Real sweeps under names with stamps.
#[real_data::test("kitti_raw_0048/*.pcd")]
fn real_sweeps_with_stamps_in_their_names_are_imported() {
    let folder = folder();
    let source = folder.path().join("recording");
    std::fs::create_dir_all(&source).expect("makes");
    for k in 0..3 {
        let original = real_data::path(&format!("kitti_raw_0048/{k:010}.pcd"));
        let link: PathBuf = source.join(format!("{}.pcd", BEGIN + k * 100_000_000));
        std::os::unix::fs::symlink(absolute(&original), link).expect("links");
    }
    let (_, drive) = imported(&import_from(&source, &folder));
    assert_eq!(sweeps_of(&drive).iter().map(|(stamp, _)| *stamp).collect::<Vec<_>>(), [0, 100_000_000, 200_000_000]);
}

fn absolute(path: &Path) -> PathBuf {
    path.canonicalize().expect("exists")
}
