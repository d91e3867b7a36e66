//! Recorded drives, tick by tick.

use crate::support::{BEGIN, SIZE, fix, range_2mm, red, sample, write_drive, write_lidar};
use acquire::{Acquire, Settings};
use messages::{GnssTopic, ImageTopic, ImuTopic, MosaicTopic, SweepTopic, pod};
use stage::testing::{Bench, context};
use stage::{Flow, Received, Stage};
use std::fs;
use std::path::Path;

/// The messages of one tick, as bytes.
type Tick = [Vec<Vec<u8>>; 5];

fn bytes<T: messages::Message>(messages: &[Received<T>]) -> Vec<Vec<u8>> {
    let one = |message: &Received<T>| {
        let rows = pod::bytes_from_rows(message.rows());
        let header = pod::bytes_from_rows(std::slice::from_ref(message.header()));
        [&message.stamp().to_le_bytes()[..], header, rows].concat()
    };
    messages.iter().map(one).collect()
}

fn take(bench: &mut Bench<Acquire>) -> Tick {
    [
        bytes(&bench.take::<SweepTopic>()),
        bytes(&bench.take::<ImageTopic>()),
        bytes(&bench.take::<MosaicTopic>()),
        bytes(&bench.take::<GnssTopic>()),
        bytes(&bench.take::<ImuTopic>()),
    ]
}

fn open(folder: &Path, settings: &Settings) -> Bench<Acquire> {
    Bench::new(settings, &context(folder)).expect("opens")
}

fn all_ticks(bench: &mut Bench<Acquire>) -> Vec<Tick> {
    let mut ticks = Vec::new();
    while bench.tick().expect("steps") == Flow::Continue {
        ticks.push(take(bench));
    }
    ticks
}

fn drive() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    write_drive(folder.path());
    folder
}

#[test]
fn measurements_are_published_with_the_sweep_of_their_time() {
    let folder = drive();
    let mut bench = open(folder.path(), &Settings::default());
    let mut n_imu = 0;
    let mut n_fixes = 0;
    for tick in 0..42_i64 {
        assert_eq!(bench.tick().expect("steps"), Flow::Continue);
        let begin = BEGIN.0 + tick * 100_000_000;
        let [sweep] = bench.take::<SweepTopic>().try_into().ok().expect("one sweep");
        assert!((sweep.stamp() - begin).abs() < 60_000, "{tick}: {}", sweep.stamp());
        let end = sweep.stamp() + i64::from(sweep.header().duration_nanos);
        assert_eq!((sweep.header().n_rings, sweep.header().has_times, sweep.header().lost_packets), (32, 1, 0));
        assert!((69_400..69_480).contains(&sweep.rows().len()) || tick == 41, "{}", sweep.rows().len());
        let first = (sweep.stamp() - BEGIN.0 + 23_040) / 46_080;
        let point = sweep.rows()[0];
        let range_m = point.x.hypot(point.y).hypot(point.z);
        assert!((range_m - f32::from(range_2mm(first)) * 0.002).abs() < 1e-4, "{tick}: {range_m}");

        let in_tick = |stamp: i64| (sweep.stamp()..end).contains(&stamp);
        let images = bench.take::<ImageTopic>();
        let mosaics = bench.take::<MosaicTopic>();
        let is_exposure = matches!(tick, 2 | 12 | 22 | 32);
        assert_eq!((images.len(), mosaics.len()), if is_exposure { (2, 1) } else { (0, 0) }, "{tick}");
        for (camera, image) in images.iter().enumerate() {
            assert!(in_tick(image.stamp()));
            let header = image.header();
            assert_eq!((header.camera, [header.width, header.height]), (camera as u32, SIZE));
            assert_eq!((header.channels, header.exposure_nanos, image.rows().len()), (3, 2_000_000, 600));
            assert_eq!(image.rows()[..4], [red(geometry::Stamp(image.stamp()), camera), 2, 3, 0]);
        }
        for mosaic in &mosaics {
            assert!(in_tick(mosaic.stamp()));
            assert_eq!((mosaic.header().bit_depth, mosaic.rows().len()), (10, 200));
            assert_eq!(mosaic.rows()[7], 7 + (tick / 10) as u16);
        }
        for row in bench.take::<GnssTopic>().iter().flat_map(|message| message.rows().to_vec()) {
            let expected = fix(n_fixes);
            assert!(in_tick(row.stamp));
            assert_eq!((row.stamp, row.quality, row.satellites), (expected.stamp.0, 4, 8));
            assert!((row.longitude_deg - expected.position_deg[1]).abs() < 1e-8);
            assert!((row.altitude_m - 104.0).abs() < 1e-3);
            n_fixes += 1;
        }
        for message in bench.take::<ImuTopic>() {
            assert_eq!(message.stamp(), message.rows()[0].stamp);
            for row in message.rows() {
                assert!(in_tick(row.stamp));
                assert_eq!(row.angular_rate, sample(n_imu).angular_rate);
                n_imu += 1;
            }
        }
    }
    // The partial revolution at the end is not published.
    assert_eq!(bench.tick().expect("steps"), Flow::End);
    assert_eq!((bench.counter("partial_sweeps"), bench.counter("lost_packets")), (1, 0));
    assert_eq!(bench.counter("data_packets"), crate::support::N_PACKETS as u64);
    // The last complete revolution ends 32 µs after 4.2 s, so it includes the sample at 4.2 s.
    assert_eq!((n_imu, n_fixes, bench.notes().len()), (421, 5, 0));
}

