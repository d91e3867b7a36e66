//! Imports of `MandEye` folders and of LAS and LAZ sweeps, written by the tests in the published formats.

use super::las_file::{RECORD_BYTES, Row, las, layered_laz};
use super::support::{Import, error, folder, import_from, write_file};
use drive::Drive;
use lidar::SweepPoint;
use std::path::PathBuf;
use tempfile::TempDir;

/// Time of the first point, s: seconds since the start of the sensor.
const BEGIN_S: f64 = 4321.25;

/// A point every millisecond of a second and a half; the k-th is k mm away from 10 m.
fn rows() -> Vec<Row> {
    (0..1500)
        .map(|k| ([10.0 + 0.001 * f64::from(k), -2.5, 0.25], (k % 250) as u16, BEGIN_S + 0.001 * f64::from(k)))
        .collect()
}

pub(super) fn recording(folder: &TempDir) -> PathBuf {
    let root = folder.path().join("continousScanning_0001");
    let rows = rows();
    // The border of the chunks is inside a sweep.
    write_file(&root.join("lidar0000.laz"), las(&rows[..720], true));
    write_file(&root.join("lidar0001.laz"), las(&rows[720..], true));
    let header = "timestamp gyroX gyroY gyroZ accX accY accZ imuId timestampUnix\n";
    let line = |k: i64, id: i64| {
        format!("{} 0.1 -0.2 0.3 0.01 0 1.0 {id} 1700000000000000000\n", 4_321_250_000_000 + k * 5_000_000)
    };
    write_file(&root.join("imu0000.csv"), format!("{header}{}{}{}", line(0, 0), line(0, 1), line(1, 0)));
    write_file(&root.join("imu0001.csv"), format!("{header}{}{}", line(1, 0), line(2, 0)));
    write_file(&root.join("status0000.json"), "{}");
    root
}

pub(super) fn imported(import: &Import) -> (Vec<String>, Drive) {
    let report = import.run().expect("imports");
    (report, Drive::open(&import.out).expect("opens"))
}

#[test]
fn chunks_of_mandeye_are_cut_into_sweeps_with_times() {
    let folder = folder();
    let (report, drive) = imported(&import_from(recording(&folder), &folder));
    assert!(report[0].ends_with("16 sweeps of mid360 (MandEye)"), "{report:?}");
    assert_eq!(report[1], "imported: 16 sweeps and their times");
    let line = "imported: 3 IMU samples, with accelerations in g; 1 of other units are left out; \
                1 whose stamp is not later than the previous one are left out";
    assert_eq!(report[2], line);
    assert_eq!(report[3..], ["not imported: status0000.json"]);
    let samples: Vec<_> = drive.imu().expect("opens").expect("has one").map(|sample| sample.expect("reads")).collect();
    assert_eq!((samples[2].stamp.0, samples[2].angular_rate), (4_321_260_000_000, [0.1, -0.2, 0.3]));
    assert!((samples[0].acceleration[2] - 9.806_65).abs() < 1e-12, "{samples:?}");

    // 4321.25 to 4321.3 s, then tenths of a second.
    let mut sweeps = drive.sweeps().expect("opens");
    let mut found = Vec::new();
    let mut distances = Vec::new();
    let mut times = Vec::new();
    let mut take = |returns: &[SweepPoint]| {
        distances.extend(returns.iter().map(|r| r.x));
        times.extend(returns.iter().map(|r| r.offset_nanos));
    };
    while let Some(sweep) = sweeps.next_sweep(&mut take).expect("reads") {
        assert!(sweep.has_times);
        found.push((sweep.stamp.0, sweep.n_returns));
    }
    assert_eq!(found[..3], [(4_321_250_000_000, 50), (4_321_300_000_000, 100), (4_321_400_000_000, 100)]);
    assert_eq!((found.len(), found[15]), (16, (4_322_700_000_000, 50)));
    let expected: Vec<f32> = rows().iter().map(|row| row.0[0] as f32).collect();
    assert!(distances.iter().zip(&expected).all(|(found, expected)| (found - expected).abs() < 1e-4));
    assert_eq!(distances.len(), expected.len());

    let times_of_sweep = &times[50 + 6 * 100..][..100];
    assert!(times_of_sweep.iter().enumerate().all(|(k, nanos)| *nanos == 1_000_000 * k as u32), "{times_of_sweep:?}");
}

