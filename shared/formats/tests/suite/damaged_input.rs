//! No reader panics or hangs on damaged bytes. Real and generated files are truncated and changed at seeded random positions.

use crate::support::{self, BEGIN, hdl32e_packets, write_capture};
use formats::cloud::{CloudPoint, FiredPoint};
use formats::drive::{Drive, returns_from_cloud};
use formats::envi;
use formats::imu::{ImuReader, ImuSample, csv_from_samples};
use formats::kitti;
use formats::ladybug::LadybugCalibration;
use formats::lidar::SweepReader;
use formats::nmea::{Fix, fixes, gga_from_fix, rmc_from_fix};
use formats::pcap::PacketReader;
use formats::pcd::{PcdCloud, cloud_from_pcd, pcd_from_cloud, pcd_from_points, points_from_pcd};
use formats::pgm::{Pgm, pgm_from_samples};
use formats::recording::TickReader;
use formats::sensor_calibration::SensorCalibration;
use formats::tiff::Tiff;
use formats::trajectory::{
    TrajectoryError, csv_from_trajectory, kitti_from_trajectory, numbered, poses_from_kitti, trajectory_from_csv,
    trajectory_from_tum, tum_from_trajectory,
};
use formats::velodyne::{DataPacket, Decoder, Model, PositionPacket};
use geometry::{Pose, Stamp, Trajectory};
use random::Random;
use std::path::Path;

/// Truncates, removes, inserts or overwrites bytes.
fn damaged(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.index(4) {
        let at = random.index(bytes.len().max(1));
        match random.index(5) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..(at + random.index(64)).min(bytes.len()))),
            2 => bytes.splice(at..at, (0..random.index(64)).map(|_| 0xff).collect::<Vec<_>>()).for_each(drop),
            _ => {
                for _ in 0..=random.index(8) {
                    // Headers are at the front, so the front is hit more often.
                    let reach = if random.index(2) == 0 { 200 } else { bytes.len() };
                    let at = random.index(reach.min(bytes.len()).max(1));
                    if let Some(byte) = bytes.get_mut(at) {
                        *byte = random.bits() as u8;
                    }
                }
            }
        }
    }
    bytes
}

fn attack(seed: u64, rounds: usize, bytes: &[u8], mut parse: impl FnMut(&[u8])) {
    let mut random = Random::new(seed);
    for _ in 0..rounds {
        parse(&damaged(bytes, &mut random));
    }
}

/// A sound file of the seeds of the fuzz targets.
fn seed(target: &str) -> Vec<u8> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fuzz_targets/corpus");
    std::fs::read(corpus.join(target).join("seed_0")).expect("is there")
}

fn pcapng(packets: &[support::Sent]) -> Vec<u8> {
    let block = |kind: u32, body: &[u8]| {
        let total = (12 + body.len().next_multiple_of(4)) as u32;
        let mut bytes = [kind.to_le_bytes(), total.to_le_bytes()].concat();
        bytes.extend(body);
        bytes.resize(total as usize - 4, 0);
        bytes.extend(total.to_le_bytes());
        bytes
    };
    let mut file = block(0x0a0d_0d0a, &[0x4d, 0x3c, 0x2b, 0x1a, 1, 0, 0, 0, 255, 255, 255, 255, 255, 255, 255, 255]);
    // Interface 0: Ethernet, nanoseconds.
    file.extend(block(1, &[1, 0, 0, 0, 0, 0, 0, 0, 9, 0, 1, 0, 9, 0, 0, 0, 0, 0, 0, 0]));
    for (number, packet) in packets.iter().enumerate() {
        let mut classic = Vec::new();
        let mut writer = formats::pcap::Writer::new(&mut classic).expect("writes");
        writer.write_udp(packet.0, packet.1, &packet.2).expect("writes");
        let frame = &classic[40..];
        let nanos = packet.0.0 as u64;
        let words = [0, (nanos >> 32) as u32, nanos as u32, frame.len() as u32, frame.len() as u32];
        file.extend(block(6, &[words.map(u32::to_le_bytes).concat(), frame.to_vec()].concat()));
        if number % 50 == 0 {
            // Statistics blocks are ignored.
            file.extend(block(5, &[0; 20]));
        }
    }
    file
}

