//! Damaged, foreign and missing data of a recorded drive: the rest is published, and the run reports doubts.

use crate::support::{BEGIN, SIZE, write_drive, write_lidar};
use acquire::{Acquire, Settings};
use drive::imu::HEADER;
use lidar::pcap::{PacketReader, Writer};
use messages::ImageTopic;
use stage::testing::{Bench, context};
use stage::{Flow, StepError};
use std::fs;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::path::{Path, PathBuf};

fn drive() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    write_drive(folder.path());
    folder
}

/// The bench at the end of a run.
fn at_end(folder: &Path) -> Bench<Acquire> {
    let mut bench = Bench::new(&Settings::default(), &context(folder)).expect("opens");
    while bench.tick().expect("steps") == Flow::Continue {}
    bench.finish().expect("finishes");
    bench
}

/// All doubts of the stage.
const DOUBTS: [&str; 15] = [
    "foreign_packets",
    "damaged_packets",
    "unread_captures",
    "cut_captures",
    "clocks_set_back",
    "missing_files",
    "bad_nmea_lines",
    "few_fixes",
    "two_receivers",
    "bad_images",
    "bad_mosaics",
    "bad_imu_lines",
    "bad_sweeps",
    "exposures_outside",
    "silent_sensors",
];

fn doubts(bench: &Bench<Acquire>) -> Vec<(&'static str, f64)> {
    DOUBTS.into_iter().filter_map(|name| bench.doubt(name).map(|size| (name, size))).collect()
}

/// The only doubt of a run, and its size.
fn doubt_of(folder: &Path, name: &str) -> f64 {
    let found = doubts(&at_end(folder));
    assert!(matches!(found[..], [(only, _)] if only == name), "{found:?}");
    found[0].1
}

fn capture(folder: &Path) -> PathBuf {
    folder.join("lidar/0.pcap")
}

/// Moves the stamps of all images and mosaics.
fn shift_exposures(folder: &Path, seconds: i64) {
    for camera in ["camera/0", "camera/1", "hs03"] {
        let files: Vec<PathBuf> =
            folder.join(camera).read_dir().expect("lists").map(|e| e.expect("lists").path()).collect();
        for path in files {
            let stamp: i64 = path.file_stem().and_then(|stem| stem.to_str()).expect("a name").parse().expect("a stamp");
            let extension = path.extension().expect("has one").to_owned();
            let moved = path.with_file_name((stamp + seconds * 1_000_000_000).to_string()).with_extension(extension);
            fs::rename(path, moved).expect("renames");
        }
    }
}

#[test]
fn sound_drive_has_no_doubt() {
    assert_eq!(doubts(&at_end(drive().path())), []);
}

#[test]
fn mostly_foreign_packets_are_a_doubt() {
    let folder = drive();
    let path = capture(folder.path());
    let mut reader = PacketReader::open(&path).expect("opens");
    let mut writer = Writer::new(Vec::new()).expect("writes");
    let other = SocketAddrV4::new(Ipv4Addr::new(192, 168, 1, 9), 5000);
    let target = SocketAddrV4::new(Ipv4Addr::BROADCAST, 2368);
    while let Some(packet) = reader.next().expect("reads") {
        writer.write_datagram(packet.stamp, packet.source, target, packet.payload).expect("writes");
        for _ in 0..3 {
            writer.write_datagram(packet.stamp, other, target, &[7; 100]).expect("writes");
        }
    }
    fs::write(&path, writer.finish().expect("writes")).expect("writes");
    assert!((doubt_of(folder.path(), "foreign_packets") - 0.75).abs() < 1e-3);
}

#[test]
fn flipped_bit_that_loses_a_capture_is_a_doubt_with_its_share() {
    let folder = drive();
    let path = capture(folder.path());
    let mut bytes = fs::read(&path).expect("reads");
    let record = 16 + 42 + 1206;
    // The length of a packet at three quarters. After this, the cameras also outlast the sweeps.
    bytes[24 + 5700 * record + 11] ^= 0x80;
    fs::write(&path, bytes).expect("writes");
    let bench = at_end(folder.path());
    let share = bench.doubt("unread_captures").expect("is a doubt");
    assert!((share - 0.25).abs() < 1e-3, "{share}");
    // The exposures at 3.25 s, of 12 in all.
    assert_eq!(bench.doubt("exposures_outside"), Some(3.0 / 12.0));
}