#[test]
fn las_and_laz_sweeps_are_converted() {
    let folder = folder();
    let source = folder.path().join("recording");
    for (name, is_compressed) in [("1583836591.1.las", false), ("1583836591.2.laz", true)] {
        write_file(&source.join(name), las(&rows()[..300], is_compressed));
    }
    let (report, drive) = imported(&import_from(&source, &folder));
    assert!(report[0].ends_with("2 sweeps of hdl64e (bare sweeps)"), "{report:?}");
    assert!(!report.iter().any(|line| line.starts_with("not imported")), "{report:?}");
    let mut sweeps = drive.sweeps().expect("opens");
    for _ in 0..2 {
        let mut found = Vec::new();
        sweeps.next_sweep(|returns| found.extend(returns.iter().map(|r| (r.x, r.y, r.z, r.intensity)))).expect("reads");
        assert_eq!((found.len(), found[0], found[17].3), (300, (10.0, -2.5, 0.25, 0), 17));
    }
}

#[test]
fn laz_in_layers_has_the_same_points() {
    let folder = folder();
    let source = folder.path().join("recording");
    write_file(&source.join("1.las"), las(&rows()[..300], false));
    for (number, (format, chunk)) in
        [(6, Some(50_000)), (6, Some(100)), (7, Some(70)), (8, None), (9, Some(299)), (10, Some(1))]
            .into_iter()
            .enumerate()
    {
        write_file(&source.join(format!("{}.laz", number + 2)), layered_laz(format, &rows()[..300], chunk));
    }
    let (_, drive) = imported(&import_from(&source, &folder));
    let mut sweeps = drive.sweeps().expect("opens");
    let mut found = Vec::new();
    loop {
        let mut points = Vec::new();
        let take = |r: &SweepPoint| (r.x, r.y, r.z, r.intensity, r.offset_nanos);
        let next = sweeps.next_sweep(|returns| points.extend(returns.iter().map(take))).expect("reads");
        if next.is_none() {
            break;
        }
        found.push(points);
    }
    assert_eq!((found.len(), found[0].len()), (7, 300));
    assert!(found.iter().all(|points| *points == found[0]));
}

#[test]
fn layers_that_the_file_does_not_hold_are_refused_before_memory_is_reserved() {
    let folder = folder();
    let path = folder.path().join("recording/0.laz");
    let import = import_from(folder.path().join("recording"), &folder);
    let whole = layered_laz(6, &rows()[..300], Some(100));
    let data_at = u32::from_le_bytes(*whole[96..].first_chunk().expect("is there")) as usize;
    // The first chunk: a record of 32 bytes, the number of points, then the lengths of nine layers and of two extra bytes.
    let lengths_at = data_at + 8 + 32 + 4;
    for layer in 0..11 {
        let mut bytes = whole.clone();
        bytes[lengths_at + 4 * layer..][..4].copy_from_slice(&0xffff_fff0_u32.to_le_bytes());
        write_file(&path, bytes);
        let text = error(&import);
        assert!(text.contains("chunk 0: layers of 4294") && text.contains("it is damaged"), "{layer}: {text}");
    }
    let mut bytes = whole.clone();
    bytes[104] = 0x81;
    write_file(&path, &bytes);
    assert!(error(&import).contains("point format 1, but compressed as 6 to 10"), "{}", error(&import));
    for format in [6, 8] {
        let whole = layered_laz(format, &rows()[..120], (format == 6).then_some(50));
        for length in (0..whole.len()).step_by(97) {
            write_file(&path, &whole[..length]);
            assert!(error(&import).contains("0.laz: "), "{length}");
        }
        for at in (0..whole.len()).step_by(23) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0xff;
            write_file(&path, bytes);
            if import.run().is_ok() {
                std::fs::remove_dir_all(&import.out).expect("removes");
            }
        }
    }
}

#[test]
fn table_of_chunks_that_only_the_end_of_the_file_names_is_checked() {
    let folder = folder();
    let path = folder.path().join("recording/0.laz");
    let import = import_from(folder.path().join("recording"), &folder);
    for whole in [las(&rows()[..300], true), layered_laz(6, &rows()[..300], Some(100))] {
        let data_at = u32::from_le_bytes(*whole[96..].first_chunk().expect("is there")) as usize;
        for place in [-1_i64, 0, data_at as i64] {
            let mut bytes = whole.clone();
            bytes[data_at..data_at + 8].copy_from_slice(&place.to_le_bytes());
            bytes.extend([0, u32::MAX].map(u32::to_le_bytes).concat());
            bytes.extend((whole.len() as u64).to_le_bytes());
            write_file(&path, bytes);
            assert!(error(&import).contains("4294967295 chunks for 300 points"), "{place}: {}", error(&import));
        }
    }
}

