//! `replica send`: the packets of a capture onto the network, at the pace at which they were captured.

use crate::terminal::StopFlag;
use anyhow::{Context, ensure};
use clap::Args as ClapArgs;
use formats::drive::Drive;
use formats::pcap::PacketReader;
use formats::velodyne::{DATA_PACKET_BYTES, POSITION_PACKET_BYTES, POSITION_PORT};
use stage::exit;
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::{Duration, Instant};

/// Ctrl-C is heard within this time.
const NAP: Duration = Duration::from_millis(100);

/// Sends data packets (1206 bytes) and position packets (512 bytes); others are left out and counted.
#[derive(ClapArgs, Debug)]
pub struct Args {
    /// Capture (pcap or pcapng) of a Velodyne, or a drive folder, whose captures are one stream
    capture: PathBuf,
    /// Host and port for the data packets
    #[arg(long, default_value = "127.0.0.1:2368", value_parser = address)]
    to: SocketAddr,
    /// Port for the position packets, at the same host
    #[arg(long, default_value_t = POSITION_PORT)]
    position_port: u16,
    /// Times the pace of the recording, above 0, or max: as fast as they can be sent
    #[arg(long, default_value = "1.0")]
    speed: Speed,
    /// Begin anew at the end, until Ctrl-C; the sensor's clock then jumps back
    #[arg(long = "loop")]
    again: bool,
    /// Leave out what was captured earlier, s after the first packet
    #[arg(long, default_value_t = 0.0)]
    start: f64,
    /// Length of the part that is sent, s of the recording [default: to the end]
    #[arg(long)]
    seconds: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Speed {
    Times(f64),
    Max,
}

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "max" {
            return Ok(Speed::Max);
        }
        let times = text.parse().ok().filter(|times| (1e-3..=1e3).contains(times));
        times.map(Speed::Times).ok_or_else(|| "must be 0.001 to 1000, or max".to_owned())
    }
}

fn address(text: &str) -> Result<SocketAddr, String> {
    let mut found = text.to_socket_addrs().map_err(|error| format!("{error}; must be a host and a port"))?;
    found.find(SocketAddr::is_ipv4).ok_or_else(|| "has no IPv4 address".to_owned())
}

/// What went out.
#[derive(Debug, Default)]
struct Sent {
    n_data: u64,
    n_position: u64,
    n_bytes: u64,
    n_left_out: u64,
    latest: Duration,
}

/// Sends until the end of the capture or Ctrl-C, and says what was sent.
pub fn run(args: &Args) -> anyhow::Result<()> {
    ensure!(args.start >= 0.0 && args.start.is_finite(), "--start is {}, must be 0 or more", args.start);
    ensure!(
        args.seconds.is_none_or(|s| s > 0.0),
        "--seconds is {:?}, must be above 0",
        args.seconds.unwrap_or_default()
    );
    let files = captures(&args.capture)?;
    let stop = StopFlag::register(exit::DONE).context("signals")?;
    let socket = UdpSocket::bind("0.0.0.0:0").context("no socket")?;
    socket.set_broadcast(true).context("no broadcasts")?;
    let begin = Instant::now();
    let mut player = Player { args, socket, stop, begin, played: Duration::ZERO, sent: Sent::default() };
    let played = player.play_all(&files);
    player.report();
    played
}

/// The capture itself, or those of the drive.
fn captures(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let drive = Drive::open(path)?;
    let format = &drive.manifest().lidar.format;
    ensure!(format == "pcap", "{}: its sweeps are {format} files; only packets can be sent", path.display());
    Ok(drive.sweep_files().to_vec())
}

struct Player<'a> {
    args: &'a Args,
    socket: UdpSocket,
    stop: StopFlag,
    begin: Instant,
    /// Recording time of the earlier rounds of the loop.
    played: Duration,
    sent: Sent,
}

