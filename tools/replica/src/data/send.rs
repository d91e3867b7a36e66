//! `replica send`: sends a drive as its sensors did, at the speed at which it was recorded.

mod auxiliary;
mod images;
mod lines;

use anyhow::{Context, ensure};
use auxiliary::{AuxiliarySensors, Targets};
use command_line::argument::InvalidValue;
use command_line::terminal::StopFlag;
use command_line::{say, say_error};
use drive::Drive;
use geometry::Stamp;
use images::{ImageWriter, prepare_folders};
use lidar::Model;
use lidar::pcap::PacketReader;
use lidar::velodyne::{DATA_PACKET_BYTES, POSITION_PACKET_BYTES, POSITION_PORT, restamp};
use run::exit;
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use std::time::{Duration, Instant, SystemTime};

/// Ctrl-C takes effect within this time.
const MAX_SLEEP: Duration = Duration::from_millis(100);
/// Stamps are moved by less than this, ns: a century.
const MAX_SHIFT_NANOS: i64 = 100 * 366 * 86_400 * 1_000_000_000;
/// Measurements of other sensors within this time before the first and after the last packet are also sent.
const AROUND: Duration = Duration::from_secs(1);

/// Send a drive: packets and lines over UDP, images as files.
///
/// Sends data packets of all supported models, and position packets (512 bytes). Other packets are skipped and counted. All sensors
/// follow one clock. Measurements up to one second before the first packet are sent with it.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done or Ctrl-C, 1 failed, 2 wrong usage\n\n\
                  Example: replica send drives/sample --restamp --to 127.0.0.1:2368")]
pub struct Args {
    /// Capture of a LiDAR (pcap or pcapng), or a drive folder, whose captures are sent as one stream
    capture: PathBuf,
    /// Host and port of the receiver of data packets
    #[arg(long, default_value = "127.0.0.1:2368", value_parser = address)]
    to: SocketAddr,
    /// Port of the receiver of position packets, on the same host
    #[arg(long, default_value_t = POSITION_PORT)]
    position_port: u16,
    /// Folder into which the images of the drive are written at their time, as a grabber does: under a temporary name, then renamed
    #[arg(long, value_name = "FOLDER")]
    images: Option<PathBuf>,
    /// Host and port of the receiver of NMEA sentences
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    nmea: Option<SocketAddr>,
    /// Host and port of the receiver of IMU samples
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    imu: Option<SocketAddr>,
    /// Shift all stamps to the current time. Only for Velodyne LiDARs: packets of other makers are not changed
    #[arg(long)]
    restamp: bool,
    /// Speed: a factor of the original speed (0.001 to 1000), or max: as fast as possible
    #[arg(long, default_value = "1.0")]
    speed: Speed,
    /// Repeat until Ctrl-C; at each repetition the clock of the sensor jumps back
    #[arg(long = "loop")]
    again: bool,
    /// Start of the part to send, s after the first packet
    #[arg(long, default_value_t = 0.0)]
    start: f64,
    /// Length of the part to send, s [default: to the end of the capture]
    #[arg(long)]
    seconds: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Speed {
    Times(f64),
    Max,
}

impl FromStr for Speed {
    type Err = InvalidValue;

