//! Cameras, GNSS receiver and IMU of a live vehicle: the recording, the published messages, and that both agree.

use crate::live::{Sensor, TIMEOUT, live, settings, simulated};
use crate::live_two_lidars::Sender;
use crate::secondary_lidars::{N_REAR_PACKETS, rear_entry, rear_packets};
use crate::support::{BEGIN, SIZE, fix, sample, write_drive};
use acquire::{Acquire, Settings};
use drive::imu::csv_from_samples;
use drive::manifest::LidarEntry;
use drive::{Drive, read_manifest};
use lidar::nmea::{gga_from_fix, rmc_from_fix};
use lidar::velodyne::{PulseStatus, encode_position_packet};
use messages::{GnssTopic, ImageTopic, ImuTopic, MosaicTopic, SweepTopic, pod};
use stage::testing::{Bench, context};
use stage::{Context, Flow, Stage};
use std::fs;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Rows of all topics except the sweeps of the first LiDAR: stamp, camera or 0, and bytes.
#[derive(Debug, Default, PartialEq)]
struct Published {
    n_sweeps: usize,
    /// Sweeps of the secondary LiDAR.
    rear: Vec<(i64, Vec<u8>)>,
    images: Vec<(i64, u32, Vec<u8>)>,
    mosaics: Vec<(i64, u32, Vec<u8>)>,
    fixes: Vec<u8>,
    samples: Vec<u8>,
}

impl Published {
    fn take(&mut self, bench: &mut Bench<Acquire>) {
        for sweep in bench.take::<SweepTopic>() {
            if sweep.header().lidar == 0 {
                self.n_sweeps += 1;
            } else {
                self.rear.push((sweep.stamp(), pod::bytes_from_rows(sweep.rows()).to_vec()));
            }
        }
        for image in bench.take::<ImageTopic>() {
            self.images.push((image.stamp(), image.header().camera, image.rows().to_vec()));
        }
        for mosaic in bench.take::<MosaicTopic>() {
            let bytes = pod::bytes_from_rows(mosaic.rows()).to_vec();
            self.mosaics.push((mosaic.stamp(), mosaic.header().camera, bytes));
        }
        for fixes in bench.take::<GnssTopic>() {
            self.fixes.extend(pod::bytes_from_rows(fixes.rows()));
        }
        for samples in bench.take::<ImuTopic>() {
            self.samples.extend(pod::bytes_from_rows(samples.rows()));
        }
    }
}

/// A vehicle whose sensors all use the clock of its receiver: its rig, its grabber's folder and its ports.
struct Vehicle {
    folder: tempfile::TempDir,
    settings: Settings,
}

