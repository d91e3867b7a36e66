//! The bridge with Cyclone DDS, a third-party middleware of ROS 2. Needs Python with its package:
//!
//! ```sh
//! python3 -m venv venv && venv/bin/pip install cyclonedds==11.0.1
//! REPLICA_ROS2_PYTHON=$PWD/venv/bin/python cargo test --release --manifest-path tools/ros2/Cargo.toml -- --include-ignored
//! ```

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::{self, JoinHandle};

/// Ends a receiver.
const END: &[u8] = b"the end of the test";

/// A receiver of UDP.
struct Receiver {
    address: String,
    thread: JoinHandle<Vec<Vec<u8>>>,
}

impl Receiver {
    fn start() -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("binds");
        let address = socket.local_addr().expect("is bound").to_string();
        let receive = move || {
            let mut buffer = vec![0; 65_536];
            let next = || socket.recv(&mut buffer).map(|n| buffer[..n].to_vec()).expect("receives");
            std::iter::repeat_with(next).take_while(|packet| packet != END).collect()
        };
        Self { address, thread: thread::spawn(receive) }
    }

    /// Received datagrams.
    fn finish(self) -> Vec<Vec<u8>> {
        UdpSocket::bind("127.0.0.1:0").expect("binds").send_to(END, self.address).expect("sends");
        self.thread.join().expect("receives")
    }
}

/// Data that the bridge wrote, by topic: images in the order of their names, packets and lines in the order of arrival.
type Data = BTreeMap<&'static str, Vec<Vec<u8>>>;

/// Result of the bridge for the messages of the peer: its data, exit code and messages.
struct Outcome {
    data: Data,
    code: Option<i32>,
    said: String,
    /// Topics and SHA-256 of the messages that the peer reports as sent.
    sent: Vec<(String, String)>,
}

fn images(folder: &Path) -> Vec<Vec<u8>> {
    let mut paths: Vec<_> = fs::read_dir(folder).expect("lists").map(|entry| entry.expect("lists").path()).collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).expect("reads")).collect()
}

/// Sends SIGINT, as Ctrl-C does.
fn interrupt(child: &Child) {
    let status = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill starts");
    assert!(status.success());
}

fn run(domain: u32, peer_options: &[&str], more: &[&str]) -> Outcome {
    let python = std::env::var("REPLICA_ROS2_PYTHON").expect("REPLICA_ROS2_PYTHON names a Python with cyclonedds");
    let folder = tempfile::tempdir().expect("a folder");
    // Domains of tests that run side by side, and of other runs of this test, differ.
    let domain = (10 + domain + 4 * (std::process::id() % 50)).to_string();
    let [imu, nmea, velodyne, ouster] = std::array::from_fn(|_| Receiver::start());
    let mut bridge = Command::new(env!("CARGO_BIN_EXE_replica-ros2"))
        .args(["--domain", &domain, "--discover", "0.5", "--imu", &imu.address, "--nmea", &nmea.address])
        .args(["--lidar", &velodyne.address, "--lidar", &ouster.address, "--cameras"])
        .arg(folder.path())
        .args(["--topic", "lidar=/velodyne_packets", "--topic", "lidar.1=/ouster/lidar_packets"])
        .args(["--topic", "camera.0=/front/image_raw/compressed", "--topic", "camera.1=/left/image_raw"])
        .args(["--topic", "mosaic.hs02=/hs02/image_raw"])
        .args(more)
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts");
    let peer = Command::new(python)
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/cyclone_peer.py"))
        .args(["sensors", "--domain", &domain])
        .args(peer_options)
        .output()
        .expect("starts");
    assert!(peer.status.success(), "{}", String::from_utf8_lossy(&peer.stderr));
    interrupt(&bridge);
    let lines = BufReader::new(bridge.stderr.take().expect("is a pipe")).lines();
    let said: String = lines.map(|line| line.expect("is text") + "\n").collect();
    let code = bridge.wait().expect("ends").code();
    let data = Data::from([
        ("/front/image_raw/compressed", images(&folder.path().join("camera/0"))),
        ("/left/image_raw", images(&folder.path().join("camera/1"))),
        ("/hs02/image_raw", images(&folder.path().join("hs02"))),
        ("/imu/data", imu.finish()),
        ("nmea", nmea.finish()),
        ("/velodyne_packets", velodyne.finish()),
        ("/ouster/lidar_packets", ouster.finish()),
    ]);
    let sent = String::from_utf8(peer.stdout).expect("is text");
    let sent = sent.lines().filter_map(|line| line.split_once(' ')).map(|(a, b)| (a.into(), b.into())).collect();
    Outcome { data, code, said, sent }
}

