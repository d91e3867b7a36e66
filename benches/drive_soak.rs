//! Memory of each stage over an hour of drive: a simulated drive whose LiDAR capture is repeated, without GNSS and IMU. At each
//! repetition the vehicle jumps back, so odometry and loop closures never settle.
//! `cargo build --release && cargo bench -p replica-tests --bench drive_soak -- [--seconds 60] [--repeat 60] [--places 100] [--all]`
//!
//! With `--all`, images are also repeated, as links, and all stages run. Clouds are not written: an hour would fill 90
//! GB. The folder of the drive, 2.4 MB per second, is removed at the end.

use geometry::Stamp;
use lidar::pcap::{PacketReader, Writer};
use lidar::velodyne::DATA_PACKET_BYTES;
use replica_tests::{Launch, PATIENT, Running, simulated_drive};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

const STAGES: [&str; 3] = ["acquire", "slam_aggregate", "export"];
const ALL_STAGES: [&str; 7] = ["acquire", "calibrate", "slam_aggregate", "colorize", "infer", "instance", "export"];
/// Row of the table: shared memory of all runs on the machine.
const SHARED: &str = "shared memory";
/// Interval between two samples.
const SAMPLE_EVERY: Duration = Duration::from_secs(1);
/// Offset in a data packet of the sensor's clock: µs of the hour.
const MICROS_AT: usize = 1200;
const HOUR_MICROS: i64 = 3_600_000_000;
/// Growth of the second half of a drive over the first that does not count as a leak, bytes: two poses of a sweep and
/// one of a submap are kept for the end of the drive, 10 MB in an hour.
const SLACK: u64 = 12 << 20;
/// Shares of the drive at which the table gives the memory.
const SHARES: [f64; 6] = [0.05, 0.1, 0.25, 0.5, 0.75, 1.0];

/// Value of an argument. Other arguments, such as cargo's own `--bench`, are ignored.
fn argument(name: &str, default: u64) -> u64 {
    let text = std::env::args().skip_while(|argument| argument != name).nth(1);
    text.map_or(default, |text| text.parse().expect("a number"))
}

/// Repeats the capture of `drive` in `folder`, a file for each repetition, with increasing stamps.
fn repeat(drive: &Path, folder: &Path, n: u64, with_images: bool) {
    fs::create_dir_all(folder.join("lidar")).expect("a folder");
    let source = drive.join("lidar/000000.pcap");
    let mut first = None;
    let mut last = Stamp(0);
    let mut n_packets = 0_i64;
    let mut reader = PacketReader::open(&source).expect("a capture");
    while let Some(packet) = reader.next().expect("a capture") {
        first = first.or(Some(packet.stamp));
        last = packet.stamp;
        n_packets += 1;
    }
    let length = last.0 - first.expect("has packets").0;
    // Whole µs, the resolution of the sensor's clock.
    let period = (length + length / n_packets) / 1000 * 1000;
    for number in 0..n as i64 {
        let file = File::create(folder.join(format!("lidar/{number:06}.pcap"))).expect("created");
        let mut writer = Writer::new(BufWriter::new(file)).expect("written");
        let mut reader = PacketReader::open(&source).expect("a capture");
        while let Some(packet) = reader.next().expect("a capture") {
            if packet.payload.len() != DATA_PACKET_BYTES {
                continue;
            }
            let mut payload = packet.payload.to_vec();
            let micros: &mut [u8; 4] = (&mut payload[MICROS_AT..MICROS_AT + 4]).try_into().expect("four bytes");
            let shifted = (i64::from(u32::from_le_bytes(*micros)) + number * period / 1000) % HOUR_MICROS;
            *micros = (shifted as u32).to_le_bytes();
            let stamp = Stamp(packet.stamp.0 + number * period);
            writer.write_udp(stamp, packet.port, &payload).expect("written");
        }
        writer.finish().expect("written");
    }
    if with_images {
        repeat_images(drive, folder, period, n);
    }
    let manifest = fs::read_to_string(drive.join("drive.toml")).expect("a manifest");
    let sensors = manifest.split("\n[gnss]").next().expect("the tables of LiDAR and cameras");
    fs::write(folder.join("drive.toml"), format!("{sensors}\n")).expect("written");
}

/// Links to all images, repeated with increasing stamps.
fn repeat_images(drive: &Path, folder: &Path, period: i64, n: u64) {
    let cameras = fs::read_dir(drive.join("camera")).expect("cameras").map(|entry| entry.expect("an entry").path());
    for of_camera in cameras.chain(["hs02", "hs03"].map(|mosaic| drive.join(mosaic))) {
        let to = folder.join(of_camera.strip_prefix(drive).expect("inside"));
        fs::create_dir_all(&to).expect("a folder");
        for image in fs::read_dir(&of_camera).expect("images").map(|entry| entry.expect("an entry").path()) {
            let stem = image.file_stem().and_then(|stem| stem.to_str()).expect("a name");
            let Ok(stamp) = stem.parse::<i64>() else {
                if image.is_file() {
                    fs::hard_link(&image, to.join(image.file_name().expect("a name"))).expect("linked");
                }
                continue;
            };
            let extension = image.extension().and_then(|extension| extension.to_str()).expect("an image");
            for number in 0..n as i64 {
                let stamp = stamp + number * period;
                fs::hard_link(&image, to.join(format!("{stamp}.{extension}"))).expect("linked");
            }
        }
        for reference in ["dark", "white"].map(|kind| of_camera.join(kind)).iter().filter(|path| path.is_dir()) {
            let to = to.join(reference.file_name().expect("a name"));
            fs::create_dir_all(&to).expect("a folder");
            for frame in fs::read_dir(reference).expect("frames").map(|entry| entry.expect("an entry").path()) {
                fs::hard_link(&frame, to.join(frame.file_name().expect("a name"))).expect("linked");
            }
        }
    }
}