    fn from_str(text: &str) -> Result<Self, InvalidValue> {
        if text == "max" {
            return Ok(Speed::Max);
        }
        let times = text.parse().ok().filter(|times| (1e-3..=1e3).contains(times));
        times.map(Speed::Times).ok_or(InvalidValue("0.001 to 1000, or max"))
    }
}

#[derive(Debug, thiserror::Error)]
enum AddressError {
    #[error("{0}; must be HOST:PORT")]
    Unresolved(#[from] std::io::Error),
    #[error("the host has no IPv4 address")]
    NoIpv4,
}

fn address(text: &str) -> Result<SocketAddr, AddressError> {
    text.to_socket_addrs()?.find(SocketAddr::is_ipv4).ok_or(AddressError::NoIpv4)
}

/// Counts of the packets.
#[derive(Debug, Default)]
struct Sent {
    n_data: u64,
    n_position: u64,
    n_bytes: u64,
    n_skipped: u64,
    n_images: u64,
    n_nmea: u64,
    n_imu: u64,
    /// The largest delay behind the schedule.
    max_delay: Duration,
}

/// Sends until the end of the capture or Ctrl-C. The counts go to stdout.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    ensure!(args.start >= 0.0 && args.start.is_finite(), "--start {}: must be 0 or above", args.start);
    ensure!(args.seconds.is_none_or(|s| s > 0.0), "--seconds {:?}: must be above 0", args.seconds.unwrap_or_default());
    let drive = args.capture.is_dir().then(|| Drive::open(&args.capture)).transpose()?;
    let files = captures(&args.capture, drive.as_ref())?;
    let targets = Targets { images: args.images.clone(), nmea: args.nmea, imu: args.imu };
    check(args, drive.as_ref())?;
    if let (Some(drive), Some(root)) = (&drive, &args.images) {
        prepare_folders(drive, root)?;
    }
    let stop = StopFlag::register(exit::DONE).context("cannot register signal handlers")?;
    let socket = UdpSocket::bind("0.0.0.0:0").context("cannot open a UDP socket")?;
    socket.set_broadcast(true).context("cannot enable broadcasts")?;
    let begin = Instant::now();
    let drive = drive.as_ref();
    let targets = &targets;
    let mut player = Player {
        args,
        drive,
        targets,
        socket,
        stop,
        begin,
        played: Duration::ZERO,
        shift: 0,
        images: ImageWriter::default(),
        sent: Sent::default(),
    };
    let result = player.play_all(&files);
    let result = result.and(player.images.finish());
    player.report()?;
    result.map(|()| ExitCode::SUCCESS)
}

/// The capture, or the captures of the drive.
fn captures(path: &Path, drive: Option<&Drive>) -> anyhow::Result<Vec<PathBuf>> {
    let Some(drive) = drive else { return Ok(vec![path.to_owned()]) };
    let format = &drive.manifest().lidar.format;
    ensure!(format == "pcap", "{}: the sweeps are {format} files, only captures (pcap) can be sent", path.display());
    let names: Vec<_> = (0..drive.lidars().count()).map(|index| drive.manifest().lidar_name(index)).collect();
    ensure!(
        names.len() == 1,
        "{}: has the captures of {} LiDARs ({}); send each of them by its file, to the port of that LiDAR",
        path.display(),
        names.len(),
        names.join(", ")
    );
    Ok(drive.sweep_files().to_vec())
}

/// Rejects options that the drive does not support.
fn check(args: &Args, drive: Option<&Drive>) -> anyhow::Result<()> {
    let path = args.capture.display();
    let manifest = drive.map(Drive::manifest);
    let has_cameras = manifest.is_some_and(|manifest| !manifest.cameras.is_empty() || !manifest.mosaics.is_empty());
    for (option, is_set, is_there, what) in [
        ("--images", args.images.is_some(), has_cameras, "cameras"),
        ("--nmea", args.nmea.is_some(), manifest.is_some_and(|manifest| manifest.gnss.is_some()), "GNSS receiver"),
        ("--imu", args.imu.is_some(), manifest.is_some_and(|manifest| manifest.imu.is_some()), "IMU"),
    ] {
        ensure!(!is_set || is_there, "{option}: {path} has no {what}; name the folder of a drive that has");
    }
    let is_other = drive.is_some_and(|drive| !matches!(drive.model(), Model::Velodyne(_)));
    ensure!(
        !args.restamp || !is_other,
        "--restamp: {path} has a LiDAR whose packets cannot be restamped; only Velodyne packets can"
    );
    Ok(())
}

struct Player<'a> {
    args: &'a Args,
    drive: Option<&'a Drive>,
    targets: &'a Targets,
    socket: UdpSocket,
    stop: StopFlag,
    begin: Instant,
    /// Duration of the earlier repetitions, in time of the capture.
    played: Duration,
    /// Added to all stamps of this repetition, ns.
    shift: i64,
    images: ImageWriter,
    sent: Sent,
}