fn sha256(bytes: &[u8]) -> String {
    use std::io::Write;
    let command = Command::new("sha256sum").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
    let mut child = command.expect("sha256sum starts");
    child.stdin.take().expect("is a pipe").write_all(bytes).expect("writes");
    let output = child.wait_with_output().expect("ends");
    String::from_utf8_lossy(&output.stdout)[..64].to_owned()
}

/// Checks that exactly what was published was written.
fn check(outcome: &Outcome, nmea_topic: &str) {
    let Outcome { data, said, sent, .. } = outcome;
    for (topic, written) in data {
        let topic = if *topic == "nmea" { nmea_topic } else { topic };
        let expected: Vec<_> = sent.iter().filter(|(of, _)| of == topic).map(|(_, sum)| sum.clone()).collect();
        // The pixels of a raw image are compared, and the samples of a mosaic after the header; a scan has 75 packets.
        let parts: Vec<Vec<u8>> = match topic {
            "/left/image_raw" => written.iter().map(|png| pixels(png)).collect(),
            "/hs02/image_raw" => written.iter().map(|pgm| pgm[pgm.len() - 2 * 320 * 240..].to_vec()).collect(),
            "/velodyne_packets" => written.chunks(75).map(<[_]>::concat).collect(),
            _ => written.clone(),
        };
        let found: Vec<_> = parts.iter().map(|part| sha256(part)).collect();
        assert!(expected.len() >= 3, "{topic}: {sent:?}");
        assert_eq!(found, expected, "{topic}\n{said}");
    }
}

fn pixels(png: &[u8]) -> Vec<u8> {
    image::load_from_memory(png).expect("decodes").into_rgb8().into_raw()
}

#[test]
#[ignore = "needs Python with cyclonedds: REPLICA_ROS2_PYTHON"]
fn reliable_messages_of_cyclone_are_written_exactly() {
    let outcome = run(0, &["--reliable", "--without", "/fix"], &[]);
    check(&outcome, "/nmea_sentence");
    assert_eq!(outcome.said.matches(", reliable\n").count(), 7, "{}", outcome.said);
    assert_eq!(outcome.code, Some(0), "{}", outcome.said);
}

#[test]
#[ignore = "needs Python with cyclonedds: REPLICA_ROS2_PYTHON"]
fn messages_of_best_effort_are_written_exactly() {
    let outcome = run(1, &["--without", "/fix"], &[]);
    check(&outcome, "/nmea_sentence");
    assert_eq!(outcome.said.matches(", best effort\n").count(), 7, "{}", outcome.said);
    assert_eq!(outcome.code, Some(0), "{}", outcome.said);
}

#[test]
#[ignore = "needs Python with cyclonedds: REPLICA_ROS2_PYTHON"]
fn reliable_messages_are_taken_with_best_effort_if_asked() {
    let outcome = run(2, &["--reliable", "--without", "/fix"], &["--best-effort"]);
    check(&outcome, "/nmea_sentence");
    assert_eq!(outcome.said.matches(", best effort\n").count(), 7, "{}", outcome.said);
}

#[test]
#[ignore = "needs Python with cyclonedds: REPLICA_ROS2_PYTHON"]
fn damaged_images_are_named_and_the_others_are_written() {
    let outcome = run(3, &["--reliable", "--damaged", "--without", "/nmea_sentence"], &[]);
    let Outcome { data, said, sent, code } = &outcome;
    assert_eq!(data["/front/image_raw/compressed"].len(), 3);
    assert_eq!(data["/left/image_raw"].len(), 3);
    for reason in [
        "/front/image_raw/compressed: message left out: format \"theora\": the data are neither JPEG nor PNG",
        "/left/image_raw: message left out: 1280 x 1312 pixels of 3 bytes in rows of 3840 bytes need 5038080 bytes; 3 are there",
    ] {
        assert!(said.contains(reason), "{said}");
    }
    assert!(said.contains("4 messages, 3 images, 1 messages left out"), "{said}");
    assert_eq!(*code, Some(3), "{said}");
    // Positions become sentences.
    let lines = String::from_utf8(data["nmea"].concat()).expect("is text");
    assert_eq!(lines.lines().count(), 6, "{lines}");
    assert!(lines.starts_with("$GPGGA,221320.000,4830.0000") && lines.contains("\r\n$GPRMC,221320.000,A,4830.0000"));
    assert_eq!(sent.iter().filter(|(topic, _)| topic == "/fix").count(), 3);
}