#[test]
fn cut_capture_is_a_doubt() {
    let folder = drive();
    let path = capture(folder.path());
    let bytes = fs::read(&path).expect("reads");
    fs::write(&path, &bytes[..bytes.len() - 700]).expect("writes");
    assert!((doubt_of(folder.path(), "cut_captures") - 1.0).abs() < 1e-9);
}

/// Writes the packets of the capture from one to before another number to a file, with both clocks set back.
fn write_part(packets: &[(geometry::Stamp, Vec<u8>)], path: &Path, back_s: i64) {
    let mut writer = Writer::new(Vec::new()).expect("writes");
    for (stamp, payload) in packets {
        let mut payload = payload.clone();
        let micros = u32::from_le_bytes(payload[1200..1204].try_into().expect("4 bytes"));
        let past_hour = (i64::from(micros) - back_s * 1_000_000).rem_euclid(3_600_000_000);
        payload[1200..1204].copy_from_slice(&(past_hour as u32).to_le_bytes());
        writer.write_udp(stamp.plus_nanos(-back_s * 1_000_000_000), 2368, &payload).expect("writes");
    }
    fs::write(path, writer.finish().expect("writes")).expect("writes");
}

fn data_packets(path: &Path) -> Vec<(geometry::Stamp, Vec<u8>)> {
    let mut reader = PacketReader::open(path).expect("opens");
    let mut packets = Vec::new();
    while let Some(packet) = reader.next().expect("reads") {
        if packet.payload.len() == 1206 {
            packets.push((packet.stamp, packet.payload.to_vec()));
        }
    }
    packets
}

#[test]
fn clocks_that_step_back_together_are_a_doubt_with_the_seconds() {
    let folder = drive();
    let path = capture(folder.path());
    let packets = data_packets(&path);
    let (first, second) = packets.split_at(packets.len() / 2);
    let later = path.with_file_name("later.pcap");
    write_part(first, &path, 0);
    write_part(second, &later, 600);
    // One capture that contains both parts.
    let tail = fs::read(&later).expect("reads");
    let mut bytes = fs::read(&path).expect("reads");
    bytes.extend_from_slice(&tail[24..]);
    fs::write(&path, bytes).expect("writes");
    fs::remove_file(later).expect("removes");
    let back_s = at_end(folder.path()).doubt("clocks_set_back").expect("is a doubt");
    assert!((back_s - 600.0).abs() < 0.1, "{back_s}");
}

#[test]
fn clock_of_the_recorder_that_is_set_during_the_drive_is_a_doubt() {
    for jump_s in [-5, 3600] {
        let folder = drive();
        let path = capture(folder.path());
        let packets = data_packets(&path);
        let mut writer = Writer::new(Vec::new()).expect("writes");
        for (number, (stamp, payload)) in packets.iter().enumerate() {
            let ahead_s = if number < packets.len() / 2 { 0 } else { jump_s };
            writer.write_udp(stamp.plus_nanos(ahead_s * 1_000_000_000), 2368, payload).expect("writes");
        }
        fs::write(&path, writer.finish().expect("writes")).expect("writes");
        let largest_s = at_end(folder.path()).doubt("recorder_clock").expect("is a doubt");
        assert!((largest_s - f64::abs(jump_s as f64)).abs() < 0.1, "{largest_s}");
    }
}

#[test]
fn captures_with_numbers_against_their_times_are_refused_and_a_missing_one_is_a_doubt() {
    let folder = drive();
    let path = capture(folder.path());
    let packets = data_packets(&path);
    fs::remove_file(&path).expect("removes");
    let quarter = packets.len() / 4;
    let part = |number: usize| path.with_file_name(format!("x.pcap{number}"));
    for number in [0, 1, 3] {
        write_part(&packets[number * quarter..(number + 1) * quarter], &part(number), 0);
    }
    assert_eq!(at_end(folder.path()).doubt("missing_files"), Some(1.0));
    write_part(&packets[2 * quarter..3 * quarter], &part(2), 0);
    assert_eq!(doubts(&at_end(folder.path())), []);
    write_part(&packets[3 * quarter..], &part(3), 600);
    let error = Bench::<Acquire>::new(&Settings::default(), &context(folder.path())).err().expect("is refused");
    let error = error.to_string();
    assert!(
        error.contains("x.pcap3 (") && error.contains("has the higher number, but its times are earlier"),
        "{error}"
    );
}