#[test]
fn pcapng_reads_equal_to_pcap() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = hdl32e_packets(400);
    let ng = folder.path().join("a.pcapng");
    std::fs::write(&ng, pcapng(&packets)).expect("writes");
    let mut reader = support::open(&ng);
    let mut classic = support::open(&write_capture(&folder.path().join("a.pcap"), &packets));
    let first = reader.next_sweep(|_| {}).expect("reads").expect("is there");
    assert_eq!(Some(first), classic.next_sweep(|_| {}).expect("reads"));
    let position = reader.position();
    let rest = support::sweeps(&mut classic);
    assert_eq!(support::sweeps(&mut reader), rest);
    let mut resumed = support::open(&ng);
    resumed.resume(position).expect("is there");
    assert_eq!(support::sweeps(&mut resumed), rest);
}

/// Statistics blocks follow the packets 0 and 50, so a position at packet 1 or 51 has a block of another kind right before it.
#[test]
fn pcapng_resumes_at_every_packet() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.pcapng");
    std::fs::write(&path, pcapng(&hdl32e_packets(60))).expect("writes");
    let mut reader = PacketReader::open(&path).expect("opens");
    let mut offsets = Vec::new();
    while let Some(packet) = reader.next().expect("reads") {
        offsets.push(packet.offset);
    }
    assert_eq!(offsets.len(), 60);
    for offset in offsets {
        let mut reader = PacketReader::open_at(&path, offset).expect("opens");
        assert_eq!(reader.next().expect("reads").map(|packet| packet.offset), Some(offset));
    }
}

#[test]
fn damaged_captures_do_not_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = hdl32e_packets(40);
    let classic = std::fs::read(write_capture(&folder.path().join("a.pcap"), &packets)).expect("reads");
    let path = folder.path().join("b.pcap");
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("writes");
        let Ok(mut reader) = SweepReader::open(vec![path.clone()], Some(&Model::Hdl32e.into())) else { return };
        let mut n_returns = 0;
        while let Ok(Some(info)) = reader.next_sweep(|piece| n_returns += piece.len()) {
            assert!(info.n_returns <= SweepReader::MAX_RETURNS);
        }
        assert!(n_returns <= 42 * 384);
    };
    attack(1, 400, &classic, read);
    attack(2, 400, &pcapng(&packets), read);
}

#[test]
fn damaged_packets_do_not_panic() {
    let packet = hdl32e_packets(1).remove(0).2;
    let decoders = Model::ALL.map(Decoder::new);
    let mut returns = Vec::new();
    let mut random = Random::new(3);
    for _ in 0..20_000 {
        let mut bytes = packet.clone();
        for _ in 0..random.index(20) {
            // Mostly flags and angles.
            let at = if random.index(2) == 0 { random.index(12) * 100 + random.index(4) } else { random.index(1206) };
            bytes[at] = random.bits() as u8;
        }
        let Some(packet) = DataPacket::new(&bytes) else { continue };
        for decoder in &decoders {
            returns.clear();
            decoder.decode_into(packet, 0..12, random.bits() as i64 >> 16, &mut returns);
            let n_rings = decoder.model().n_rings();
            assert!(
                returns
                    .iter()
                    .all(|found| found.x.is_finite() && found.azimuth < 36_000 && usize::from(found.ring) < n_rings)
            );
        }
    }
    attack(4, 2000, &[7; 512], |bytes| assert_eq!(PositionPacket::new(bytes).is_some(), bytes.len() == 512));
}

#[test]
fn damaged_texts_do_not_panic() {
    let fix = |i: i64| Fix {
        stamp: Stamp(BEGIN.0 + i * 1_000_000_000),
        position_deg: [48.0, 2.0],
        altitude_m: Some(100.0),
        speed_mps: Some(1.0),
        course_deg: Some(2.0),
        hdop: Some(1.0),
        satellites: 9,
        quality: 1,
    };
    let log: String =
        (0..20).flat_map(|i| [gga_from_fix(&fix(i), 44.0), "\n".into(), rmc_from_fix(&fix(i)), "\n".into()]).collect();
    attack(5, 5000, log.as_bytes(), |bytes| {
        let (found, _) = fixes(bytes);
        assert!(found.len() <= 41 && found.iter().all(|fix| fix.position_deg[0].abs() <= 90.0));
    });
    let sample = |i: i64| ImuSample { stamp: Stamp(i), acceleration: [0.0, 1.0, 9.81], angular_rate: [0.1; 3] };
    let csv = csv_from_samples(&(0..20).map(sample).collect::<Vec<_>>());
    attack(6, 5000, csv.as_bytes(), |bytes| {
        let samples: Vec<ImuSample> = ImuReader::new(bytes).filter_map(Result::ok).collect();
        assert!(samples.windows(2).all(|pair| pair[0].stamp < pair[1].stamp));
    });
}