impl Player<'_> {
    fn play_all(&mut self, files: &[PathBuf]) -> anyhow::Result<()> {
        loop {
            let before = self.sent.n_data + self.sent.n_position;
            self.play_round(files)?;
            let n_sent = self.sent.n_data + self.sent.n_position - before;
            let path = self.args.capture.display();
            ensure!(n_sent > 0 || self.is_stopped(), "{path}: no packet of a Velodyne in the part to be sent");
            if !self.args.again || self.is_stopped() {
                return Ok(());
            }
        }
    }

    fn play_round(&mut self, files: &[PathBuf]) -> anyhow::Result<()> {
        let mut first = None;
        let mut at = Duration::ZERO;
        let mut last_gap = Duration::ZERO;
        'files: for path in files {
            let mut reader = PacketReader::open(path)?;
            while let Some(packet) = reader.next()? {
                if self.is_stopped() {
                    break 'files;
                }
                let since = packet.stamp.seconds_since(*first.get_or_insert(packet.stamp)) - self.args.start;
                if since < 0.0 {
                    continue;
                }
                if self.args.seconds.is_some_and(|seconds| since >= seconds) {
                    break 'files;
                }
                let port = match packet.payload.len() {
                    DATA_PACKET_BYTES if !packet.is_cut => self.args.to.port(),
                    POSITION_PACKET_BYTES if !packet.is_cut => self.args.position_port,
                    _ => {
                        self.sent.n_left_out += 1;
                        continue;
                    }
                };
                // Where the capture's clock was set back, nobody waits.
                let due = Duration::try_from_secs_f64(since).unwrap_or_default().max(at);
                (last_gap, at) = (due.saturating_sub(at), due);
                if !self.wait_for(at) {
                    break 'files;
                }
                self.send(port, packet.payload)?;
            }
            let stats = reader.stats();
            self.sent.n_left_out += stats.foreign_frames;
            if stats.cut_records > 0 {
                eprintln!("warning: {}: ends within a packet, which is left out", path.display());
            }
        }
        self.played += at + last_gap;
        Ok(())
    }

    /// Sleeps until a moment of this round is due, by a schedule that does not depend on how late the ones before it were.
    /// `false`: stopped.
    fn wait_for(&mut self, at: Duration) -> bool {
        let Speed::Times(times) = self.args.speed else { return !self.is_stopped() };
        let due = self.begin + (self.played + at).div_f64(times);
        loop {
            let left = due.saturating_duration_since(Instant::now());
            if self.is_stopped() || left.is_zero() {
                break;
            }
            std::thread::sleep(left.min(NAP));
        }
        self.sent.latest = self.sent.latest.max(due.elapsed());
        !self.is_stopped()
    }

    fn send(&mut self, port: u16, payload: &[u8]) -> anyhow::Result<()> {
        let target = SocketAddr::new(self.args.to.ip(), port);
        self.socket.send_to(payload, target).with_context(|| format!("{target}: cannot be sent to"))?;
        let is_data = payload.len() == DATA_PACKET_BYTES;
        *(if is_data { &mut self.sent.n_data } else { &mut self.sent.n_position }) += 1;
        self.sent.n_bytes += payload.len() as u64;
        Ok(())
    }

    fn is_stopped(&self) -> bool {
        self.stop.is_set()
    }

    fn report(&self) {
        let Sent { n_data, n_position, n_bytes, n_left_out, latest } = self.sent;
        let seconds = self.begin.elapsed().as_secs_f64();
        let n_packets = n_data + n_position;
        println!(
            "sent {n_packets} packets ({n_data} data, {n_position} position), {n_bytes} bytes in {seconds:.3} s, {:.0} packets/s",
            n_packets as f64 / seconds.max(1e-9)
        );
        if self.args.speed != Speed::Max {
            println!("the latest left {:.3} ms late", latest.as_secs_f64() * 1e3);
        }
        if n_left_out > 0 {
            println!("left out {n_left_out} packets of others");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use formats::pcap::Writer;
    use geometry::Stamp;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        args: Args,
    }

    /// Payload lengths and first bytes of ten packets, 1 ms apart, the sixth of somebody else.
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
        let (to, port) = (address(&data).to_string(), address(&position).port().to_string());
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
    fn packets_go_to_their_ports_in_their_order() {
        let all = (vec![0, 2, 4, 6, 8], vec![1, 5, 9]);
        assert_eq!(sent(&["--speed", "max"]), all);
        assert_eq!(sent(&[]), all);
        assert_eq!(sent(&["--start", "0.0045", "--seconds", "0.004"]), (vec![6, 8], vec![5]));
    }

    #[test]
    fn what_cannot_be_sent_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = capture(folder.path());
        let text = path.to_str().expect("UTF-8");
        for words in [["--speed", "0"], ["--speed", "fast"], ["--to", "127.0.0.1"]] {
            assert!(Cli::try_parse_from(["", text].into_iter().chain(words)).is_err(), "{words:?}");
        }
        let late = Cli::parse_from(["", text, "--start", "7"]);
        assert!(run(&late.args).expect_err("nothing there").to_string().contains("no packet of a Velodyne"));
        let mut bytes = std::fs::read(&path).expect("reads");
        // The length of the second record.
        bytes[24 + 16 + 42 + 1206 + 8..][..4].fill(0xff);
        std::fs::write(&path, bytes).expect("writes");
        let damaged = Cli::parse_from(["", text, "--speed", "max"]);
        let error = run(&damaged.args).expect_err("is damaged").to_string();
        assert!(error.contains("a.pcap, byte 1288: record of 4294967295 bytes"), "{error}");
    }
}
