//! A live vehicle with all sensors: clouds with colors, spectra and fixes while its data arrives, and a recording that
//! is a complete drive.

use drive::Drive;
use formats::ply::Vertices;
use replica_tests::{ANY_DEVIATION, ANY_FIXES, Launch, PATIENT, binary, drive, output_text, result_files, wait_for};
use rustix::process::{Signal, kill_process};
use std::collections::BTreeMap;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// All stages, with submaps so long that a busy machine has time for their columns: live, a full queue drops the oldest
/// message. Delayed images and lines are counted and not a fault of the run.
fn launch(run: &str, acquire: &str) -> Launch {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/ground.safetensors");
    Launch::new(&format!(
        "[run]\noutput = 'out'\nbarrier_s = 0.5\nrestart_delay_s = 0.0\n{PATIENT}\n{run}\n[acquire]\ntrigger_hz = 0.0\n{acquire}\n\
         [calibrate]\n[slam_aggregate]\n{ANY_FIXES}\n[colorize]\n[infer]\nmodel = '{}'\n[instance]\n\
         things = [{{ class = 'vehicles', max_height_m = 4.0, min_points = 200 }}]\n[export]\n{ANY_DEVIATION}\n",
        model.display()
    ))
}

/// The ports of a live run; the folder of its grabber is `grabber` next to launch.toml.
struct Ports {
    data: u16,
    position: u16,
    nmea: u16,
    imu: u16,
}

impl Ports {
    /// Ports that are free just now.
    fn free() -> Self {
        let sockets = [(); 4].map(|()| UdpSocket::bind("127.0.0.1:0").expect("a port"));
        let [data, position, nmea, imu] = sockets.map(|socket| socket.local_addr().expect("an address").port());
        Self { data, position, nmea, imu }
    }

    /// Keys of `[acquire]`.
    fn keys(&self) -> String {
        let Self { data, position, nmea, imu } = self;
        format!(
            "listen = '127.0.0.1:{data}'\nposition_listen = '127.0.0.1:{position}'\ncameras = 'grabber'\n\
             gnss = 'udp://127.0.0.1:{nmea}'\nimu = 'udp://127.0.0.1:{imu}'\nmax_late_s = 60.0\nmax_clock_offset_ms = 5000.0\n\
             max_undecoded_s = 0.0\nmax_behind = 1000"
        )
    }

    fn send(&self, drive: &Path, grabber: &Path) -> Child {
        let address = |port: u16| format!("127.0.0.1:{port}");
        Command::new(binary("replica"))
            .arg("send")
            .arg(drive)
            .args(["--to", &address(self.data), "--position-port", &self.position.to_string()])
            .args(["--nmea", &address(self.nmea), "--imu", &address(self.imu), "--restamp", "--images"])
            .arg(grabber)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("replica starts")
    }
}

fn run_of(drive: &Path) -> String {
    format!("mode = 'live'\nrig = '{}'", drive.join("drive.toml").display())
}

/// Contents of all files of a camera's folder, by the stamp in the name.
fn images(folder: &Path) -> BTreeMap<i64, Vec<u8>> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let files = entries.filter(|entry| entry.path().is_file());
    files
        .filter_map(|entry| {
            let stamp = entry.path().file_stem()?.to_str()?.parse().ok()?;
            Some((stamp, std::fs::read(entry.path()).expect("readable")))
        })
        .collect()
}

/// Folders of all cameras of a drive.
fn camera_folders(drive: &Drive) -> Vec<String> {
    let manifest = drive.manifest();
    let cameras = manifest.cameras.iter().map(|entry| entry.folder.clone());
    cameras.chain(manifest.mosaics.iter().map(|entry| entry.folder.clone())).collect()
}