impl Vehicle {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        write_drive(&folder.path().join("vehicle"));
        fs::create_dir(folder.path().join("grabber")).expect("makes");
        let port = || UdpSocket::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("binds").port();
        let settings = Settings {
            cameras: "grabber".into(),
            gnss: format!("udp://127.0.0.1:{}", port()),
            imu: format!("udp://127.0.0.1:{}", port()),
            trigger_hz: 0.0,
            max_late_s: 60.0,
            ..settings()
        };
        Self { folder, settings }
    }

    /// Adds a second LiDAR, which sends to its own port.
    fn with_rear(self) -> Self {
        let path = self.path("vehicle/drive.toml");
        let mut manifest = read_manifest(&path).expect("reads");
        manifest.lidar.name = Some("front".into());
        manifest.other_lidars = vec![LidarEntry { name: Some("rear".into()), ..rear_entry("lidar_rear") }];
        fs::write(&path, toml::to_string(&manifest).expect("encodes")).expect("writes");
        let socket = UdpSocket::bind("127.0.0.1:0").expect("binds");
        let listen = format!("{},{}", self.settings.listen, socket.local_addr().expect("is bound"));
        Self { settings: Settings { listen, ..self.settings.clone() }, ..self }
    }

    /// Adds cameras whose stamps are late by 20 ms and early by 30 ms, and a mosaic camera whose stamps are late by 40
    /// ms.
    fn with_delays(self) -> Self {
        let path = self.path("vehicle/drive.toml");
        let mut manifest = read_manifest(&path).expect("reads");
        manifest.cameras[0].delay_nanos = 20_000_000;
        manifest.cameras[1].delay_nanos = -30_000_000;
        manifest.mosaics[0].delay_nanos = 40_000_000;
        fs::write(&path, toml::to_string(&manifest).expect("encodes")).expect("writes");
        self
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn context(&self) -> Context {
        Context {
            drive: self.path("vehicle/drive.toml"),
            launch_folder: self.folder.path().to_owned(),
            ..live(self.folder.path())
        }
    }

    /// Sends the packets of the LiDAR, with a tick after every 64. Returns the published data.
    fn send_packets(&self, packets: &[Vec<u8>], bench: &mut Bench<Acquire>) -> Published {
        let mut sensor = Sensor::new(&self.settings, self.path("recording/lidar/000.pcap"));
        let mut published = Published::default();
        for piece in packets.chunks(64) {
            sensor.send(piece);
            assert_eq!(bench.tick().expect("steps"), Flow::Continue);
            published.take(bench);
        }
        published
    }

    fn bench(&self) -> Bench<Acquire> {
        assert_eq!(Acquire::check(&self.settings, &self.context()), []);
        Bench::new(&self.settings, &self.context()).expect("opens")
    }

    /// The bench of a restarted process: started without a check, and later than the images were written.
    fn bench_of_restart(&self) -> Bench<Acquire> {
        Bench::new(&self.settings, &self.context()).expect("opens")
    }

    /// Writes all images of the drive whose stamp `wanted` selects, as the grabber.
    fn write_images(&self, wanted: impl Fn(i64) -> bool) -> Vec<PathBuf> {
        let mut recorded = Vec::new();
        for camera in ["camera/0", "camera/1", "hs03"] {
            for entry in fs::read_dir(self.path("vehicle").join(camera)).expect("lists").flatten() {
                let path = entry.path();
                let stamp: i64 = path.file_stem().and_then(|stem| stem.to_str()?.parse().ok()).expect("a stamp");
                if !wanted(stamp) {
                    continue;
                }
                let name = format!("{camera}/{}", path.file_name().and_then(|name| name.to_str()).expect("text"));
                let target = self.path("grabber").join(&name);
                let partial = target.with_extension("partial");
                fs::copy(&path, &partial).and_then(|_| fs::rename(&partial, &target)).expect("writes");
                recorded.push(self.path("recording").join(name));
            }
        }
        recorded
    }

    /// Sentences and samples of the drive, and damaged lines.
    fn send_logs(&self) {
        let mut sentences: Vec<String> =
            (0..5).map(fix).flat_map(|fix| [gga_from_fix(&fix, 44.6), rmc_from_fix(&fix)]).collect();
        sentences.insert(3, "$GPGGA,damaged*00".into());
        send_lines(&self.settings.gnss, &sentences);
        let samples: Vec<_> = (-50..450).map(sample).collect();
        let mut lines: Vec<String> = csv_from_samples(&samples).lines().map(str::to_owned).collect();
        lines.insert(100, "1,2,three".into());
        send_lines(&self.settings.imu, &lines);
    }
}

fn send_lines(address: &str, lines: &[String]) {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("binds");
    let target = address.strip_prefix("udp://").expect("is UDP");
    for chunk in lines.chunks(8) {
        socket.send_to(format!("{}\r\n", chunk.join("\r\n")).as_bytes(), target).expect("sends");
    }
}

fn wait_for(what: &str, mut is_there: impl FnMut() -> bool) {
    let deadline = Instant::now() + TIMEOUT;
    while !is_there() {
        assert!(Instant::now() < deadline, "{what} does not come");
        std::thread::yield_now();
    }
}

/// The published data of a run on the recording.
fn offline(recording: &Path) -> (Published, Bench<Acquire>) {
    let settings = Settings { trigger_hz: 0.0, ..Settings::default() };
    assert_eq!(Acquire::check(&settings, &context(recording)), []);
    let mut bench = Bench::new(&settings, &context(recording)).expect("opens");
    let mut published = Published::default();
    while bench.tick().expect("steps") == Flow::Continue {
        published.take(&mut bench);
    }
    bench.finish().expect("finishes");
    (published, bench)
}

