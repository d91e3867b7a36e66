//! The packets of the captures of a drive: their times, without decoding them.

use drive::Drive;
use geometry::Stamp;
use lidar::ClockReference;
use lidar::nmea::{Fix, FixJoiner, LogStats, Sentence, parse};
use lidar::pcap::{PacketReader, PcapError, UdpPacket, last_stamp};
use lidar::velodyne::PositionPacket;
use std::collections::BTreeMap;
use std::net::SocketAddrV4;
use std::path::Path;

/// Bytes that are read of all captures together, unless all are: a minute and a half of an HDL-32E.
const QUICK_BYTES: u64 = 256 << 20;
/// Senders of data packets that are distinguished.
const MAX_SENDERS: usize = 16;

/// Result of the survey of the packets.
#[derive(Default)]
pub struct PacketSurvey {
    /// Capture times of the data packets of the sensor that sends most, ns.
    pub stamps: Vec<i64>,
    /// Capture time of the last packet, if not all packets were read.
    pub end: Option<i64>,
    /// Bytes that were not read.
    pub n_bytes_unread: u64,
    /// Packets of other senders and protocols.
    pub n_foreign: u64,
    /// Capture clock minus GNSS time, s, where a receiver at the sensor sent both.
    pub capture_ahead_s: Option<f64>,
    /// Packets by the reference of the LiDAR's clock that they report.
    pub clock_references: BTreeMap<ClockReference, u64>,
    /// Fixes in the position packets that were read.
    pub fixes: Vec<Fix>,
    pub log: LogStats,
    /// Size of the captures.
    pub n_bytes: u64,
    /// Errors of captures.
    pub damage: Vec<String>,
}

/// Reads the times of the packets of all captures, or of the start of the captures.
pub fn survey(drive: &Drive, is_full: bool) -> anyhow::Result<PacketSurvey> {
    let mut walk = Walk { found: PacketSurvey::default(), ..Walk::default() };
    let mut left = if is_full { u64::MAX } else { QUICK_BYTES };
    for file in drive.sweep_files() {
        let size = file.metadata().map_or(0, |metadata| metadata.len());
        walk.found.n_bytes += size;
        let n_read = if left == 0 { 0 } else { walk.read(drive, file, left)? };
        left = left.saturating_sub(n_read);
        if n_read < size && left == 0 {
            walk.found.n_bytes_unread += size - n_read;
            walk.found.end = last_stamp(file)?.map(|stamp| stamp.0).or(walk.found.end);
        }
    }
    Ok(walk.finish())
}

#[derive(Default)]
struct Walk {
    found: PacketSurvey,
    senders: BTreeMap<SocketAddrV4, Vec<i64>>,
    joiner: FixJoiner,
    /// The last two sentences: a sensor repeats them 200 times per second.
    recent: [String; 2],
    /// Capture clock minus GNSS time, ns.
    ahead: Vec<i64>,
}

impl Walk {
    /// Reads a capture up to `limit` bytes. Returns how many were read: all, if the file ends or is damaged before.
    fn read(&mut self, drive: &Drive, file: &Path, limit: u64) -> anyhow::Result<u64> {
        let mut reader = match PacketReader::open(file) {
            Ok(reader) => reader,
            Err(error @ PcapError::Io { .. }) => return Err(error.into()),
            Err(error) => {
                self.found.damage.push(error.to_string());
                return Ok(0);
            }
        };
        let mut n_read = u64::MAX;
        loop {
            match reader.next() {
                Ok(None) => break,
                Ok(Some(packet)) if packet.offset >= limit => {
                    n_read = limit;
                    break;
                }
                Ok(Some(packet)) => self.take(drive, &packet),
                Err(error) => {
                    self.found.damage.push(error.to_string());
                    break;
                }
            }
        }
        let stats = reader.stats();
        self.found.n_foreign += stats.foreign_frames;
        if stats.cut_records > 0 {
            let end = stats.whole_bytes;
            self.found.damage.push(format!("{}: ends inside the packet at byte {end}", file.display()));
        }
        Ok(n_read)
    }

    fn take(&mut self, drive: &Drive, packet: &UdpPacket<'_>) {
        if let Some(reference) = drive.lidar().clock_reference(packet.payload) {
            *self.found.clock_references.entry(reference).or_default() += 1;
        }
        let is_known = self.senders.len() < MAX_SENDERS || self.senders.contains_key(&packet.source);
        if let Some(position) = PositionPacket::new(packet.payload) {
            self.take_sentence(position.nmea, packet.stamp);
        } else if drive.lidar().may_have_sent(packet.payload) && is_known {
            self.senders.entry(packet.source).or_default().push(packet.stamp.0);
        } else {
            self.found.n_foreign += 1;
        }
    }

    fn take_sentence(&mut self, nmea: &str, captured: Stamp) {
        if nmea.is_empty() || self.recent.iter().any(|text| text == nmea) {
            return;
        }
        if let Ok(Sentence::Rmc(rmc)) = parse(nmea)
            && let Some(stamp) = rmc.stamp.filter(|_| rmc.is_valid)
        {
            self.ahead.push(captured.0.saturating_sub(stamp.0));
        }
        self.found.fixes.extend(self.joiner.take(nmea.as_bytes()));
        self.recent.swap(0, 1);
        nmea.clone_into(&mut self.recent[0]);
    }

    fn finish(mut self) -> PacketSurvey {
        let mut found = self.found;
        found.fixes.extend(self.joiner.finish());
        found.log = self.joiner.stats();
        // Of several senders with equal numbers the first address.
        let most = self.senders.keys().rev().max_by_key(|sender| self.senders[*sender].len()).copied();
        found.stamps = most.and_then(|most| self.senders.remove(&most)).unwrap_or_default();
        found.n_foreign += self.senders.values().map(|stamps| stamps.len() as u64).sum::<u64>();
        self.ahead.sort_unstable();
        found.capture_ahead_s = self.ahead.get(self.ahead.len() / 2).map(|nanos| *nanos as f64 * 1e-9);
        found
    }
}
