//! Live runs whose LiDAR sends nothing, returns from another port, or is not the only sender.

use crate::live::{Packets, Sensor, TIMEOUT, live, offline, settings, simulated, ticks_to_decode, ticks_to_drain};
use acquire::{Acquire, Settings};
use lidar::velodyne::DATA_PACKET_BYTES;
use stage::testing::Bench;
use stage::{Flow, StepError};
use std::time::{Duration, Instant};

/// A run that waits for the packets of a simulated sensor.
struct LiveRun {
    folder: tempfile::TempDir,
    packets: Packets,
    bench: Bench<Acquire>,
    sensor: Sensor,
}

impl LiveRun {
    fn start() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let packets = simulated(folder.path());
        let settings = settings();
        let capture = folder.path().join("recording/lidar/000.pcap");
        let bench = Bench::<Acquire>::new(&settings, &live(folder.path())).expect("opens");
        let sensor = Sensor::new(&settings, capture);
        Self { folder, packets, bench, sensor }
    }
}

#[test]
fn run_that_never_receives_a_packet_fails_with_the_address() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = Settings { quiet_s: 0.1, ..settings() };
    let mut bench = Bench::<Acquire>::new(&settings, &live(folder.path())).expect("opens");
    let deadline = Instant::now() + TIMEOUT;
    let error = loop {
        assert!(Instant::now() < deadline, "the run does not fail");
        match bench.tick() {
            Ok(flow) => assert_eq!(flow, Flow::Continue),
            Err(error) => break error,
        }
    };
    // The process is not restarted.
    assert!(matches!(error, StepError::Configuration(_)), "{error:?}");
    let error = error.to_string();
    assert!(error.contains(&settings.listen) && error.contains("no packet in"), "{error}");
}

/// The default has no limit of silence: the sensor may be switched on later.
#[test]
fn run_without_a_limit_of_silence_says_that_it_waits() {
    let LiveRun { folder, packets, mut bench, mut sensor } = LiveRun::start();
    assert_eq!(settings().quiet_s, 0.0);
    let deadline = Instant::now() + TIMEOUT;
    while bench.notes().is_empty() {
        assert!(Instant::now() < deadline, "the run does not say that it waits");
        assert_eq!(bench.tick().expect("steps"), Flow::Continue);
    }
    let note = bench.notes()[0].clone();
    for words in ["127.0.0.1", "no packet in 5 s", "quiet_s = 0", "Ctrl-C"] {
        assert!(note.contains(words), "{note}");
    }
    sensor.send(&packets);
    assert!(!ticks_to_decode(&mut bench, packets.len()).is_empty());
    bench.finish().expect("the run can be ended");
    assert_eq!(bench.doubt("no_sweep"), None);
    drop(folder);
}

#[test]
fn run_that_is_ended_before_the_first_packet_is_a_doubt() {
    let LiveRun { folder: _folder, mut bench, .. } = LiveRun::start();
    assert_eq!(bench.tick().expect("steps"), Flow::Continue);
    bench.finish().expect("the run can be ended");
    assert_eq!(bench.doubt("no_sweep"), Some(0.0));
}

#[test]
fn sensor_that_returns_from_another_port_is_followed_and_a_doubt() {
    let LiveRun { folder, packets, mut bench, mut sensor } = LiveRun::start();
    let (first, second) = packets.split_at(4500);
    sensor.send(first);
    let mut ticks = ticks_to_decode(&mut bench, first.len());
    // The kernel stamps the packets, so the silence must be real.
    let back = Instant::now() + Duration::from_millis(1200);
    while Instant::now() < back {
        assert_eq!(bench.tick().expect("steps"), Flow::Continue);
    }
    let mut sensor = sensor.on_another_port();
    sensor.send(second);
    ticks.extend(ticks_to_drain(&mut bench, packets.len()));
    assert_eq!((bench.counter("source_changes"), bench.counter("foreign_packets")), (1, 0));
    let silent_s = bench.doubt("source_changed").expect("is doubted");
    assert!(silent_s > 1.1, "{silent_s} s");
    assert_eq!(bench.doubt("second_source"), None);
    let (reference, of_recording) = offline(&folder.path().join("recording"));
    assert!(ticks.concat() == reference.concat(), "live and recorded messages differ");
    assert_eq!(of_recording.counter("source_changes"), 1);
    assert!(reference.len() > 40, "{} sweeps", reference.len());
}

#[test]
fn second_sender_at_the_same_time_is_a_doubt_and_changes_no_sweep() {
    let LiveRun { folder: _folder, packets, mut bench, mut sensor } = LiveRun::start();
    sensor.send(&packets[..4500]);
    let mut other = sensor.on_another_port();
    let data = packets.iter().find(|packet| packet.len() == DATA_PACKET_BYTES).expect("has one").clone();
    let wait = |bench: &mut Bench<Acquire>| {
        let end = Instant::now() + Duration::from_millis(150);
        while Instant::now() < end {
            bench.tick().expect("steps");
        }
    };
    let mut n_other = 0_u32;
    for piece in packets[4500..].chunks(500) {
        other.n_bytes = sensor.n_bytes;
        other.send(std::slice::from_ref(&data));
        n_other += 1;
        wait(&mut bench);
        sensor.n_bytes = other.n_bytes;
        sensor.send(piece);
    }
    while bench.counter("data_packets") + bench.counter("position_packets") < packets.len() as u64 {
        assert_eq!(bench.tick().expect("steps"), Flow::Continue);
    }
    bench.finish().expect("finishes");
    assert_eq!(bench.counter("source_changes"), 0);
    // The first packet of the second sender may still be the first of a sensor that returns.
    assert_eq!(bench.doubt("second_source"), Some(f64::from(n_other - 1)));
    assert_eq!(bench.counter("foreign_packets"), u64::from(n_other));
}
