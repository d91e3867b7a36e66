//! Extracts UDP payloads from captured frames.

use std::net::{Ipv4Addr, SocketAddrV4};

/// A UDP packet inside a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Datagram<'a> {
    pub(super) source: SocketAddrV4,
    pub(super) port: u16,
    pub(super) payload: &'a [u8],
    /// Whether the capture contains only a part of the payload.
    pub(super) is_cut: bool,
}

/// A part of an IP packet that was sent in fragments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Fragment<'a> {
    /// Addresses of sender and receiver, and number of the packet.
    pub(super) key: ([u8; 8], u16),
    /// Position of its first byte.
    pub(super) at: usize,
    pub(super) bytes: &'a [u8],
    pub(super) is_last: bool,
}

impl Fragment<'_> {
    /// Addresses of sender and receiver.
    pub(super) fn addresses(&self) -> [u8; 8] {
        self.key.0
    }
}

/// UDP content of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Udp<'a> {
    Whole(Datagram<'a>),
    Fragment(Fragment<'a>),
}

/// The UDP packet of a frame, or its fragment. `None` for other protocols and for fragments that the capture cut.
pub(super) fn udp(link: u32, frame: &[u8]) -> Option<Udp<'_>> {
    let packet = ip_packet(link, frame)?;
    let header_len = usize::from(packet.first()? & 0x0f) * 4;
    let is_ipv4 = packet[0] >> 4 == 4 && header_len >= 20;
    let total = usize::from(u16_at(packet, 2)?);
    if !is_ipv4 || *packet.get(9)? != 17 {
        return None;
    }
    // Short frames are padded on the wire, so the length in the IP header is used.
    let bytes = packet.get(header_len..total.min(packet.len()))?;
    let addresses: &[u8; 8] = packet.get(12..)?.first_chunk()?;
    let flags = u16_at(packet, 6)?;
    let number = u16_at(packet, 4)?;
    // Neither "more fragments" nor an offset.
    if flags & 0x3fff == 0 {
        return datagram(*addresses, bytes).map(Udp::Whole);
    }
    let key = (*addresses, number);
    let is_last = flags & 0x2000 == 0;
    let fragment = Fragment { key, at: usize::from(flags & 0x1fff) * 8, bytes, is_last };
    // The length of every fragment but the last is a multiple of eight bytes.
    (total <= packet.len() && !bytes.is_empty() && (is_last || bytes.len().is_multiple_of(8)))
        .then_some(Udp::Fragment(fragment))
}

/// The UDP packet in the content of an IP packet. `addresses` belong to sender and receiver.
pub(super) fn datagram(addresses: [u8; 8], udp: &[u8]) -> Option<Datagram<'_>> {
    let length = usize::from(u16_at(udp, 4)?);
    let payload = udp.get(8..length.min(udp.len()))?;
    let [a, b, c, d, ..] = addresses;
    let source = SocketAddrV4::new(Ipv4Addr::new(a, b, c, d), u16_at(udp, 0)?);
    let port = u16_at(udp, 2)?;
    Some(Datagram { source, port, payload, is_cut: length > udp.len() })
}

/// Removes the header of the link layer (`https://www.tcpdump.org/linktypes.html`).
fn ip_packet(link: u32, frame: &[u8]) -> Option<&[u8]> {
    match link {
        // Ethernet, with up to two VLAN tags.
        1 => {
            let mut at = 12;
            while matches!(u16_at(frame, at)?, 0x8100 | 0x88a8) && at < 20 {
                at += 4;
            }
            (u16_at(frame, at)? == 0x0800).then(|| frame.get(at + 2..)).flatten()
        }
        // BSD loopback: address family in the byte order of the machine, 2 = IPv4.
        0 | 108 => matches!(frame.get(..4)?, [2, 0, 0, 0] | [0, 0, 0, 2]).then(|| &frame[4..]),
        // Raw IP.
        12 | 14 | 101 | 228 => Some(frame),
        // Linux cooked, versions 1 and 2.
        113 => (u16_at(frame, 14)? == 0x0800).then(|| frame.get(16..)).flatten(),
        276 => (u16_at(frame, 0)? == 0x0800).then(|| frame.get(20..)).flatten(),
        _ => None,
    }
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().map(|pair| u16::from_be_bytes(*pair))
}
