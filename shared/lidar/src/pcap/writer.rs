//! Writing captures.

use geometry::Stamp;
use std::io::{self, Write};
use std::net::{Ipv4Addr, SocketAddrV4};

/// Bytes of the headers: Ethernet, IPv4 without options and UDP.
const HEADERS: usize = 14 + 20 + 8;
/// Default address of Velodyne sensors.
const SENSOR: Ipv4Addr = Ipv4Addr::new(192, 168, 1, 201);

/// Writes UDP packets in the form in which a sensor broadcasts them.
///
/// ```
/// use lidar::pcap::Writer;
/// use geometry::Stamp;
/// let mut bytes = Vec::new();
/// let mut writer = Writer::new(&mut bytes)?;
/// writer.write_udp(Stamp(1_600_000_000_000_000_000), 2368, &[0; 1206])?;
/// assert_eq!(bytes.len(), 24 + 16 + 42 + 1206);
/// # std::io::Result::Ok(())
/// ```
#[derive(Debug)]
pub struct Writer<W: Write> {
    pub(super) out: W,
}

impl<W: Write> Writer<W> {
    /// Writes the file header. `out` should be buffered.
    pub fn new(mut out: W) -> io::Result<Self> {
        let mut header = [0; 24];
        header[..4].copy_from_slice(&0xa1b2_c3d4_u32.to_le_bytes());
        header[4..6].copy_from_slice(&2_u16.to_le_bytes());
        header[6..8].copy_from_slice(&4_u16.to_le_bytes());
        header[16..20].copy_from_slice(&65_535_u32.to_le_bytes());
        header[20] = 1; // Ethernet
        out.write_all(&header)?;
        Ok(Self { out })
    }

    /// Appends a packet, captured at `stamp` (1970 to 2106, truncated to µs), that a sensor broadcasts from and to `port`.
    pub fn write_udp(&mut self, stamp: Stamp, port: u16, payload: &[u8]) -> io::Result<()> {
        let source = SocketAddrV4::new(SENSOR, port);
        let target = SocketAddrV4::new(Ipv4Addr::BROADCAST, port);
        self.write_datagram(stamp, source, target, payload)
    }

    /// Appends a packet with its addresses, captured at `stamp` (1970 to 2106, truncated to µs).
    pub fn write_datagram(
        &mut self,
        stamp: Stamp,
        source: SocketAddrV4,
        target: SocketAddrV4,
        payload: &[u8],
    ) -> io::Result<()> {
        let out_of_range = |what: &str| io::Error::new(io::ErrorKind::InvalidInput, what.to_owned());
        let seconds = u32::try_from(stamp.0.div_euclid(1_000_000_000))
            .map_err(|_| out_of_range(&format!("stamp {stamp} does not fit a capture's 32-bit seconds")))?;
        let length = u16::try_from(payload.len() + 28)
            .map_err(|_| out_of_range(&format!("payload of {} bytes does not fit a UDP packet", payload.len())))?;
        let micros = stamp.0.rem_euclid(1_000_000_000) as u32 / 1000;
        let captured = (HEADERS + payload.len()) as u32;
        for word in [seconds, micros, captured, captured] {
            self.out.write_all(&word.to_le_bytes())?;
        }
        self.out.write_all(&headers(length, source, target))?;
        self.out.write_all(payload)
    }

    /// Flushes and returns `out`.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}

/// Ethernet, IP and UDP headers. `length` is the length of the IP packet.
fn headers(length: u16, source: SocketAddrV4, target: SocketAddrV4) -> [u8; HEADERS] {
    let mut bytes = [0; HEADERS];
    bytes[..6].fill(0xff);
    bytes[6..12].copy_from_slice(&[0x60, 0x76, 0x88, 0, 0, 0]);
    bytes[12..14].copy_from_slice(&[0x08, 0x00]);
    let ip = &mut bytes[14..34];
    ip[0] = 0x45;
    ip[2..4].copy_from_slice(&length.to_be_bytes());
    ip[6] = 0x40; // may not be fragmented
    ip[8] = 0xff;
    ip[9] = 17; // UDP
    ip[12..16].copy_from_slice(&source.ip().octets());
    ip[16..20].copy_from_slice(&target.ip().octets());
    let sum = ip_checksum(ip);
    ip[10..12].copy_from_slice(&sum.to_be_bytes());
    let udp = &mut bytes[34..42];
    udp[..2].copy_from_slice(&source.port().to_be_bytes());
    udp[2..4].copy_from_slice(&target.port().to_be_bytes());
    udp[4..6].copy_from_slice(&(length - 20).to_be_bytes());
    // A UDP checksum of 0 means "none"; the sensors send 0.
    bytes
}

/// Header checksum (RFC 791); 0 for a header with a correct checksum.
pub(super) fn ip_checksum(header: &[u8]) -> u16 {
    let sum: u32 = header.chunks_exact(2).map(|pair| u32::from(u16::from_be_bytes([pair[0], pair[1]]))).sum();
    let folded = (sum & 0xffff) + (sum >> 16);
    !(((folded & 0xffff) + (folded >> 16)) as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_those_of_a_udp_broadcast() {
        let mut bytes = Vec::new();
        Writer::new(&mut bytes).expect("writes").write_udp(Stamp(5_000_123_456_789), 8308, b"abc").expect("writes");
        let (record, frame) = bytes[24..].split_at(16);
        assert_eq!(record, [0x88, 0x13, 0, 0, 0x40, 0xe2, 1, 0, 45, 0, 0, 0, 45, 0, 0, 0]);
        assert_eq!(frame.len(), 45);
        assert_eq!(ip_checksum(&frame[14..34]), 0);
        assert_eq!(frame[34..42], [0x20, 0x74, 0x20, 0x74, 0, 11, 0, 0]);
    }

    #[test]
    fn out_of_range_stamp_or_payload_is_refused() {
        let mut writer = Writer::new(Vec::new()).expect("writes");
        assert!(writer.write_udp(Stamp(-1), 1, b"").is_err());
        assert!(writer.write_udp(Stamp(0), 1, &vec![0; 65_536]).is_err());
        assert_eq!(writer.finish().expect("flushes").len(), 24);
    }
}