#[test]
fn live_messages_of_all_sensors_equal_those_of_the_recording() {
    let vehicle = Vehicle::new();
    let packets = simulated(&vehicle.path("vehicle"));
    let mut bench = vehicle.bench();
    for path in vehicle.write_images(|_| true) {
        wait_for("the image", || path.exists());
    }
    vehicle.send_logs();
    let n_lines =
        |name: &str| fs::read_to_string(vehicle.path("recording").join(name)).map_or(0, |text| text.lines().count());
    wait_for("the last line", || n_lines("imu.csv") == 502 && n_lines("gnss.nmea") == 11);
    let mut published = vehicle.send_packets(&packets, &mut bench);
    wait_for("the last sweep", || {
        bench.tick().expect("steps");
        published.take(&mut bench);
        published.images.len() >= 8 && published.mosaics.len() >= 4 && bench.counter("data_packets") >= 7600
    });
    bench.finish().expect("finishes");
    published.take(&mut bench);
    let (expected, of_recording) = offline(&vehicle.path("recording"));
    assert_eq!((expected.images.len(), expected.mosaics.len(), expected.n_sweeps), (8, 4, 42));
    assert_eq!(expected.images[0].2.len(), SIZE[0] as usize * SIZE[1] as usize * 3);
    assert!(!expected.fixes.is_empty() && !expected.samples.is_empty());
    assert!(published == expected, "live: {published:?}\noffline: {expected:?}");
    for (name, n) in [("bad_imu_lines", 1), ("bad_nmea_lines", 1)] {
        assert_eq!((bench.counter(name), of_recording.counter(name)), (n, n), "{name}");
    }
    assert_eq!(bench.counter("images_recorded"), 12);
    for name in ["frames_late", "frames_before_sweeps", "frames_after_sweeps", "images_unreadable", "bad_images"] {
        assert_eq!(bench.counter(name), 0, "{name}");
    }
    for name in ["silent_sensors", "late_exposures", "exposures_outside", "pps_not_locked"] {
        assert_eq!(bench.doubt(name), None, "{name}");
    }
    // The whole drive was sent in an instant, so its clocks have no meaning; each sensor has a line nevertheless.
    let clocks = fs::read_to_string(vehicle.path("recording/clocks.csv")).expect("is there");
    for sensor in ["camera camera 0", "camera camera 1", "mosaic hs03", "gnss", "imu", "lidar"] {
        assert!(clocks.lines().any(|line| line.starts_with(&format!("{sensor},"))), "{clocks}");
    }
}

#[test]
fn delays_of_cameras_are_subtracted_from_live_stamps_as_from_recorded_ones() {
    let vehicle = Vehicle::new().with_delays();
    let packets = simulated(&vehicle.path("vehicle"));
    let mut bench = vehicle.bench();
    for path in vehicle.write_images(|_| true) {
        wait_for("the image", || path.exists());
    }
    let mut published = vehicle.send_packets(&packets, &mut bench);
    wait_for("the last images", || {
        bench.tick().expect("steps");
        published.take(&mut bench);
        published.images.len() >= 8 && published.mosaics.len() >= 4
    });
    bench.finish().expect("finishes");
    published.take(&mut bench);
    let (expected, _) = offline(&vehicle.path("recording"));
    for published in [&published, &expected] {
        let of = |camera: u32| published.images.iter().filter(move |image| image.1 == camera).map(|image| image.0);
        let named =
            |late_ms: i64| (0..4).map(move |second| BEGIN.0 + second * 1_000_000_000 + (250 - late_ms) * 1_000_000);
        assert!(of(0).eq(named(20)) && of(1).eq(named(-30)), "{published:?}");
        assert!(published.mosaics.iter().map(|mosaic| mosaic.0).eq(named(40)), "{published:?}");
    }
}

#[test]
fn second_lidar_is_published_beside_cameras_and_logs_as_from_the_recording() {
    let vehicle = Vehicle::new().with_rear();
    let packets = simulated(&vehicle.path("vehicle"));
    // The date comes from a receiver, as for the first LiDAR.
    let mut of_rear = vec![encode_position_packet(BEGIN, PulseStatus::Locked, &rmc_from_fix(&fix(0))).to_vec()];
    of_rear.extend(rear_packets(|_| true).into_iter().map(|(_, payload)| payload));
    let mut bench = vehicle.bench();
    for path in vehicle.write_images(|_| true) {
        wait_for("the image", || path.exists());
    }
    vehicle.send_logs();
    let mut sensor = Sensor::new(&vehicle.settings, vehicle.path("recording/lidar/000.pcap"));
    let address = vehicle.settings.listen.split(',').nth(1).expect("an address");
    let mut rear = Sender::new(address, vehicle.path("recording/lidar_rear/000.pcap"));
    // It is detected before the first LiDAR, and its packets of a sweep arrive before the end of the sweep.
    let (begin, of_rear) = of_rear.split_at(120);
    rear.send(begin);
    let mut of_rear = of_rear.chunks(27);
    let mut published = Published::default();
    for piece in packets.chunks(64) {
        sensor.send(piece);
        of_rear.next().into_iter().for_each(|burst| rear.send(burst));
        assert_eq!(bench.tick().expect("steps"), Flow::Continue);
        published.take(&mut bench);
    }
    wait_for("the last sweep", || {
        bench.tick().expect("steps");
        published.take(&mut bench);
        published.images.len() >= 8 && published.mosaics.len() >= 4 && bench.counter("data_packets") >= 7600
    });
    bench.finish().expect("finishes");
    published.take(&mut bench);
    assert_eq!(bench.counter("lidar_rear_udp_packets"), 1 + N_REAR_PACKETS as u64);
    for name in ["silent_sensors", "pps_not_locked", "pps_not_locked_rear"] {
        assert_eq!(bench.doubt(name), None, "{name}");
    }
    let clocks = fs::read_to_string(vehicle.path("recording/clocks.csv")).expect("is there");
    for sensor in ["lidar", "lidar rear", "imu", "camera camera 0"] {
        assert!(clocks.lines().any(|line| line.starts_with(&format!("{sensor},"))), "{clocks}");
    }
    let drive = Drive::open(&vehicle.path("recording")).expect("is a drive");
    let manifest = drive.manifest();
    assert_eq!((drive.lidars().count(), manifest.cameras.len(), manifest.mosaics.len()), (2, 2, 1));
    let (mut expected, _) = offline(&vehicle.path("recording"));
    assert_eq!((expected.n_sweeps, expected.rear.len()), (42, 39));
    // The last packets of a LiDAR that ends before the first one wait for further packets, until the recording ends.
    let [of_live, of_recording] =
        [&mut published, &mut expected].map(|found| std::mem::take(&mut found.rear).into_iter().take(37));
    assert!(of_live.eq(of_recording), "sweeps of the second LiDAR differ");
    assert!(published == expected, "live: {published:?}\noffline: {expected:?}");
}

