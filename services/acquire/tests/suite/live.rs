//! A simulated sensor on the loopback network: the recording, the published sweeps, and that both agree.

use crate::support::{BEGIN, fix, write_lidar};
use acquire::{Acquire, Settings};
use drive::manifest::PoseEntry;
use lidar::nmea::{gga_from_fix, rmc_from_fix};
use lidar::pcap::PacketReader;
use lidar::velodyne::{DATA_PACKET_BYTES, POSITION_PACKET_BYTES, PulseStatus, encode_position_packet};
use messages::{GnssTopic, SweepTopic, pod};
use stage::testing::{Bench, context};
use stage::{Context, Flow, Mode, Received, Stage};
use std::fs;
use std::net::{SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Payloads in the order in which they are sent.
pub(crate) type Packets = Vec<Vec<u8>>;

/// Sweep and fixes of a tick, as bytes.
type Tick = Vec<Vec<u8>>;

/// Timeout: far longer than any wait on a busy machine.
pub(crate) const TIMEOUT: Duration = Duration::from_mins(3);

/// More revolutions than any test sends.
const UNLIMITED_BACKLOG: u32 = 10_000;

/// Settings with two free ports. The kernel does not assign the same ports again soon.
pub(crate) fn settings() -> Settings {
    let sockets = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").expect("binds"));
    let [listen, position_listen] = sockets.map(|socket| socket.local_addr().expect("is bound").to_string());
    // A busy machine may need any time for the first sweep.
    Settings { listen, position_listen, max_behind: UNLIMITED_BACKLOG, max_undecoded_s: 0.0, ..Settings::default() }
}

pub(crate) fn live(folder: &Path) -> Context {
    Context { mode: Mode::Live, drive: folder.join("nothing"), ..context(folder) }
}

/// Complete packets of a capture.
fn packets_of(path: &Path) -> Packets {
    let mut reader = PacketReader::open(path).expect("opens");
    let mut packets = Vec::new();
    while let Some(packet) = reader.next().expect("reads") {
        packets.push(packet.payload.to_vec());
    }
    packets
}

/// Four seconds of a sensor with a GNSS receiver: alternating sentences, each sent three times.
pub(crate) fn simulated(folder: &Path) -> Packets {
    write_lidar(folder, |_| true);
    let mut packets = Vec::new();
    for (number, packet) in packets_of(&folder.join("lidar/0.pcap")).into_iter().enumerate() {
        let nanos = number as i64 * 552_960;
        if number % 300 == 100 {
            let fix = fix(nanos / 1_000_000_000);
            let sentence = if number % 600 == 100 { rmc_from_fix(&fix) } else { gga_from_fix(&fix, 44.6) };
            let position = encode_position_packet(BEGIN.plus_nanos(nanos), PulseStatus::Locked, &sentence).to_vec();
            packets.extend([position.clone(), position.clone(), position]);
        }
        packets.push(packet);
    }
    packets
}

/// The sender. It waits until each burst has arrived in the file, so that no packet is lost.
pub(crate) struct Sensor {
    socket: UdpSocket,
    data: SocketAddr,
    position: SocketAddr,
    capture: PathBuf,
    /// Size of the capture with all packets sent so far.
    pub(crate) n_bytes: u64,
}

impl Sensor {
    pub(crate) fn new(settings: &Settings, capture: PathBuf) -> Self {
        let address = |text: &str| text.parse().expect("an address");
        let first = settings.listen.split(',').next().expect("an address");
        let data = address(first);
        let position = address(&settings.position_listen);
        Self { socket: UdpSocket::bind("127.0.0.1:0").expect("binds"), data, position, capture, n_bytes: 24 }
    }

    /// Continues the sensor, whose packets go to the next capture.
    fn continued(self, capture: PathBuf) -> Self {
        Self { capture, n_bytes: 24, ..self }
    }

    /// A sender on another port. Its packets go to the same capture.
    pub(crate) fn on_another_port(&self) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("binds");
        Self { socket, capture: self.capture.clone(), ..*self }
    }

    pub(crate) fn send(&mut self, packets: &[Vec<u8>]) {
        for burst in packets.chunks(32) {
            for packet in burst {
                // Packets to different sockets have no order, so position packets are sent alone.
                let to_position = packet.len() == POSITION_PACKET_BYTES;
                if to_position {
                    self.wait();
                }
                let target = if to_position { self.position } else { self.data };
                self.socket.send_to(packet, target).expect("sends");
                self.n_bytes += 16 + 42 + packet.len() as u64;
                if to_position {
                    self.wait();
                }
            }
            self.wait();
        }
    }

    /// Waits until all packets are in the file.
    fn wait(&self) {
        let deadline = Instant::now() + TIMEOUT;
        while fs::metadata(&self.capture).map_or(0, |metadata| metadata.len()) < self.n_bytes {
            assert!(Instant::now() < deadline, "{} does not reach {} bytes", self.capture.display(), self.n_bytes);
            std::thread::yield_now();
        }
    }
}