#[test]
fn bad_lines_of_imu_and_receiver_are_doubts_above_their_share() {
    let folder = drive();
    let imu = folder.path().join("imu.csv");
    let good = fs::read_to_string(&imu).expect("reads");
    let damaged = |share: usize, line: &str| {
        let lines = good.lines().enumerate().map(|(n, good)| if n % share == 7 { line } else { good });
        fs::write(&imu, lines.collect::<Vec<_>>().join("\n")).expect("writes");
    };
    // One of a few hundred lines.
    damaged(300, "garbage");
    assert_eq!(doubts(&at_end(folder.path())), []);
    damaged(20, "garbage");
    let share = doubt_of(folder.path(), "bad_imu_lines");
    assert!((share - 0.05).abs() < 0.01, "{share}");
    // Impossible values count as damage.
    damaged(20, "1,1e9,0,9.81,0,0,0");
    assert!((doubt_of(folder.path(), "bad_imu_lines") - share).abs() < 0.01);
    fs::write(&imu, format!("{HEADER}\n{}", "garbage\n".repeat(100))).expect("writes");
    let found = doubts(&at_end(folder.path()));
    assert_eq!(found, [("bad_imu_lines", 1.0), ("silent_sensors", 1.0)]);

    fs::write(&imu, &good).expect("writes");
    let log = folder.path().join("gnss.nmea");
    let text = fs::read_to_string(&log).expect("reads");
    fs::write(&log, format!("{text}\r\n$GPGGA,noise*00\r\n$GPGSV,1,1,00*79")).expect("writes");
    assert!((doubt_of(folder.path(), "bad_nmea_lines") - 1.0 / 12.0).abs() < 1e-9);
}

#[test]
fn log_of_two_receivers_is_a_doubt_with_their_distance() {
    let folder = drive();
    let log = folder.path().join("gnss.nmea");
    let text = fs::read_to_string(&log).expect("reads");
    let second = text.lines().filter(|line| line.contains("GGA")).map(|line| {
        // A tenth of a minute farther north.
        let (body, _) = line[3..].rsplit_once('*').expect("is sealed");
        let mut fields: Vec<String> = body.split(',').map(str::to_owned).collect();
        let minutes: f64 = fields[2].parse().expect("a number");
        fields[2] = format!("{:011.6}", minutes + 0.1);
        format!("$GN{}", fields.join(","))
    });
    let second: Vec<String> = second.collect();
    let mut of_second = second.iter();
    let mixed = text.lines().map(|line| match of_second.next().filter(|_| line.contains("GGA")) {
        Some(second) => format!("{line}\r\n{second}\r\n"),
        None => format!("{line}\r\n"),
    });
    fs::write(&log, mixed.collect::<String>()).expect("writes");
    let apart_m = doubt_of(folder.path(), "two_receivers");
    assert!((apart_m - 185.3).abs() < 0.5, "{apart_m} m");
}

#[test]
fn log_without_heights_is_a_doubt() {
    let folder = drive();
    let log = folder.path().join("gnss.nmea");
    let text = fs::read_to_string(&log).expect("reads");
    let rmc: Vec<&str> = text.lines().filter(|line| line.contains("RMC")).collect();
    fs::write(&log, rmc.join("\r\n")).expect("writes");
    assert!(doubt_of(folder.path(), "few_fixes").abs() < 1e-9);
}

#[test]
fn cut_jpegs_and_images_of_another_size_are_skipped_and_a_doubt() {
    let folder = drive();
    let camera = folder.path().join("camera/1");
    let stamp = |second: i64| BEGIN.0 + second * 1_000_000_000 + 250_000_000;
    for second in 0..4 {
        fs::remove_file(camera.join(format!("{}.png", stamp(second)))).expect("is there");
        let image = image::RgbImage::from_fn(SIZE[0], SIZE[1], |x, y| image::Rgb([(x * 12) as u8, (y * 25) as u8, 9]));
        let path = camera.join(format!("{}.jpg", stamp(second)));
        image.save(&path).expect("writes");
        if second == 1 {
            let whole = fs::read(&path).expect("reads");
            fs::write(&path, &whole[..whole.len() - 20]).expect("writes");
        }
    }
    image::RgbImage::new(3, 3).save(camera.join(format!("{}.jpg", stamp(2)))).expect("writes");
    let mut bench = Bench::<Acquire>::new(&Settings::default(), &context(folder.path())).expect("opens");
    let mut n_images = 0;
    while bench.tick().expect("steps") == Flow::Continue {
        n_images += bench.take::<ImageTopic>().len();
    }
    bench.finish().expect("finishes");
    assert_eq!((n_images, bench.counter("bad_images")), (6, 2));
    assert_eq!(doubts(&bench), [("bad_images", 0.25)]);
    let notes = bench.notes().join("\n");
    assert!(notes.contains("without the end of the image; the file is cut"), "{notes}");
}