#[test]
fn restarted_process_records_images_that_came_while_it_was_down() {
    let vehicle = Vehicle::new();
    let first = BEGIN.0 + 250_000_000;
    let bench = vehicle.bench();
    for path in vehicle.write_images(|stamp| stamp == first) {
        wait_for("the image", || path.exists());
    }
    // The crash: no finish.
    drop(bench);
    let rest = vehicle.write_images(|stamp| stamp > first);
    assert_eq!(rest.len(), 9);
    assert!(rest.iter().all(|path| !path.exists()));
    let bench = vehicle.bench_of_restart();
    for path in &rest {
        wait_for("the image", || path.exists());
        let source = vehicle.path("grabber").join(path.strip_prefix(vehicle.path("recording")).expect("is inside"));
        assert_eq!(fs::read(path).expect("reads"), fs::read(source).expect("reads"));
    }
    drop(bench);
}

#[test]
fn images_that_come_late_and_silent_sensors_are_doubts() {
    let vehicle = Vehicle::new();
    let vehicle = Vehicle { settings: Settings { max_late_s: 0.5, ..vehicle.settings.clone() }, ..vehicle };
    let packets = simulated(&vehicle.path("vehicle"));
    let mut bench = vehicle.bench();
    let mut sensor = Sensor::new(&vehicle.settings, vehicle.path("recording/lidar/000.pcap"));
    for piece in packets.chunks(64) {
        sensor.send(piece);
        bench.tick().expect("steps");
    }
    wait_for("the last sweep", || {
        bench.tick().expect("steps");
        bench.counter("data_packets") >= 7600
    });
    // 3.5 s after their stamps by the clock of the LiDAR.
    for path in vehicle.write_images(|stamp| stamp == BEGIN.0 + 250_000_000) {
        wait_for("the image", || path.exists());
    }
    wait_for("the images", || {
        bench.tick().expect("steps");
        bench.counter("frames_late") == 3
    });
    bench.finish().expect("finishes");
    assert!(bench.take::<ImageTopic>().is_empty());
    // All images, and two sensors.
    assert_eq!((bench.doubt("late_exposures"), bench.doubt("silent_sensors")), (Some(1.0), Some(2.0)));
}

#[test]
fn check_names_sources_that_cannot_be_read() {
    let vehicle = Vehicle::new();
    let problems = |settings: Settings, context: &Context| -> Vec<String> {
        let found = Acquire::check(&settings, context);
        found.into_iter().map(|problem| format!("{}: {}", problem.key, problem.text)).collect()
    };
    let wrong = Settings {
        cameras: "nowhere".into(),
        gnss: "udp://localhost:1".into(),
        imu: "serial:///dev/absent".into(),
        ..vehicle.settings.clone()
    };
    let found = problems(wrong.clone(), &vehicle.context());
    assert!(
        found.iter().any(|text| text.starts_with("cameras: ") && text.ends_with("nowhere is not a folder")),
        "{found:?}"
    );
    assert!(found.iter().any(|text| text.starts_with("gnss: value \"udp://localhost:1\" must be udp://")), "{found:?}");
    let absent = Settings { cameras: String::new(), gnss: String::new(), ..wrong.clone() };
    let found = problems(absent, &vehicle.context());
    assert!(
        found.iter().any(|text| text.starts_with("imu: serial:///dev/absent?baud=115200 cannot be opened")),
        "{found:?}"
    );
    // Without a rig the mounting of the sensors is unknown.
    let found = problems(vehicle.settings.clone(), &live(vehicle.folder.path()));
    for start in ["cameras: is set, but", "gnss: is set, but", "imu: is set, but"] {
        assert!(found.iter().any(|text| text.starts_with(start)), "{found:?}");
    }
}