fn take_sweeps(bench: &mut Bench<Acquire>) -> Vec<Vec<u8>> {
    let bytes = |sweep: Received<SweepTopic>| {
        let header = pod::bytes_from_rows(std::slice::from_ref(sweep.header())).to_vec();
        let rows = pod::bytes_from_rows(sweep.rows());
        [&sweep.stamp().to_le_bytes()[..], &header, rows].concat()
    };
    bench.take::<SweepTopic>().into_iter().map(bytes).collect()
}

fn take(bench: &mut Bench<Acquire>) -> Tick {
    let mut tick = take_sweeps(bench);
    for fixes in bench.take::<GnssTopic>() {
        tick.push([&fixes.stamp().to_le_bytes()[..], pod::bytes_from_rows(fixes.rows())].concat());
    }
    tick
}

/// Ticks until this number of packets is decoded. Empty ticks are left out.
pub(crate) fn ticks_to_decode(bench: &mut Bench<Acquire>, n_packets: usize) -> Vec<Tick> {
    let mut ticks = Vec::new();
    let deadline = Instant::now() + TIMEOUT;
    let kinds = ["data_packets", "position_packets", "foreign_packets", "short_packets"];
    let n_decoded = |bench: &Bench<Acquire>| kinds.iter().map(|kind| bench.counter(kind)).sum::<u64>();
    while n_decoded(bench) < n_packets as u64 {
        assert_eq!(bench.tick().expect("steps"), Flow::Continue);
        ticks.push(take(bench));
        assert!(Instant::now() < deadline, "{} of {n_packets} packets are decoded", n_decoded(bench));
    }
    ticks.retain(|tick| !tick.is_empty());
    ticks
}

/// Ticks until all packets are decoded, then drains as the runner does. Empty ticks are left out.
pub(crate) fn ticks_to_drain(bench: &mut Bench<Acquire>, n_packets: usize) -> Vec<Tick> {
    let mut ticks = ticks_to_decode(bench, n_packets);
    bench.finish().expect("finishes");
    ticks.push(take(bench));
    ticks.retain(|tick| !tick.is_empty());
    ticks
}

/// Ticks until the run ends. Empty ticks are left out.
fn ticks_to_end(bench: &mut Bench<Acquire>) -> Vec<Tick> {
    let mut ticks = Vec::new();
    let deadline = Instant::now() + TIMEOUT;
    while bench.tick().expect("steps") == Flow::Continue {
        ticks.push(take(bench));
        assert!(Instant::now() < deadline, "the run does not end");
    }
    ticks.retain(|tick| !tick.is_empty());
    ticks
}

/// The ticks of a run on the recording, and its bench with the counters.
pub(crate) fn offline(recording: &Path) -> (Vec<Tick>, Bench<Acquire>) {
    let settings = Settings { trigger_hz: 0.0, ..Settings::default() };
    assert_eq!(Acquire::check(&settings, &context(recording)), []);
    let mut bench = Bench::new(&settings, &context(recording)).expect("opens");
    (ticks_to_end(&mut bench), bench)
}

/// Whether the sweeps are a subsequence of the ticks' sweeps.
fn is_subsequence(sweeps: &[Vec<u8>], ticks: &[Tick]) -> bool {
    let mut all = ticks.iter().map(|tick| &tick[0]);
    sweeps.iter().all(|sweep| all.any(|other| other == sweep))
}

