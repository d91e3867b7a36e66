//! Two simulated LiDARs on two ports of the loopback network.

use crate::secondary_lidars::{N_REAR_PACKETS, manifest, rear_entry, rear_packets};
use crate::support::{N_PACKETS, write_lidar};
use acquire::{Acquire, Settings};
use drive::Drive;
use lidar::pcap::PacketReader;
use messages::{SweepTopic, pod};
use stage::testing::{Bench, context};
use stage::{Context, Flow, Mode, Stage};
use std::fs;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Timeout: far longer than any wait on a busy machine.
const TIMEOUT: Duration = Duration::from_mins(3);

/// Packets of the first LiDAR in a burst, and their time.
const PACKETS_OF_BURST: usize = 24;
const BURST: Duration = Duration::from_nanos(24 * 552_960);

/// Settings with free ports for `n` LiDARs.
fn settings(n: usize) -> Settings {
    let sockets: Vec<UdpSocket> = (0..=n).map(|_| UdpSocket::bind("127.0.0.1:0").expect("binds")).collect();
    let addresses: Vec<String> =
        sockets.iter().map(|socket| socket.local_addr().expect("is bound").to_string()).collect();
    Settings {
        listen: addresses[..n].join(", "),
        position_listen: addresses[n].clone(),
        max_behind: 10_000,
        max_undecoded_s: 0.0,
        ..Settings::default()
    }
}

fn live(folder: &Path) -> Context {
    let text = toml::to_string(&manifest(rear_entry("rear"))).expect("encodes");
    fs::write(folder.join("rig.toml"), text).expect("writes");
    Context { mode: Mode::Live, drive: folder.join("rig.toml"), ..context(folder) }
}

/// Sends bursts, and waits after each until it is in the capture, so that no burst is lost.
pub(crate) struct Sender {
    socket: UdpSocket,
    address: String,
    capture: PathBuf,
    n_bytes: u64,
}

impl Sender {
    pub(crate) fn new(address: &str, capture: PathBuf) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("binds");
        Self { socket, address: address.trim().to_owned(), capture, n_bytes: 24 }
    }

    pub(crate) fn send(&mut self, burst: &[Vec<u8>]) {
        for packet in burst {
            self.socket.send_to(packet, &self.address).expect("sends");
            self.n_bytes += 16 + 42 + packet.len() as u64;
        }
        let deadline = Instant::now() + TIMEOUT;
        while fs::metadata(&self.capture).map_or(0, |metadata| metadata.len()) < self.n_bytes {
            assert!(Instant::now() < deadline, "{} does not reach {} bytes", self.capture.display(), self.n_bytes);
            std::thread::yield_now();
        }
    }
}

/// Index of the LiDAR and points of each sweep.
fn sweeps(bench: &mut Bench<Acquire>) -> Vec<(u32, Vec<u8>)> {
    let of = |sweep: stage::Received<SweepTopic>| (sweep.header().lidar, pod::bytes_from_rows(sweep.rows()).to_vec());
    bench.take::<SweepTopic>().into_iter().map(of).collect()
}

#[test]
fn two_lidars_on_two_ports_are_recorded_and_published_as_their_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    write_lidar(folder.path(), |_| true);
    let mut reader = PacketReader::open(&folder.path().join("lidar/0.pcap")).expect("opens");
    let mut front = Vec::new();
    while let Some(packet) = reader.next().expect("reads") {
        front.push(packet.payload.to_vec());
    }
    let rear: Vec<Vec<u8>> = rear_packets(|_| true).into_iter().map(|(_, payload)| payload).collect();
    let settings = settings(2);
    let context_live = live(folder.path());
    let mut bench = Bench::new(&settings, &context_live).expect("opens");
    let recording = folder.path().join("recording");
    let addresses: Vec<&str> = settings.listen.split(',').collect();
    let mut front_sender = Sender::new(addresses[0], recording.join("lidar/000.pcap"));
    let mut rear_sender = Sender::new(addresses[1], recording.join("lidar_rear/000.pcap"));
    // In the time of the sensors: without fixes, a LiDAR is chosen by its packets of three seconds. Faster bursts leave the
    // second LiDAR unchosen until the end of the run.
    let mut of_rear = rear.chunks(10);
    let mut first_sent = None;
    for (number, of_front) in front.chunks(PACKETS_OF_BURST).enumerate() {
        let due = BURST * number as u32;
        while first_sent.is_some_and(|sent: Instant| sent.elapsed() < due) {
            std::thread::yield_now();
        }
        front_sender.send(of_front);
        of_rear.next().into_iter().for_each(|burst| rear_sender.send(burst));
        first_sent.get_or_insert_with(Instant::now);
    }
    let mut found = Vec::new();
    let deadline = Instant::now() + TIMEOUT;
    while bench.counter("data_packets") < N_PACKETS as u64 {
        assert_eq!(bench.tick().expect("steps"), Flow::Continue);
        found.extend(sweeps(&mut bench));
        assert!(Instant::now() < deadline, "{} packets are decoded", bench.counter("data_packets"));
    }
    bench.finish().expect("finishes");
    found.extend(sweeps(&mut bench));
    assert_eq!(bench.counter("lidar_rear_udp_packets"), N_REAR_PACKETS as u64);
    let n_of = |lidar: u32| found.iter().filter(|(of, _)| *of == lidar).count();
    assert!(n_of(0) >= 41 && n_of(1) >= 38, "{} and {} sweeps", n_of(0), n_of(1));

    let drive = Drive::open(&recording).expect("is a drive");
    let names: Vec<String> = (0..2).map(|index| drive.manifest().lidar_name(index).into_owned()).collect();
    assert_eq!(names, ["front", "rear"]);
    let mut recorded = Bench::<Acquire>::new(&Settings::default(), &context(&recording)).expect("opens");
    let mut expected = Vec::new();
    while recorded.tick().expect("steps") == Flow::Continue {
        expected.extend(sweeps(&mut recorded));
    }
    // The last sweeps of a live run may end with the recording.
    let n = found.len() - 4;
    assert!(found[..n] == expected[..n], "live and recorded sweeps differ");
}

#[test]
fn number_of_addresses_must_be_that_of_the_lidars() {
    let folder = tempfile::tempdir().expect("a folder");
    for n in [1, 3] {
        let problems = Acquire::check(&settings(n), &live(folder.path()));
        let texts: Vec<_> = problems.iter().map(|problem| (problem.key.as_str(), problem.text.as_str())).collect();
        assert!(matches!(texts[..], [("listen", text)] if text.contains("for 2 LiDAR(s)")), "{texts:?}");
        assert!(Acquire::new(&settings(n), &live(folder.path())).is_err());
    }
    assert!(Acquire::check(&settings(2), &live(folder.path())).is_empty());
}