#[test]
fn restart_between_ticks_gives_the_same_bytes() {
    let folder = drive();
    let settings = Settings::default();
    let reference = all_ticks(&mut open(folder.path(), &settings));
    assert_eq!(reference.len(), 42);
    for cut in [0, 1, 2, 3, 13, 20, 41] {
        let mut bench = open(folder.path(), &settings);
        for _ in 0..cut {
            bench.tick().expect("steps");
            take(&mut bench);
        }
        let mut bench = bench.restarted(&settings, &context(folder.path())).expect("restarts");
        assert_eq!(all_ticks(&mut bench), reference[cut..], "cut at {cut}");
        assert_eq!(bench.counter("data_packets"), crate::support::N_PACKETS as u64);
    }
    let other = tempfile::tempdir().expect("a folder");
    write_drive(other.path());
    write_lidar(other.path(), |packet| packet < 100);
    let state = {
        let mut bench = open(folder.path(), &settings);
        all_ticks(&mut bench);
        bench.stage.save().expect("saves").to_vec()
    };
    assert!(open(other.path(), &settings).stage.load(&state).is_err(), "the state of a longer drive");
}

#[test]
fn damaged_files_are_skipped_and_counted() {
    let folder = drive();
    let reference = all_ticks(&mut open(folder.path(), &Settings::default()));
    let stamp = |tenths: i64| BEGIN.0 + tenths * 100_000_000 + 50_000_000;
    let camera = folder.path().join("camera/1");
    let whole = fs::read(camera.join(format!("{}.png", stamp(12)))).expect("reads");
    fs::write(camera.join(format!("{}.png", stamp(12))), &whole[..whole.len() / 2]).expect("writes");
    image::RgbImage::new(3, 3).save(camera.join(format!("{}.png", stamp(22)))).expect("writes");
    fs::write(camera.join("cover.png"), b"").expect("writes");
    fs::write(folder.path().join(format!("hs03/{}.pgm", stamp(2))), b"P5 20 10 65535 ").expect("writes");
    let imu = fs::read_to_string(folder.path().join("imu.csv")).expect("reads");
    fs::write(folder.path().join("imu.csv"), imu.replace("\n1699999199", "\nx1699999199")).expect("writes");

    let mut bench = open(folder.path(), &Settings::default());
    let ticks = all_ticks(&mut bench);
    assert_eq!((bench.counter("bad_images"), bench.counter("bad_mosaics")), (2, 1));
    assert_eq!((bench.counter("strange_files"), bench.counter("bad_imu_lines")), (1, 100));
    let notes = bench.notes().join("\n");
    for words in ["3 x 3 px, the camera has 20 x 10", "hs03", "cover.png", "imu: line"] {
        assert!(notes.contains(words), "{notes}");
    }
    for (tick, reference) in ticks.iter().zip(&reference) {
        assert_eq!((&tick[0], &tick[3]), (&reference[0], &reference[3]));
    }
    let n_images: usize = ticks.iter().map(|tick| tick[1].len()).sum();
    assert_eq!(n_images, 6);
}