/// Sends the drive to a live run. `None` if the kernel dropped packets, which is counted and not a fault of the run.
fn live(drive: &Path) -> Option<Launch> {
    let ports = Ports::free();
    let launch = launch(&run_of(drive), &ports.keys());
    let grabber = launch.folder().join("grabber");
    std::fs::create_dir(&grabber).expect("makes");
    let running = launch.start();
    wait_for("the recording", || launch.output().join("recording/lidar/000.pcap").is_file().then_some(()));
    let mut sender = ports.send(drive, &grabber);
    assert!(sender.wait().expect("waits").success());
    // On a busy machine the stages may be behind; all images must be published.
    let n_images: usize = camera_folders(&Drive::open(drive).expect("a drive"))
        .iter()
        .map(|folder| images(&drive.join(folder)).len())
        .sum();
    wait_for("the images", || {
        let recorded = camera_folders(&Drive::open(drive).expect("a drive"));
        let n: usize =
            recorded.iter().map(|folder| images(&launch.output().join("recording").join(folder)).len()).sum();
        (n >= n_images).then_some(())
    });
    running.signal(Signal::INT);
    let code = running.wait();
    assert!([Some(0), Some(3)].contains(&code), "{code:?}: {}", launch.stderr());
    let counters = &launch.stage_summary("acquire")["counters"];
    counters["udp_packets_dropped"].as_u64().unwrap_or_default().eq(&0).then_some(launch)
}

/// Names of the doubts of a stage.
fn doubts(launch: &Launch, stage: &str) -> Vec<String> {
    let summary = launch.stage_summary(stage);
    let doubts = summary["doubts"].as_array().cloned().unwrap_or_default();
    doubts.iter().filter_map(|doubt| doubt["name"].as_str().map(str::to_owned)).collect()
}

/// Numbers of points with a color, with a spectrum, and of all points.
fn points(output: &Path) -> [usize; 3] {
    let mut found = [0; 3];
    let files = result_files(output);
    for name in files.keys().filter(|name| name.starts_with("submap_")) {
        let cloud = Vertices::load(&output.join("clouds").join(name)).expect("a PLY file");
        if name.contains("spectra") {
            found[1] += cloud.len();
        } else {
            // A cloud whose colors were dropped has no such column.
            let cameras = cloud.f64s("camera").unwrap_or_default();
            found[0] += cameras.iter().filter(|camera| **camera != 255.0).count();
            found[2] += cloud.len();
        }
    }
    found
}

#[test]
fn live_vehicle_gives_colored_clouds_and_its_recording_is_the_drive() {
    let drive = drive();
    let launch = (0..5).find_map(|_| live(&drive)).expect("the kernel dropped packets each time");
    let [n_colored, n_spectra, n_points] = points(&launch.output());
    assert!(n_points > 100_000, "{n_points} points: {}", launch.stderr());
    assert!(n_colored * 4 > n_points, "{n_colored} of {n_points} points have a color: {}", launch.stderr());
    assert!(n_spectra > 0, "no point has a spectrum: {}", launch.stderr());
    assert!(launch.stage_summary("slam_aggregate")["counters"]["fixes"].as_u64() >= Some(3), "{}", launch.stderr());
    let found = doubts(&launch, "acquire");
    for name in
        ["silent_sensors", "late_exposures", "exposures_outside", "bad_images", "clock_offset", "pps_not_locked"]
    {
        assert!(!found.iter().any(|doubt| doubt == name), "{found:?}: {}", launch.stderr());
    }
    assert_recording_is(&drive, &launch.output().join("recording"));
    // The recording is complete by itself.
    let again = self::launch(&format!("drive = '{}'", launch.output().join("recording").display()), "");
    let output = again.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    let [of_colored, of_spectra, of_points] = points(&again.output());
    assert!(of_colored * 2 > of_points && of_spectra > 0, "{of_colored} and {of_spectra} of {of_points}");
    let direct = self::launch(&format!("drive = '{}'", drive.display()), "");
    let output = direct.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
    let counters = |launch: &Launch| launch.stage_summary("acquire")["counters"].clone();
    for name in [
        "data_packets",
        "position_packets",
        "lost_packets",
        "frames_before_sweeps",
        "frames_after_sweeps",
        "bad_imu_lines",
    ] {
        assert_eq!(counters(&again)[name], counters(&direct)[name], "{name}");
    }
}