#[test]
fn damaged_las_files_are_refused_at_each_length_and_byte() {
    let folder = folder();
    let path = folder.path().join("recording/0.laz");
    let import = import_from(folder.path().join("recording"), &folder);
    let whole = las(&rows()[..300], true);
    for length in (0..whole.len()).step_by(61) {
        write_file(&path, &whole[..length]);
        let text = error(&import);
        assert!(text.contains("0.laz: "), "{length}: {text}");
    }
    // A changed byte may be a changed coordinate; it must never end the program, nor take more memory than the file size
    // explains.
    for at in (0..whole.len()).step_by(7) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0xff;
        write_file(&path, bytes);
        if import.run().is_ok() {
            std::fs::remove_dir_all(&import.out).expect("removes");
        }
    }
    std::fs::remove_file(&path).expect("removes");
    let path = folder.path().join("recording/0.las");
    let whole = las(&rows()[..300], false);
    write_file(&path, &whole[..whole.len() - RECORD_BYTES / 2]);
    assert!(
        error(&import).contains("0.las: 300 points of 28 bytes; 8613 bytes of the file cannot hold them"),
        "{}",
        error(&import)
    );
    for (change, rule) in [
        (|bytes: &mut Vec<u8>| bytes[131..139].fill(0), "0.las: the scale of x is 0"),
        (
            |bytes: &mut Vec<u8>| bytes[107..111].copy_from_slice(&0_u32.to_le_bytes()),
            "0.las: the header states 0 points of 28 bytes; the file holds 300",
        ),
        (
            |bytes: &mut Vec<u8>| bytes[107..111].copy_from_slice(&200_u32.to_le_bytes()),
            "0.las: the header states 200 points of 28 bytes; the file holds 300",
        ),
    ] as [(fn(&mut Vec<u8>), &str); 3]
    {
        let mut bytes = whole.clone();
        change(&mut bytes);
        write_file(&path, bytes);
        assert!(error(&import).contains(rule), "{rule}: {}", error(&import));
    }
    let mut bytes = whole.clone();
    bytes[104] = 0x86;
    write_file(&path, bytes);
    assert!(
        error(&import).contains("0.las: records of 28 bytes; point format 6 has at least 30"),
        "{}",
        error(&import)
    );
}

#[test]
fn compressed_records_that_need_more_memory_or_time_than_the_file_explains_are_refused() {
    let folder = folder();
    let path = folder.path().join("recording/0.laz");
    let import = import_from(folder.path().join("recording"), &folder);
    let whole = las(&rows()[..300], true);
    for (record_bytes, n_points, rule) in [
        (2000_u16, 300, "compressed records of 2000 bytes; at most 1024 are read".to_owned()),
        (1000, 2 * whole.len() as u32, format!("{} points of 1000 bytes; {} bytes", 2 * whole.len(), whole.len())),
    ] {
        let mut bytes = whole.clone();
        bytes[105..107].copy_from_slice(&record_bytes.to_le_bytes());
        bytes[107..111].copy_from_slice(&n_points.to_le_bytes());
        write_file(&path, bytes);
        let text = error(&import);
        assert!(text.contains(&rule), "{rule}: {text}");
    }
}

#[test]
fn damaged_mandeye_folders_are_refused_with_file_and_rule() {
    type Fault = (&'static str, Vec<u8>, &'static str);
    let mut late = rows();
    late[9].2 = f64::NAN;
    let faults: [Fault; 4] = [
        ("lidar0001.laz", b"LAS".to_vec(), "lidar0001.laz: is not a LAS file"),
        ("lidar0001.laz", las(&late, true), "lidar0001.laz: point 9 has the time NaN s; it must be"),
        ("imu0001.csv", b"7 0.1 0.1\n".to_vec(), "imu0001.csv:1: accX is \"nothing\"; it must be a number"),
        ("imu0001.csv", b"x 0 0 0 0 0 1 0\n".to_vec(), "imu0001.csv:1: timestamp is \"x\"; it must be a number"),
    ];
    for (file, bytes, rule) in faults {
        let folder = folder();
        let root = recording(&folder);
        write_file(&root.join(file), bytes);
        let text = error(&import_from(root, &folder));
        assert!(text.contains(rule), "{rule}: {text}");
    }
}