#[test]
fn damaged_clouds_and_images_do_not_panic() {
    let points: Vec<CloudPoint> = (0..100).map(|i| CloudPoint { x: i as f32, ..CloudPoint::default() }).collect();
    let pcd = pcd_from_points(&points);
    let ascii = b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 3\nDATA ascii\n1 2 3\n4 5 6\n7 8 9\n";
    for (seed, bytes) in [(7, &pcd[..]), (8, &ascii[..])] {
        attack(seed, 5000, bytes, |bytes| {
            if let Ok(points) = points_from_pcd(bytes) {
                let found = returns_from_cloud(&points, &Model::Hdl64e.into());
                assert!(found.iter().all(|one| one.azimuth < 36_000 && one.ring < 64 && one.x.is_finite()));
            }
        });
    }
    let fired = |i: u8| FiredPoint { point: points[usize::from(i)], ring: i, offset_nanos: u32::from(i) * 1_000_000 };
    let timed = pcd_from_cloud(&PcdCloud { points: (0..100).map(fired).collect(), has_rings: true, has_times: true });
    attack(11, 5000, &timed, |bytes| {
        if let Ok(cloud) = cloud_from_pcd(bytes) {
            assert!(cloud.points.iter().all(|p| p.offset_nanos <= 4_000_000_000 && (cloud.has_rings || p.ring == 0)));
        }
    });
    attack(9, 2000, &kitti::bin_from_points(&points), |bytes| {
        assert_eq!(kitti::points_from_bin(bytes).is_ok(), bytes.len() % 16 == 0);
        assert_eq!(kitti::labels_from_bytes(bytes).is_ok(), bytes.len() % 4 == 0);
    });
    attack(10, 5000, &pgm_from_samples(20, 10, 4095, &[77; 200]), |bytes| {
        if let Ok(image) = Pgm::parse(bytes) {
            assert_eq!(image.samples().len(), image.n_samples());
        }
    });
}

/// An uncompressed TIFF of 4 x 2 pixels with 4 bands of 16 bits.
fn tiff() -> Vec<u8> {
    let fields = [(256, 4), (257, 2), (258, 16), (259, 1), (262, 1), (273, 122), (277, 4), (278, 2), (279, 64)];
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    bytes.extend((fields.len() as u16).to_le_bytes());
    for (tag, value) in fields {
        bytes.extend([u16::to_le_bytes(tag), 4_u16.to_le_bytes()].concat());
        bytes.extend([1_u32.to_le_bytes(), u32::to_le_bytes(value)].concat());
    }
    bytes.extend([0; 4]);
    bytes.extend((0..32_u16).flat_map(u16::to_le_bytes));
    bytes
}

#[test]
fn damaged_tiffs_do_not_panic() {
    let bytes = tiff();
    let image = Tiff::parse(&bytes).expect("parses");
    assert_eq!((image.n_bands, image.samples), (4, (0..32).collect::<Vec<u16>>()));
    let mut read = 0;
    attack(24, 20_000, &bytes, |bytes| {
        if let Ok(image) = Tiff::parse(bytes) {
            assert_eq!(image.samples.len(), (image.width * image.height * image.n_bands) as usize);
            read += 1;
        }
    });
    assert!(read > 200, "{read}");
}

#[test]
fn tiff_that_needs_more_bytes_than_it_has_is_refused() {
    // Ten rows each are the same strip of 655 340 bytes: 2 GB of image in 120 KB of file.
    let (width, height, n_bands, n_strips) = (32_767_u32, 30_000_u32, 2_u32, 3_000_u32);
    let table = 8 + 2 + 10 * 12 + 4;
    let fields: [(u16, u16, u32, u32); 10] = [
        (256, 4, 1, width),
        (257, 4, 1, height),
        (258, 3, 1, 8),
        (259, 3, 1, 1),
        (262, 3, 1, 1),
        (273, 4, n_strips, table),
        (277, 3, 1, n_bands),
        (278, 4, 1, 10),
        (279, 4, n_strips, table + 4 * n_strips),
        (339, 3, 1, 1),
    ];
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    bytes.extend((fields.len() as u16).to_le_bytes());
    for (tag, kind, count, value) in fields {
        bytes.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
        bytes.extend([count.to_le_bytes(), value.to_le_bytes()].concat());
    }
    bytes.extend([0; 4]);
    for number in [8, 10 * width * n_bands] {
        bytes.extend(number.to_le_bytes().repeat(n_strips as usize));
    }
    bytes.resize(120_000, 0);
    let error = Tiff::parse(&bytes).expect_err("refused").to_string();
    assert!(error.contains("needs 1966020000; the file has 120000 bytes"), "{error}");
}