/// Sends packets to a live run until it ends. Returns its ticks and its bench.
type Play = fn(&Packets, &Path) -> (Vec<Tick>, Bench<Acquire>);

/// Sends the packets in pieces with ticks between.
fn piece_by_piece(packets: &Packets, folder: &Path) -> (Vec<Tick>, Bench<Acquire>) {
    let settings = settings();
    assert_eq!(Acquire::check(&settings, &live(folder)), []);
    let mut bench = Bench::new(&settings, &live(folder)).expect("opens");
    let mut sensor = Sensor::new(&settings, folder.join("recording/lidar/000.pcap"));
    let mut ticks = Vec::new();
    for piece in packets.chunks(64) {
        sensor.send(piece);
        assert_eq!(bench.tick().expect("steps"), Flow::Continue, "packets come");
        ticks.push(take(&mut bench));
    }
    ticks.retain(|tick| !tick.is_empty());
    ticks.extend(ticks_to_drain(&mut bench, packets.len()));
    (ticks, bench)
}

/// Sends all packets before the first tick, so that a busy machine is not mistaken for a silent sensor.
fn up_to_silence(packets: &Packets, folder: &Path) -> (Vec<Tick>, Bench<Acquire>) {
    let settings = Settings { quiet_s: 0.3, ..settings() };
    let mut bench = Bench::new(&settings, &live(folder)).expect("opens");
    Sensor::new(&settings, folder.join("recording/lidar/000.pcap")).send(packets);
    (ticks_to_end(&mut bench), bench)
}

/// Asserts that live and offline ticks are equal and that the recording contains the sent packets.
fn assert_same(play: Play, packets: &Packets, folder: &Path) -> (Vec<Tick>, Bench<Acquire>) {
    let (ticks, bench) = play(packets, folder);
    assert!(&packets_of(&folder.join("recording/lidar/000.pcap")) == packets, "the recording is what was sent");
    let (reference, of_recording) = offline(&folder.join("recording"));
    assert_eq!(ticks.len(), reference.len());
    for (number, (tick, expected)) in ticks.iter().zip(&reference).enumerate() {
        assert!(tick == expected, "tick {number} differs");
    }
    for name in
        ["data_packets", "position_packets", "foreign_packets", "short_packets", "lost_packets", "partial_sweeps"]
    {
        assert_eq!(bench.counter(name), of_recording.counter(name), "{name}");
    }
    assert_eq!((bench.counter("udp_packets"), bench.counter("udp_packets_dropped")), (packets.len() as u64, 0));
    assert_eq!(bench.counter("sweeps_skipped"), 0);
    (ticks, bench)
}

#[test]
fn live_sweeps_and_fixes_equal_those_of_the_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = simulated(folder.path());
    let (ticks, bench) = assert_same(piece_by_piece, &packets, folder.path());
    // 42 complete revolutions, and a partial one at the end.
    assert_eq!((ticks.len(), bench.counter("partial_sweeps")), (42, 1));
    assert_eq!(ticks.iter().filter(|tick| tick.len() == 2).count(), 4, "ticks with fixes");
    assert_eq!(bench.counter("position_packets"), 3 * 25);
}

#[real_data::test("velodyne/hdl32e_outdoor.pcap", "velodyne/vlp16_moving_car.pcap", "velodyne/hdl64e.pcap")]
fn packets_of_real_sensors_are_recorded_and_decoded() {
    for (name, n_sweeps) in [("hdl32e_outdoor", 5), ("vlp16_moving_car", 5), ("hdl64e", 1)] {
        let capture = real_data::path(&format!("velodyne/{name}.pcap"));
        let folder = tempfile::tempdir().expect("a folder");
        // The captures also contain packets of other senders.
        let is_sensor = |packet: &Vec<u8>| [DATA_PACKET_BYTES, POSITION_PACKET_BYTES].contains(&packet.len());
        let packets: Packets = packets_of(&capture).into_iter().filter(is_sensor).collect();
        let (ticks, _) = assert_same(up_to_silence, &packets, folder.path());
        assert!((1..=n_sweeps).contains(&ticks.len()), "{name}: {}", ticks.len());
    }
}