#[test]
fn damaged_lines_before_first_sweep_are_counted_and_reported() {
    let folder = drive();
    let imu = folder.path().join("imu.csv");
    let lines = fs::read_to_string(&imu).expect("reads");
    // The 100 samples of the second before the first sweep: the first one, the last one and eight between them.
    let is_damaged = |n: usize| n == 1 || n == 100 || (10..90).contains(&n) && n.is_multiple_of(10);
    let damage = |(n, line): (usize, &str)| if is_damaged(n) { format!("x{line}\n") } else { format!("{line}\n") };
    fs::write(&imu, lines.lines().enumerate().map(damage).collect::<String>()).expect("writes");
    let log = folder.path().join("gnss.nmea");
    let sentences = fs::read_to_string(&log).expect("reads");
    fs::write(&log, format!("$GPGGA,noise*00\r\n{sentences}")).expect("writes");

    let settings = Settings::default();
    // A state from before the first sweep has counted nothing.
    let restarted = open(folder.path(), &settings).restarted(&settings, &context(folder.path())).expect("restarts");
    for mut bench in [open(folder.path(), &settings), restarted] {
        all_ticks(&mut bench);
        assert_eq!((bench.counter("bad_imu_lines"), bench.counter("bad_nmea_lines")), (10, 1));
        let notes = bench.notes().join("\n");
        assert!(notes.contains("imu: line 2: stamp \"x"), "{notes}");
    }
}

#[test]
fn lost_packets_are_counted_in_their_sweep() {
    let folder = drive();
    write_lidar(folder.path(), |packet| !(1000..1003).contains(&packet) && packet != 5000);
    let mut bench = open(folder.path(), &Settings::default());
    let mut lost = Vec::new();
    while bench.tick().expect("steps") == Flow::Continue {
        lost.extend(bench.take::<SweepTopic>().iter().map(|sweep| sweep.header().lost_packets));
    }
    // Packet n is in sweep n / 180.84.
    assert_eq!((lost[5], lost[27], lost.iter().sum::<u32>()), (3, 1, 4));
    assert_eq!(bench.counter("lost_packets"), 4);
}

#[test]
fn part_of_a_drive_equals_that_part_of_the_whole() {
    let folder = drive();
    let whole = all_ticks(&mut open(folder.path(), &Settings::default()));
    let settings = Settings { start_s: 1.0, end_s: 2.5, ..Settings::default() };
    let part = all_ticks(&mut open(folder.path(), &settings));
    assert!((14..=16).contains(&part.len()), "{}", part.len());
    let first = whole.len().min(10);
    assert_eq!(part, whole[first..first + part.len()]);
}

#[test]
fn trigger_skips_exposures_and_counts_them() {
    let folder = drive();
    let settings = Settings { trigger_m: 7.0, ..Settings::default() };
    let mut bench = open(folder.path(), &settings);
    let ticks = all_ticks(&mut bench);
    // At 5 m/s every second exposure of each camera is too early.
    assert_eq!(ticks.iter().map(|tick| tick[1].len()).sum::<usize>(), 4);
    assert_eq!((bench.counter("images_skipped_by_trigger"), bench.counter("mosaics_skipped_by_trigger")), (4, 2));
}