#[test]
fn damaged_trajectories_do_not_panic() {
    let poses: Vec<Pose> = (0..20).map(|i| Pose::translation(f64::from(i), 0.5, -1e-3)).collect();
    let trajectory = numbered(&poses, 100_000_000);
    let check = |read: Result<Trajectory, TrajectoryError>| {
        if let Ok(trajectory) = read {
            assert!(trajectory.poses().is_sorted_by_key(|(stamp, _)| *stamp));
        }
    };
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    attack(25, 3000, tum_from_trajectory(&trajectory).as_bytes(), |bytes| check(trajectory_from_tum(&text(bytes))));
    attack(26, 3000, csv_from_trajectory(&trajectory).as_bytes(), |bytes| check(trajectory_from_csv(&text(bytes))));
    attack(27, 3000, kitti_from_trajectory(&trajectory).as_bytes(), |bytes| {
        if let Ok(poses) = poses_from_kitti(&text(bytes)) {
            assert!(poses.iter().all(|pose| (pose.rotation.norm() - 1.0).abs() < 1e-9));
        }
    });
}

#[test]
fn damaged_spectra_and_lens_calibrations_do_not_panic() {
    let spectrum = seed("ecostress");
    formats::ecostress::parse(&String::from_utf8_lossy(&spectrum)).expect("parses");
    attack(28, 3000, &spectrum, |bytes| {
        if let Ok(spectrum) = formats::ecostress::parse(&String::from_utf8_lossy(bytes)) {
            assert_eq!(spectrum.wavelengths_nm.len(), spectrum.reflectances.len());
        }
    });
    attack(29, 3000, &seed("ladybug"), |bytes| {
        let _ = String::from_utf8_lossy(bytes).parse::<LadybugCalibration>();
    });
}

#[test]
fn damaged_recordings_do_not_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mcap");
    attack(30, 2000, &seed("mcap"), |bytes| {
        std::fs::write(&path, bytes).expect("writes");
        let Ok(mut reader) = TickReader::open(&path, &["class"]) else { return };
        let mut n_ticks = 0;
        while let Ok(Some(_)) = reader.next() {
            n_ticks += 1;
        }
        assert!(n_ticks <= 8);
    });
}

#[test]
fn damaged_manifests_do_not_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "version = 1\nname = \"x\"\n[lidar]\nmodel = \"hdl64e\"\nformat = \"bin\"\nfolder = \"lidar\"\n\
                body_from_lidar = { translation = [0, 0, 1.9], rotation = [0, 0, 0, 1] }\n\
                [[camera]]\nname = \"front\"\nfolder = \"camera\"\nexposure_nanos = 5000000\n\
                body_from_camera = { translation = [0, 0, 1], rotation = [0, 0, 0, 1] }\n\
                model = { kind = \"pinhole\", width = 64, height = 48, fx = 60, fy = 60, cx = 32, cy = 24 }\n";
    std::fs::create_dir_all(folder.path().join("lidar")).expect("makes");
    std::fs::create_dir_all(folder.path().join("camera")).expect("makes");
    std::fs::write(folder.path().join("lidar/0.bin"), [0; 16]).expect("writes");
    let open = |folder: &Path, bytes: &[u8]| {
        std::fs::write(folder.join("drive.toml"), bytes).expect("writes");
        Drive::open(folder)
    };
    open(folder.path(), text.as_bytes()).expect("is valid");
    attack(11, 2000, text.as_bytes(), |bytes| {
        if let Err(error) = open(folder.path(), bytes) {
            assert!(!error.problems.is_empty() && error.to_string().contains("drive.toml"));
        }
    });
}