/// Asserts that the recording has all images of the drive, byte by byte, with stamps shifted by one time, its
/// references, and its lines.
fn assert_recording_is(drive: &Path, recording: &Path) {
    let expected = Drive::open(drive).expect("a drive");
    let got = Drive::open(recording).expect("a drive");
    let stamps = |drive: &Drive| [drive.camera_frames()[0].stamp.0, drive.mosaic_frames()[0].stamp.0];
    let shifts: Vec<i64> = stamps(&got).iter().zip(stamps(&expected)).map(|(got, expected)| got - expected).collect();
    assert_eq!(shifts[0], shifts[1], "one clock");
    for folder in camera_folders(&expected) {
        let moved = images(&drive.join(&folder)).into_iter().map(|(stamp, bytes)| (stamp + shifts[0], bytes));
        assert!(moved.collect::<BTreeMap<_, _>>() == images(&recording.join(&folder)), "images of {folder} differ");
        for kind in ["dark", "white"] {
            let [references, copies] = [drive, recording].map(|root| images(&root.join(&folder).join(kind)));
            assert!(references == copies, "{kind} frames of {folder} differ");
        }
    }
    let fixes = |drive: &Drive| drive.fixes().expect("reads");
    let (of_drive, stats) = fixes(&expected);
    let (of_recording, got_stats) = fixes(&got);
    assert_eq!(stats, got_stats);
    let moved: Vec<_> =
        of_drive.into_iter().map(|fix| lidar::nmea::Fix { stamp: fix.stamp.plus_nanos(shifts[0]), ..fix }).collect();
    assert_eq!(moved, of_recording);
    let samples = |drive: &Drive| -> Vec<_> {
        drive.imu().expect("reads").expect("has an IMU").map(|sample| sample.expect("is sound")).collect()
    };
    let moved: Vec<_> = samples(&expected)
        .into_iter()
        .map(|sample| drive::imu::ImuSample { stamp: sample.stamp.plus_nanos(shifts[0]), ..sample })
        .collect();
    assert!(moved == samples(&got), "samples differ");
}

/// Files of the grabber and of the recording, by camera.
fn recorded(launch: &Launch, folders: &[String]) -> [BTreeMap<(String, i64), Vec<u8>>; 2] {
    let of = |root: PathBuf| {
        let all = folders.iter().flat_map(|folder| {
            images(&root.join(folder)).into_iter().map(move |(stamp, bytes)| ((folder.clone(), stamp), bytes))
        });
        all.collect()
    };
    [of(launch.folder().join("grabber")), of(launch.output().join("recording"))]
}

#[test]
fn killed_acquire_loses_no_complete_image() {
    let drive = drive();
    let ports = Ports::free();
    let launch = Launch::new(&format!(
        "[run]\noutput = 'out'\nrestart_delay_s = 0.0\nrestarts = 9\n{PATIENT}\n{}\n[acquire]\n{}\n",
        run_of(&drive),
        ports.keys()
    ));
    let grabber = launch.folder().join("grabber");
    std::fs::create_dir(&grabber).expect("makes");
    let running = launch.start();
    wait_for("the recording", || launch.output().join("recording/lidar/000.pcap").is_file().then_some(()));
    let folders = camera_folders(&Drive::open(&drive).expect("a drive"));
    let n_images: usize = folders.iter().map(|folder| images(&drive.join(folder)).len()).sum();
    let mut sender = ports.send(&drive, &grabber);
    for number in 1..=2 {
        let n_before = recorded(&launch, &folders)[1].len();
        wait_for("further images", || (recorded(&launch, &folders)[1].len() > n_before).then_some(()));
        kill_process(running.stage("acquire"), Signal::KILL).expect("the stage lives");
        let capture = format!("recording/lidar/{number:03}.pcap");
        wait_for("the next capture", || launch.output().join(&capture).is_file().then_some(()));
    }
    assert!(sender.wait().expect("waits").success());
    wait_for("all images", || (recorded(&launch, &folders)[1].len() >= n_images).then_some(()));
    running.signal(Signal::INT);
    assert_eq!(running.wait(), Some(3), "{}", launch.stderr());
    let [written, kept] = recorded(&launch, &folders);
    assert_eq!(written.len(), n_images);
    assert!(written == kept, "the recording differs from what the grabber wrote");
    // The captures and logs of the killed processes can be read.
    let recording = Drive::open(&launch.output().join("recording")).expect("a drive");
    assert_eq!(recording.sweep_files().len(), 3);
    assert!(recording.fixes().expect("reads").1.sentences > 0);
    assert!(recording.imu().expect("reads").expect("has an IMU").flatten().count() > 100);
}