#[test]
fn foreign_packets_are_recorded_and_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut packets = simulated(folder.path());
    let mut other_sensor = packets[500].clone();
    other_sensor[1205] = 0x22;
    packets.insert(501, other_sensor);
    packets.insert(502, vec![1; 100]);
    packets.insert(503, Vec::new());
    packets.insert(504, vec![1; 1400]);
    let (_, bench) = assert_same(piece_by_piece, &packets, folder.path());
    assert_eq!((bench.counter("foreign_packets"), bench.counter("short_packets")), (2, 2));
}

#[test]
fn step_without_packets_publishes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::<Acquire>::new(&settings(), &live(folder.path())).expect("opens");
    for _ in 0..5 {
        assert_eq!(bench.tick().expect("steps"), Flow::Continue);
        assert!(take(&mut bench).is_empty());
    }
}

#[test]
fn silence_ends_the_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets: Packets = simulated(folder.path()).into_iter().take(1000).collect();
    assert_same(up_to_silence, &packets, folder.path());
}

#[test]
fn in_flight_packets_are_published_at_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = settings();
    let packets = simulated(folder.path());
    let mut bench = Bench::<Acquire>::new(&settings, &live(folder.path())).expect("opens");
    let mut sensor = Sensor::new(&settings, folder.path().join("recording/lidar/000.pcap"));
    sensor.send(&packets[..4500]);
    let mut ticks = ticks_to_decode(&mut bench, 4500);
    sensor.send(&packets[4500..4800]);
    // Drains as the runner does.
    bench.finish().expect("finishes");
    ticks.push(take(&mut bench));
    ticks.retain(|tick| !tick.is_empty());
    let (reference, _) = offline(&folder.path().join("recording"));
    // The last tick has several sweeps before its fixes.
    let sorted = |ticks: Vec<Tick>| {
        let mut messages = ticks.concat();
        messages.sort();
        messages
    };
    assert!(sorted(ticks) == sorted(reference), "the messages differ");
}

#[test]
fn backlog_is_skipped_to_the_newest_revolution() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = Settings { max_behind: 3, ..settings() };
    let packets = simulated(folder.path());
    let mut bench = Bench::<Acquire>::new(&settings, &live(folder.path())).expect("opens");
    let mut sensor = Sensor::new(&settings, folder.path().join("recording/lidar/000.pcap"));
    let mut sweeps = Vec::new();
    // More than the first half arrives without a tick, enough to detect the sensor.
    sensor.send(&packets[..4500]);
    assert_eq!(bench.tick().expect("steps"), Flow::Continue);
    sweeps.extend(take_sweeps(&mut bench));
    let n_skipped = bench.counter("sweeps_skipped");
    assert!((20..=24).contains(&n_skipped), "{n_skipped} of 24");
    for piece in packets[4500..].chunks(90) {
        sensor.send(piece);
        assert_eq!(bench.tick().expect("steps"), Flow::Continue);
        sweeps.extend(take_sweeps(&mut bench));
    }
    bench.finish().expect("finishes");
    sweeps.extend(take_sweeps(&mut bench));
    assert_eq!(bench.counter("sweeps_skipped"), n_skipped, "no more skips afterwards");
    let (reference, _) = offline(&folder.path().join("recording"));
    assert_eq!(sweeps.len() as u64 + n_skipped, reference.len() as u64);
    assert!(is_subsequence(&sweeps, &reference));
}