/// Bytes in use in the machine's shared memory.
fn shared_bytes() -> Option<u64> {
    let found = rustix::fs::statvfs("/dev/shm").ok()?;
    Some((found.f_blocks - found.f_bfree) * found.f_frsize)
}

/// Memory of a process that no other process shares, bytes.
fn private_bytes(pid: rustix::process::Pid) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{}/status", pid.as_raw_nonzero())).ok()?;
    let line = status.lines().find(|line| line.starts_with("RssAnon:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
}

/// Drive time of the last line of a stage in `run/costs.csv`, s.
fn drive_s(launch: &Launch, stage: &str) -> Option<f64> {
    let text = fs::read_to_string(launch.output().join("run/costs.csv")).ok()?;
    let line = text.lines().rev().find(|line| line.split(',').nth(1) == Some(stage))?;
    line.split(',').nth(2)?.parse().ok()
}

/// Drive time and private memory by stage, until the run ends.
fn sample(launch: &Launch, running: &mut Running, stages: &[&'static str]) -> BTreeMap<&'static str, Vec<(f64, u64)>> {
    let mut samples: BTreeMap<_, Vec<_>> = BTreeMap::new();
    while running.ended().is_none() {
        let drive_s = drive_s(launch, "slam_aggregate");
        let mut add = |row, bytes: Option<u64>| samples.entry(row).or_default().extend(drive_s.zip(bytes));
        for stage in stages {
            add(*stage, running.find_stage(stage).and_then(private_bytes));
        }
        add(SHARED, shared_bytes());
        std::thread::sleep(SAMPLE_EVERY);
    }
    samples
}

/// Largest sum of the private memory of all stages and shared memory at the same time. The samples of a stage start
/// with it.
fn largest_sum(samples: &BTreeMap<&'static str, Vec<(f64, u64)>>) -> u64 {
    let longest = samples.values().map(Vec::len).max().unwrap_or_default();
    let at = |back: usize| {
        samples.values().filter_map(|row| row.get(row.len().checked_sub(back)?)).map(|(_, bytes)| bytes).sum()
    };
    (1..=longest).map(at).max().unwrap_or_default()
}

/// Prints the line of a stage. Returns whether its memory does not grow in the second half of the drive.
fn report(stage: &str, samples: &[(f64, u64)]) -> bool {
    let end = samples.last().map_or(0.0, |(drive_s, _)| *drive_s);
    let most = |from: f64, to: f64| {
        let part = samples.iter().filter(|(drive_s, _)| (from * end..=to * end).contains(drive_s));
        part.map(|(_, bytes)| *bytes).max().unwrap_or_default()
    };
    let mb = |bytes: u64| format!("{:.1}", bytes as f64 / 1e6);
    let at = |share: &f64| samples.iter().find(|(drive_s, _)| *drive_s >= share * end).map_or(0, |(_, bytes)| *bytes);
    let cells = SHARES.map(|share| format!("{:>8}", mb(at(&share)))).concat();
    let first = most(0.1, 0.5);
    let second = most(0.5, 1.0);
    let is_flat = second <= first + SLACK;
    let verdict = if is_flat { "flat" } else { "GROWS" };
    println!("{stage:<16}{cells}{:>10}{:>10}  {verdict}", mb(first), mb(second));
    is_flat
}

fn main() -> ExitCode {
    let seconds = argument("--seconds", 60);
    let n = argument("--repeat", 60);
    let places = argument("--places", 100);
    let folder = tempfile::tempdir().expect("a folder");
    let once = folder.path().join("once");
    let repeated = folder.path().join("repeated");
    let all = std::env::args().any(|argument| argument == "--all");
    let rig = if all { "l3d2" } else { "survey" };
    simulated_drive(&once, &["--seed", "1", "--rig", rig, "--seconds", &seconds.to_string()]);
    repeat(&once, &repeated, n, all);
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/street.safetensors");
    let tables = format!("[calibrate]\n[colorize]\n[infer]\nmodel = '{}'\n[instance]\n", model.display());
    let (stages, more) = if all { (&ALL_STAGES[..], tables.as_str()) } else { (&STAGES[..], "") };
    let launch = Launch::new(&format!(
        "[run]\ndrive = '{}'\noutput = 'out'\n{PATIENT}\n[acquire]\n[slam_aggregate]\nloop_places_max = {places}\n{more}\
         [export]\nformats = []\n",
        repeated.display()
    ));
    let mut running = launch.start();
    let samples = sample(&launch, &mut running, stages);
    // Without fixes the heading is undetermined, which is a doubt.
    let code = running.wait();
    println!("seed 1, {seconds} s of drive, {n} times; loop_places_max = {places}; exit code {code:?}");
    let total = launch.summary()["total"].clone();
    println!("{} s of drive in {} s; {} restarts", total["drive_s"], total["wall_s"], total["restarts"]);
    println!("private memory, MB, at these shares of the drive; most from 10 to 50 % and from 50 to 100 %");
    println!("{:<16}{}", "stage", SHARES.map(|share| format!("{:>6} %", share * 100.0)).concat());
    let rows = stages.iter().copied().chain([SHARED]);
    let is_flat: Vec<bool> = rows.map(|row| report(row, samples.get(row).map_or(&[], Vec::as_slice))).collect();
    println!("all together, most: {:.1}", largest_sum(&samples) as f64 / 1e6);
    if matches!(code, Some(0 | 3)) && !is_flat.contains(&false) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