#[test]
fn check_names_problems_of_settings_and_drive() {
    let folder = drive();
    assert_eq!(Acquire::check(&Settings::default(), &context(folder.path())), []);
    let toml = fs::read_to_string(folder.path().join("drive.toml")).expect("reads");
    fs::write(folder.path().join("drive.toml"), toml.replace("hdl32e", "hdl33e")).expect("writes");
    let settings = Settings { start_s: 3.0, end_s: 2.0, ..Settings::default() };
    let problems = Acquire::check(&settings, &context(folder.path()));
    assert_eq!(problems.len(), 2);
    assert_eq!(problems[0].key, "end_s");
    assert!(problems[1].text.contains("lidar.model: value \"hdl33e\" must be one of"), "{problems:?}");
    assert!(Bench::<Acquire>::new(&settings, &context(folder.path())).is_err());
}

#[real_data::test("kitti_raw_0048/*.pcd")]
fn folder_of_real_sweeps_without_manifest_is_read() {
    let folder = real_data::path("kitti_raw_0048");
    let mut bench = open(&folder, &Settings::default());
    let mut n_points = 0;
    for tick in 0..22 {
        assert_eq!(bench.tick().expect("steps"), Flow::Continue);
        let [sweep] = bench.take::<SweepTopic>().try_into().ok().expect("one sweep");
        assert_eq!((sweep.stamp(), sweep.header().has_times, sweep.header().n_rings), (tick * 100_000_000, 0, 64));
        n_points += sweep.rows().len();
    }
    assert_eq!(bench.tick().expect("steps"), Flow::End);
    assert!((22 * 110_000..22 * 125_000).contains(&n_points), "{n_points}");
    assert!(bench.notes()[0].contains("no drive.toml"));
}

/// Regression: a wrong model was found only after the start, and the run was restarted three times.
#[test]
fn wrong_model_is_reported_before_the_start() {
    let folder = drive();
    let path = folder.path().join("drive.toml");
    let text = fs::read_to_string(&path).expect("reads").replace("hdl32e", "vlp16");
    fs::write(&path, text).expect("writes");
    let problems = Acquire::check(&Settings::default(), &context(folder.path()));
    assert_eq!(problems.len(), 1, "{problems:?}");
    let words = "lidar/0.pcap: packet 1: factory byte 0x21 names the HDL-32E, drive.toml says \"vlp16\"; \
                 set lidar.model = \"hdl32e\"";
    assert!(problems[0].text.contains(words), "{problems:?}");
}

#[test]
fn capture_without_data_packets_is_reported_before_the_start() {
    let folder = drive();
    write_lidar(folder.path(), |_| false);
    let problems = Acquire::check(&Settings::default(), &context(folder.path()));
    assert_eq!(problems.len(), 1, "{problems:?}");
    assert!(problems[0].text.contains("lidar/0.pcap: no data packet of hdl32e"), "{problems:?}");
}

#[test]
fn capture_is_a_drive_of_its_lidar_alone() {
    let folder = drive();
    let capture = folder.path().join("lidar/0.pcap");
    let of_capture = stage::Context { drive: capture, ..context(folder.path()) };
    assert_eq!(Acquire::check(&Settings::default(), &of_capture), []);
    let mut alone = Bench::<Acquire>::new(&Settings::default(), &of_capture).expect("opens");
    let mut whole = open(folder.path(), &Settings::default());
    let alone = all_ticks(&mut alone);
    let whole = all_ticks(&mut whole);
    assert_eq!(alone.len(), whole.len());
    assert!(alone.iter().zip(&whole).all(|(alone, whole)| alone[0] == whole[0]), "the same sweeps");
    assert!(alone.iter().all(|[_, others @ ..]| others.iter().all(Vec::is_empty)), "no other sensor");
    let text = folder.path().join("notes.txt");
    fs::write(&text, "not a capture").expect("writes");
    let problems = Acquire::check(&Settings::default(), &stage::Context { drive: text, ..context(folder.path()) });
    assert!(
        problems[0].text.contains("notes.txt: is not a drive: a drive is a folder with drive.toml"),
        "{problems:?}"
    );
}