#[test]
fn restarted_process_continues_in_the_next_capture() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = settings();
    let packets = simulated(folder.path());
    let recording = folder.path().join("recording");
    let mut ticks = Vec::new();
    let mut bench = Bench::<Acquire>::new(&settings, &live(folder.path())).expect("opens");
    let mut sensor = Sensor::new(&settings, recording.join("lidar/000.pcap"));
    for piece in packets[..4990].chunks(64) {
        sensor.send(piece);
        bench.tick().expect("steps");
        ticks.push(take(&mut bench));
    }
    ticks.extend(ticks_to_decode(&mut bench, 4990));
    // Fixes follow the sweep of their tick.
    let mut sweeps: Vec<Vec<u8>> = ticks.into_iter().filter_map(|tick| tick.into_iter().next()).collect();
    // The crash: no finish. Half a revolution is lost until the next process listens.
    let state = bench.stage.save().expect("saves").to_vec();
    drop(bench);
    let mut bench = Bench::<Acquire>::new(&settings, &live(folder.path())).expect("opens");
    bench.stage.load(&state).expect("loads");
    let mut sensor = sensor.continued(recording.join("lidar/001.pcap"));
    for piece in packets[5080..].chunks(64) {
        sensor.send(piece);
        bench.tick().expect("steps");
        sweeps.extend(take_sweeps(&mut bench));
    }
    bench.finish().expect("finishes");
    sweeps.extend(take_sweeps(&mut bench));
    // A crash of the machine may cut a capture within a packet: the packets before are used.
    let whole = fs::read(recording.join("lidar/000.pcap")).expect("reads");
    let (reference, of_recording) = offline(&recording);
    assert!(is_subsequence(&sweeps, &reference));
    assert_eq!(reference.len(), sweeps.len() + 1, "all but the interrupted sweep");
    assert_eq!(
        of_recording.counter("lost_packets"),
        90 - packets[4990..5080].iter().filter(|p| p.len() == 512).count() as u64
    );
    fs::write(recording.join("lidar/000.pcap"), &whole[..whole.len() - 100]).expect("writes");
    let (_, of_cut) = offline(&recording);
    assert_eq!(of_cut.counter("cut_captures"), 1);
    // A new run must use another folder.
    let problems = Acquire::check(&settings, &live(folder.path()));
    assert!(problems.iter().any(|problem| problem.key == "recording"), "{problems:?}");
}

#[test]
fn recording_has_the_mounting_of_the_rig() {
    let folder = tempfile::tempdir().expect("a folder");
    crate::support::write_drive(&folder.path().join("vehicle"));
    let rig = folder.path().join("vehicle/drive.toml");
    let text = fs::read_to_string(&rig).expect("reads").replacen(
        "translation = [0.0, 0.0, 0.0]",
        "translation = [0.0, 0.0, 1.9]",
        1,
    );
    fs::write(&rig, text).expect("writes");
    let context = Context { drive: rig, ..live(folder.path()) };
    let bench = Bench::<Acquire>::new(&settings(), &context).expect("opens");
    drop(bench);
    let manifest = drive::read_manifest(&folder.path().join("recording/drive.toml")).expect("reads");
    assert_eq!(
        (manifest.lidar.model.as_str(), manifest.lidar.body_from_lidar.translation),
        ("hdl32e", [0.0, 0.0, 1.9])
    );
}

#[test]
fn rig_of_a_simulated_drive_is_not_used_for_a_live_sensor() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets: Packets = simulated(folder.path()).into_iter().take(1000).collect();
    // A drive folder of `replica simulate`: its LiDAR is mounted 1.9 m up and tilted, and it has ground truth.
    let vehicle = folder.path().join("sample");
    fs::create_dir_all(&vehicle).expect("makes");
    let manifest = "version = 1\nname = \"sample\"\n[lidar]\nmodel = \"vlp16\"\nformat = \"pcap\"\nfolder = \"lidar\"\n\
                    body_from_lidar = { translation = [0, 0, 1.9], rotation = [0, 0.6, 0, 0.8] }\n\
                    [truth]\ntrajectory = \"t.txt\"\nlabels = \"labels\"\n";
    fs::write(vehicle.join("drive.toml"), manifest).expect("writes");
    for (drive, words) in [(vehicle, "sample is a simulated drive and is not used"), (PathBuf::new(), "none is given")]
    {
        let output = tempfile::tempdir().expect("a folder");
        let settings = Settings { quiet_s: 0.3, ..settings() };
        let context = Context { drive, ..live(output.path()) };
        assert_eq!(Acquire::check(&settings, &context), []);
        let mut bench = Bench::<Acquire>::new(&settings, &context).expect("opens");
        Sensor::new(&settings, output.path().join("recording/lidar/000.pcap")).send(&packets);
        assert!(!ticks_to_end(&mut bench).is_empty());
        assert!(
            bench.notes().iter().any(|note| note.contains(words) && note.contains("upright")),
            "{:?}",
            bench.notes()
        );
        let manifest = drive::read_manifest(&output.path().join("recording/drive.toml")).expect("reads");
        assert_eq!((manifest.lidar.model.as_str(), manifest.lidar.body_from_lidar), ("hdl32e", PoseEntry::IDENTITY));
    }
}