/// The end marker is intact; decoders return an image of which a half is gray or garbled.
#[test]
fn jpeg_damaged_in_its_middle_is_skipped_and_a_doubt() {
    let folder = drive();
    let camera = folder.path().join("camera/1");
    let path = camera.join(format!("{}.jpg", BEGIN.0 + 1_250_000_000));
    fs::remove_file(path.with_extension("png")).expect("is there");
    let image = image::RgbImage::from_fn(SIZE[0], SIZE[1], |x, y| image::Rgb([(x * 12) as u8, (y * 25) as u8, 9]));
    image.save(&path).expect("writes");
    let whole = fs::read(&path).expect("reads");
    let data = whole.windows(2).position(|pair| pair == [0xff, 0xda]).expect("a scan") + 14;
    let end = whole.len() - 2;
    fs::write(&path, [&whole[..data + (end - data) / 2], &whole[end..]].concat()).expect("writes");
    let bench = at_end(folder.path());
    assert_eq!(doubts(&bench), [("bad_images", 0.125)]);
    let notes = bench.notes().join("\n");
    assert!(notes.contains(&*path.to_string_lossy()) && notes.contains("damaged JPEG data"), "{notes}");
}

#[test]
fn empty_camera_folder_is_a_doubt() {
    let folder = drive();
    fs::remove_dir_all(folder.path().join("camera/1")).expect("is there");
    fs::create_dir(folder.path().join("camera/1")).expect("makes");
    assert!((doubt_of(folder.path(), "silent_sensors") - 1.0).abs() < 1e-9);
}

#[test]
fn exposures_an_hour_off_are_a_doubt() {
    for seconds in [-3600, 3600] {
        let folder = drive();
        shift_exposures(folder.path(), seconds);
        assert!((doubt_of(folder.path(), "exposures_outside") - 1.0).abs() < 1e-9);
    }
}

#[test]
fn part_of_a_drive_has_no_doubt_about_the_rest() {
    let folder = drive();
    let settings = Settings { start_s: 1.0, end_s: 2.5, ..Settings::default() };
    let mut bench = Bench::<Acquire>::new(&settings, &context(folder.path())).expect("opens");
    while bench.tick().expect("steps") == Flow::Continue {}
    bench.finish().expect("finishes");
    assert_eq!(doubts(&bench), []);
}

#[test]
fn drive_without_a_sweep_fails() {
    let folder = drive();
    let run = |settings: Settings| {
        let mut bench = Bench::<Acquire>::new(&settings, &context(folder.path())).expect("opens");
        loop {
            match bench.tick() {
                Ok(flow) => assert_eq!(flow, Flow::Continue, "the run must not succeed"),
                Err(error) => {
                    assert!(matches!(error, StepError::Configuration(_)), "a restart cannot help: {error:?}");
                    return error.to_string();
                }
            }
        }
    };
    let error = run(Settings { start_s: 60.0, ..Settings::default() });
    assert!(error.contains("no sweep in the drive from start_s = 60 on (0 partial, 7600 data packets"), "{error}");
    write_lidar(folder.path(), |packet| packet < 30);
    let error = run(Settings::default());
    assert!(error.contains("no sweep in the drive (1 partial, 30 data packets"), "{error}");
}

#[test]
fn doubts_survive_a_restart() {
    let folder = drive();
    let imu = folder.path().join("imu.csv");
    let text = fs::read_to_string(&imu).expect("reads");
    let lines = text.lines().enumerate().map(|(n, line)| if n % 20 == 7 { "garbage" } else { line });
    fs::write(&imu, lines.collect::<Vec<_>>().join("\n")).expect("writes");
    let expected = doubt_of(folder.path(), "bad_imu_lines");
    let settings = Settings::default();
    let mut bench = Bench::<Acquire>::new(&settings, &context(folder.path())).expect("opens");
    for _ in 0..30 {
        bench.tick().expect("steps");
    }
    let mut bench = bench.restarted(&settings, &context(folder.path())).expect("restarts");
    while bench.tick().expect("steps") == Flow::Continue {}
    bench.finish().expect("finishes");
    let found = bench.doubt("bad_imu_lines").expect("is a doubt");
    assert!((found - expected).abs() < 0.005, "{found} {expected}");
}