impl Player<'_> {
    fn play_all(&mut self, files: &[PathBuf]) -> anyhow::Result<()> {
        loop {
            let before = self.sent.n_data + self.sent.n_position;
            self.play_round(files)?;
            let n_sent = self.sent.n_data + self.sent.n_position - before;
            let path = self.args.capture.display();
            ensure!(n_sent > 0 || self.is_stopped(), "{path}: no LiDAR packet in the selected part");
            if !self.args.again || self.is_stopped() {
                return Ok(());
            }
        }
    }

    fn play_round(&mut self, files: &[PathBuf]) -> anyhow::Result<()> {
        let mut others = AuxiliarySensors::from_drive(self.drive, self.targets)?;
        let mut first = None;
        let mut at = Duration::ZERO;
        let mut last_gap = Duration::ZERO;
        'files: for path in files {
            let mut reader = PacketReader::open(path)?;
            while let Some(packet) = reader.next()? {
                if self.is_stopped() {
                    break 'files;
                }
                if first.is_none() {
                    self.begin_round(packet.stamp, &mut others)?;
                }
                let since = packet.stamp.seconds_since(*first.get_or_insert(packet.stamp)) - self.args.start;
                if since < 0.0 {
                    continue;
                }
                if self.args.seconds.is_some_and(|seconds| since >= seconds) {
                    break 'files;
                }
                let is_data = packet.payload.len() == DATA_PACKET_BYTES || Model::may_be_data(packet.payload);
                let port = match packet.payload.len() {
                    _ if is_data && !packet.is_cut => self.args.to.port(),
                    POSITION_PACKET_BYTES if !packet.is_cut => self.args.position_port,
                    _ => {
                        self.sent.n_skipped += 1;
                        continue;
                    }
                };
                // A capture clock that was set back must not cause a wait.
                let due = Duration::try_from_secs_f64(since).unwrap_or_default().max(at);
                last_gap = due.saturating_sub(at);
                at = due;
                if !self.send_others(&mut others, first, at)? || !self.wait_for(at) {
                    break 'files;
                }
                self.send(port, packet.payload)?;
            }
            let stats = reader.stats();
            self.sent.n_skipped += stats.foreign_frames;
            if stats.cut_records > 0 {
                say_error!("warning: {}: ends within a packet, which is skipped", path.display());
            }
        }
        let end = self.args.seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        self.send_others(&mut others, first, end.unwrap_or(at + AROUND).min(at + AROUND))?;
        self.played += at + last_gap;
        Ok(())
    }

    /// Skips measurements of the other sensors before the part to send, and determines the shift of the stamps.
    fn begin_round(&mut self, first: Stamp, others: &mut AuxiliarySensors<'_>) -> anyhow::Result<()> {
        let begin = Stamp(first.0.saturating_add((self.args.start * 1e9) as i64));
        let lead = if self.args.start > 0.0 { 0 } else { AROUND.as_nanos() as i64 };
        others.skip_before(Stamp(begin.0.saturating_sub(lead)))?;
        if self.args.restamp {
            let due = self.due(Duration::ZERO);
            let clock = Instant::now();
            // The start of this repetition is slightly in the future or in the past.
            let now = SystemTime::now() + due.saturating_duration_since(clock) - clock.saturating_duration_since(due);
            let now = now.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_nanos() as i64;
            // Sentences have milliseconds.
            self.shift = now.saturating_sub(begin.0).div_euclid(1_000_000) * 1_000_000;
            ensure!(self.shift.abs() < MAX_SHIFT_NANOS, "--restamp: the drive starts at {begin} s: not a valid date");
        }
        Ok(())
    }

    /// Sends the measurements of the other sensors up to a time of this repetition. `false` if stopped.
    fn send_others(
        &mut self,
        others: &mut AuxiliarySensors<'_>,
        first: Option<Stamp>,
        until: Duration,
    ) -> anyhow::Result<bool> {
        let Some(first) = first else { return Ok(true) };
        while let Some(stamp) = others.next_stamp() {
            let at = Duration::try_from_secs_f64(stamp.seconds_since(first) - self.args.start).unwrap_or_default();
            if at > until {
                break;
            }
            if !self.wait_for(at) {
                return Ok(false);
            }
            others.send_next(self.shift, &self.socket, &mut self.images, &mut self.sent)?;
        }
        Ok(true)
    }

    /// The instant at which a time of this repetition is due.
    fn due(&self, at: Duration) -> Instant {
        match self.args.speed {
            Speed::Times(times) => self.begin + (self.played + at).div_f64(times),
            Speed::Max => Instant::now(),
        }
    }

    /// Sleeps until a time of this repetition is due. The schedule is absolute: earlier delays do not add up. `false` if
    /// stopped.
    fn wait_for(&mut self, at: Duration) -> bool {
        if self.args.speed == Speed::Max {
            return !self.is_stopped();
        }
        let due = self.due(at);
        loop {
            let left = due.saturating_duration_since(Instant::now());
            if self.is_stopped() || left.is_zero() {
                break;
            }
            std::thread::sleep(left.min(MAX_SLEEP));
        }
        self.sent.max_delay = self.sent.max_delay.max(due.elapsed());
        !self.is_stopped()
    }

    fn send(&mut self, port: u16, payload: &[u8]) -> anyhow::Result<()> {
        let target = SocketAddr::new(self.args.to.ip(), port);
        let mut moved;
        let payload = if self.shift == 0 {
            payload
        } else {
            moved = payload.to_vec();
            restamp(&mut moved, self.shift);
            &moved
        };
        self.socket.send_to(payload, target).with_context(|| format!("cannot send to {target}"))?;
        let is_data = payload.len() != POSITION_PACKET_BYTES;
        *(if is_data { &mut self.sent.n_data } else { &mut self.sent.n_position }) += 1;
        self.sent.n_bytes += payload.len() as u64;
        Ok(())
    }

    fn is_stopped(&self) -> bool {
        self.stop.is_set()
    }

    fn report(&self) -> std::io::Result<()> {
        let Sent { n_data, n_position, n_bytes, n_skipped, n_images, n_nmea, n_imu, max_delay } = self.sent;
        let seconds = self.begin.elapsed().as_secs_f64();
        let n_packets = n_data + n_position;
        say!(
            "sent {n_packets} packets ({n_data} data, {n_position} position), {n_bytes} bytes in {seconds:.3} s, {:.0} packets/s",
            n_packets as f64 / seconds.max(1e-9)
        )?;
        if n_images + n_nmea + n_imu > 0 {
            say!("sent {n_images} images, {n_nmea} NMEA lines, {n_imu} IMU lines")?;
        }
        if self.args.speed != Speed::Max {
            say!("largest delay {:.3} ms", max_delay.as_secs_f64() * 1e3)?;
        }
        if n_skipped > 0 {
            say!("skipped {n_skipped} other packets")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use command_line::argument::Cli;
    use lidar::pcap::Writer;

    /// Ten packets, 1 ms apart. The first byte is their number; every fourth is neither a data nor a position packet.
    fn capture(folder: &Path) -> PathBuf {
        let mut writer = Writer::new(Vec::new()).expect("writes");
        for number in 0..10_u8 {
            let length = [DATA_PACKET_BYTES, POSITION_PACKET_BYTES, DATA_PACKET_BYTES, 100][usize::from(number) % 4];
            let stamp = Stamp(1_700_000_000_000_000_000 + i64::from(number) * 1_000_000);
            writer.write_udp(stamp, 2368, &vec![number; length]).expect("writes");
        }
        let path = folder.join("a.pcap");
        std::fs::write(&path, writer.finish().expect("writes")).expect("writes");
        path
    }

    fn sent(words: &[&str]) -> (Vec<u8>, Vec<u8>) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = capture(folder.path());
        let [data, position] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").expect("binds"));
        let address = |socket: &UdpSocket| socket.local_addr().expect("is bound");
        let to = address(&data).to_string();
        let port = address(&position).port().to_string();
        let words = [&["", path.to_str().expect("UTF-8"), "--to", &to, "--position-port", &port], words].concat();
        run(&Cli::parse_from(words).args).expect("sends");
        let received = |socket: UdpSocket, length: usize| {
            socket.set_nonblocking(true).expect("sets");
            let mut packet = [0; 2048];
            let mut firsts = Vec::new();
            while let Ok(n) = socket.recv(&mut packet) {
                assert_eq!(n, length);
                firsts.push(packet[0]);
            }
            firsts
        };
        (received(data, DATA_PACKET_BYTES), received(position, POSITION_PACKET_BYTES))
    }

    #[test]
    fn packets_are_sent_to_their_ports_in_order() {
        let all = (vec![0, 2, 4, 6, 8], vec![1, 5, 9]);
        assert_eq!(sent(&["--speed", "max"]), all);
        assert_eq!(sent(&[]), all);
        assert_eq!(sent(&["--start", "0.0045", "--seconds", "0.004"]), (vec![6, 8], vec![5]));
    }

    #[test]
    fn invalid_arguments_and_damaged_captures_are_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = capture(folder.path());
        let text = path.to_str().expect("UTF-8");
        for words in [["--speed", "0"], ["--speed", "fast"], ["--to", "127.0.0.1"]] {
            assert!(Cli::<Args>::try_parse_from(["", text].into_iter().chain(words)).is_err(), "{words:?}");
        }
        for (option, value) in [("--images", "x"), ("--nmea", "127.0.0.1:9"), ("--imu", "127.0.0.1:9")] {
            let error = run(&Cli::parse_from(["", text, option, value]).args).expect_err("not a drive").to_string();
            assert!(error.starts_with(option) && error.contains("a.pcap has no"), "{error}");
        }
        let late = Cli::parse_from(["", text, "--start", "7"]);
        assert!(run(&late.args).expect_err("no packets").to_string().contains("no LiDAR packet"));
        let mut bytes = std::fs::read(&path).expect("reads");
        // The length of the second record.
        bytes[24 + 16 + 42 + 1206 + 8..][..4].fill(0xff);
        std::fs::write(&path, bytes).expect("writes");
        let damaged = Cli::parse_from(["", text, "--speed", "max"]);
        let error = run(&damaged.args).expect_err("is damaged").to_string();
        assert!(error.contains("a.pcap, byte 1288: record of 4294967295 bytes"), "{error}");
    }
}