#[test]
fn check_names_settings_that_prevent_receiving_or_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let taken = UdpSocket::bind("127.0.0.1:0").expect("binds");
    fs::write(folder.path().join("rig.toml"), "version = 1\nname = 'x'\n").expect("writes");
    let settings = Settings {
        listen: "localhost".into(),
        position_listen: taken.local_addr().expect("is bound").to_string(),
        end_s: 3.0,
        ..Settings::default()
    };
    let context = Context { drive: folder.path().join("rig.toml"), ..live(folder.path()) };
    let problems = Acquire::check(&settings, &context);
    let text = |key: &str| problems.iter().find(|problem| problem.key == key).map(|problem| problem.text.clone());
    for (key, words) in [
        ("listen", "value \"localhost\" must be an IPv4 address and a port"),
        ("position_listen", "cannot be bound"),
        ("", "rig.toml: lidar: is missing"),
        ("end_s", "is for recorded drives"),
    ] {
        assert!(text(key).is_some_and(|text| text.contains(words)), "{key}: {problems:?}");
    }
    assert_eq!(problems.len(), 4);
    assert!(Bench::<Acquire>::new(&settings, &live(folder.path())).is_err());
    assert!(!folder.path().join("recording").exists());
}

#[test]
fn recording_outside_the_output_folder_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    for recording in ["../elsewhere", "/tmp/elsewhere", "a/../../elsewhere", ".", ""] {
        let settings = Settings { recording: recording.to_owned(), ..settings() };
        let problems = Acquire::check(&settings, &live(folder.path()));
        let texts: Vec<_> = problems.iter().map(|problem| (problem.key.as_str(), problem.text.as_str())).collect();
        let expected = format!("value {recording:?} must be a path inside the output folder");
        assert_eq!(texts, [("recording", expected.as_str())]);
        assert!(Acquire::new(&settings, &live(folder.path())).is_err(), "{recording:?}");
    }
}

/// Settings of a test for packets without sweeps: the limit is reached by the second packet.
fn impatient() -> Settings {
    Settings { max_undecoded_s: 1e-3, ..settings() }
}

/// The error that ends the run.
fn failure(bench: &mut Bench<Acquire>) -> String {
    let deadline = Instant::now() + TIMEOUT;
    loop {
        match bench.tick() {
            Ok(flow) => assert_eq!(flow, Flow::Continue),
            Err(error) => return error.to_string(),
        }
        assert!(Instant::now() < deadline, "the run does not fail");
    }
}

#[test]
fn packets_that_give_no_sweep_fail_the_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = Settings { model: "vlp16".into(), ..impatient() };
    let mut bench = Bench::<Acquire>::new(&settings, &live(folder.path())).expect("opens");
    let mut sensor = Sensor::new(&settings, folder.path().join("recording/lidar/000.pcap"));
    sensor.send(&simulated(folder.path())[..300]);
    let error = failure(&mut bench);
    for words in
        ["no sweep in", "300 received", "no data packet of vlp16", "data packets of hdl32e come from 127.0.0.1:"]
    {
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn stray_packet_before_the_sensor_does_not_make_a_live_run_deaf() {
    let folder = tempfile::tempdir().expect("a folder");
    let packets = simulated(folder.path());
    let settings = settings();
    let mut bench = Bench::<Acquire>::new(&settings, &live(folder.path())).expect("opens");
    let capture = folder.path().join("recording/lidar/000.pcap");
    let mut stray = packets[0].clone();
    stray[1205] = 0x22;
    let mut other = Sensor::new(&settings, capture.clone());
    other.send(&[stray]);
    let mut sensor = Sensor { n_bytes: other.n_bytes, ..Sensor::new(&settings, capture) };
    let mut ticks = Vec::new();
    for piece in packets.chunks(64) {
        sensor.send(piece);
        bench.tick().expect("steps");
        ticks.push(take(&mut bench));
    }
    ticks.retain(|tick| !tick.is_empty());
    ticks.extend(ticks_to_drain(&mut bench, packets.len() + 1));
    assert_eq!((ticks.len(), bench.counter("foreign_packets")), (42, 1));
    assert_eq!(bench.doubt("foreign_packets"), None);
}