#[test]
fn manifest_with_many_problems_is_refused_with_the_first_ones() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("drive.toml");
    let keys = (0..50_000).map(|k| format!("key_{k} = 1\n")).collect::<Vec<_>>().concat();
    let cameras = "[[camera]]\nname = 1\n".repeat(40_000);
    for text in [keys, cameras] {
        std::fs::write(&path, text).expect("writes");
        let error = Drive::open(folder.path()).expect_err("refused");
        assert!(error.problems.len() <= 21, "{} problems", error.problems.len());
        assert!(error.to_string().ends_with("further problems"), "{error}");
    }
    std::fs::write(&path, "# \n".repeat(400_000)).expect("writes");
    let error = Drive::open(folder.path()).expect_err("refused").to_string();
    assert!(error.contains("drive.toml: cannot read the file: has more than 1048576 bytes"), "{error}");
}

#[test]
fn texts_of_a_recording_longer_than_their_record_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mcap");
    for (opcode, body) in [
        // Schema: id, name. Channel: id, schema, topic. Metadata: name, then a map with a key. Chunk: times, size, sum, compression.
        (3_u8, [&1_u16.to_le_bytes()[..], &u32::MAX.to_le_bytes(), b"x"].concat()),
        (4, [&[1, 0, 1, 0][..], &1_760_000_000_u32.to_le_bytes(), b"x"].concat()),
        (
            12,
            [&1_u32.to_le_bytes()[..], b"r", &8_u32.to_le_bytes(), &3_000_000_000_u32.to_le_bytes(), b"abcd"].concat(),
        ),
        (6, [&[0; 28][..], &3_000_000_000_u32.to_le_bytes(), &[0; 8]].concat()),
    ] {
        let mut bytes = b"\x89MCAP0\r\n".to_vec();
        bytes.extend([&[opcode][..], &(body.len() as u64).to_le_bytes(), &body].concat());
        std::fs::write(&path, &bytes).expect("writes");
        let error = TickReader::open(&path, &["class"]).err().expect("refused").to_string();
        assert!(error.contains("a text of") && error.contains("bytes are left"), "{error}");
    }
}

fn attack_calibration(seed: u64, rounds: usize, text: &[u8]) {
    let (mut refused, mut read) = (0, 0);
    attack(seed, rounds, text, |bytes| {
        let text = String::from_utf8_lossy(bytes);
        match SensorCalibration::from_xml(&text) {
            Ok(_) => read += 1,
            Err(error) => {
                let n_lines = text.lines().count().max(1) as u32 + 1;
                assert!((1..=n_lines).contains(&error.line), "{error} of {n_lines} lines");
                assert!(!error.element.is_empty() && !error.rule.is_empty(), "{error}");
                refused += 1;
            }
        }
    });
    assert!(refused > rounds / 4 && refused + read >= rounds, "{refused} refused, {read} read");
}

#[test]
fn damaged_calibrations_do_not_panic() {
    let seed = seed("sensor_calibration");
    let made = SensorCalibration::from_xml(&String::from_utf8_lossy(&seed)).expect("is valid");
    assert_eq!(made.to_xml().as_bytes(), seed);
    attack_calibration(21, 3000, &seed);
}

#[real_data::test(
    "photonfocus/CMV2K-SSM4x4-470_620-9.4.10.10_HS03-VIS.xml",
    "photonfocus/CMV2K-SSM5x5-665_975-13.8.15.1_HS02-NIR.xml"
)]
fn damaged_real_calibrations_do_not_panic() {
    for name in ["CMV2K-SSM4x4-470_620-9.4.10.10_HS03-VIS.xml", "CMV2K-SSM5x5-665_975-13.8.15.1_HS02-NIR.xml"] {
        let path = real_data::path(&format!("photonfocus/{name}"));
        attack_calibration(22, 100, &std::fs::read(path).expect("readable"));
    }
}

#[test]
fn damaged_cubes_do_not_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut header = envi::Header::new(6, 5, 4);
    header.wavelengths = vec![500.0, 510.0, 520.0, 530.0];
    header.wavelength_units = "nm".to_owned();
    let path = folder.path().join("cube.hdr");
    envi::write(&path, &envi::Image { header, values: vec![0.5; 120] }).expect("written");
    let text = std::fs::read(&path).expect("readable");
    let mut read = 0;
    attack(23, 1500, &text, |bytes| {
        std::fs::write(&path, bytes).expect("written");
        match envi::read(&path) {
            // An image has the size of its header and is never larger than the data file.
            Ok(image) => {
                let n = image.header.samples * image.header.lines * image.header.bands;
                assert!(image.values.len() == n && n <= 480, "{:?}", image.header);
                read += 1;
            }
            Err(error) => assert!(error.line != Some(0), "{error}"),
        }
    });
    assert!(read > 20, "{read}");
}
