//! Extracts UDP payloads from captured frames.

use std::net::{Ipv4Addr, SocketAddrV4};

/// Number of UDP among the protocols of IP.
const UDP: u8 = 17;
/// Number of the header of a fragment.
const IPV6_FRAGMENT: u8 = 44;
/// Length of the fixed header, bytes.
const IPV6_HEADER: usize = 40;

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
    match packet.first()? >> 4 {
        4 => udp_of_ipv4(packet),
        6 => udp_of_ipv6(packet),
        _ => None,
    }
}

fn udp_of_ipv4(packet: &[u8]) -> Option<Udp<'_>> {
    let header_len = usize::from(packet.first()? & 0x0f) * 4;
    let total = usize::from(u16_at(packet, 2)?);
    if header_len < 20 || *packet.get(9)? != UDP {
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
    fragment_of_whole_frame(fragment, total <= packet.len())
}

fn udp_of_ipv6(packet: &[u8]) -> Option<Udp<'_>> {
    let end = IPV6_HEADER + usize::from(u16_at(packet, 4)?);
    let [sender, receiver] = [8, 24].map(|at| packet.get(at..).and_then(|bytes| bytes.first_chunk::<16>()));
    let [a, b] = [short_address(sender?), short_address(receiver?)];
    let addresses = [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]];
    let mut next = *packet.get(6)?;
    let mut at = IPV6_HEADER;
    // Options that a packet may have in front of its content: hop by hop, routing, destination.
    while matches!(next, 0 | 43 | 60) {
        next = *packet.get(at)?;
        at += 8 + 8 * usize::from(*packet.get(at + 1)?);
    }
    if next == UDP {
        return datagram(addresses, packet.get(at..end.min(packet.len()))?).map(Udp::Whole);
    }
    if next != IPV6_FRAGMENT || *packet.get(at)? != UDP {
        return None;
    }
    let place = u16_at(packet, at + 2)?;
    let number = u16_at(packet, at + 4)? ^ u16_at(packet, at + 6)?;
    let bytes = packet.get(at + 8..end.min(packet.len()))?;
    let fragment =
        Fragment { key: (addresses, number), at: usize::from(place & 0xfff8), bytes, is_last: place & 1 == 0 };
    fragment_of_whole_frame(fragment, end <= packet.len())
}

/// The length of every fragment but the last is a multiple of eight bytes.
fn fragment_of_whole_frame(fragment: Fragment<'_>, is_whole: bool) -> Option<Udp<'_>> {
    let is_valid =
        is_whole && !fragment.bytes.is_empty() && (fragment.is_last || fragment.bytes.len().is_multiple_of(8));
    is_valid.then_some(Udp::Fragment(fragment))
}

/// An address of 240.0.0.0/4, which no sender of IPv4 has, to distinguish the senders of IPv6.
fn short_address(address: &[u8; 16]) -> [u8; 4] {
    let hash = address.iter().fold(0x811c_9dc5_u32, |hash, byte| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193));
    (hash | 0xf000_0000).to_be_bytes()
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
    match content(link, frame)? {
        Content::Ip(packet) => Some(packet),
        Content::Other(_) | Content::UnknownLink => None,
    }
}

/// Content of a frame.
enum Content<'a> {
    Ip(&'a [u8]),
    /// Another protocol, by its `EtherType`.
    Other(u16),
    /// The link type is not read.
    UnknownLink,
}

fn content(link: u32, frame: &[u8]) -> Option<Content<'_>> {
    match link {
        // Ethernet.
        1 => behind_tags(frame, 12, 14),
        // BSD loopback: address family in the byte order of the machine, 2 = IPv4; 24, 28 and 30 = IPv6.
        0 | 108 => {
            let is_ip = matches!(frame.get(..4)?, [2 | 24 | 28 | 30, 0, 0, 0] | [0, 0, 0, 2 | 24 | 28 | 30]);
            Some(if is_ip { Content::Ip(&frame[4..]) } else { Content::Other(0) })
        }
        // Raw IP.
        12 | 14 | 101 | 228 | 229 => Some(Content::Ip(frame)),
        // Linux cooked, versions 1 and 2.
        113 => behind_tags(frame, 14, 16),
        276 => behind_tags(frame, 0, 20),
        _ => Some(Content::UnknownLink),
    }
}

/// The content of a frame with its `EtherType` at `type_at`, behind VLAN tags (802.1Q, 802.1ad and their predecessors) and `PPPoE`. A tag
/// has its number and the next `EtherType`.
fn behind_tags(frame: &[u8], type_at: usize, mut at: usize) -> Option<Content<'_>> {
    let mut kind = u16_at(frame, type_at)?;
    while matches!(kind, 0x8100 | 0x88a8 | 0x9100 | 0x9200) {
        kind = u16_at(frame, at + 2)?;
        at += 4;
    }
    // A session of `PPPoE`: six bytes of header, then the protocol of PPP.
    if kind == 0x8864 && matches!(u16_at(frame, at + 6)?, 0x0021 | 0x0057) {
        return frame.get(at + 8..).map(Content::Ip);
    }
    if matches!(kind, 0x0800 | 0x86dd) { frame.get(at..).map(Content::Ip) } else { Some(Content::Other(kind)) }
}

/// Description of a frame that is not UDP over IP, with the next step if it can be converted.
pub(super) fn description(link: u32, frame: &[u8]) -> String {
    match content(link, frame) {
        None => "are too short for their link type".to_owned(),
        Some(Content::UnknownLink) => {
            let hint = match frame.first().map(|byte| byte >> 4) {
                Some(4 | 6) => "; they begin as IP packets: `editcap -T rawip IN OUT` states that",
                _ => "",
            };
            format!("have link type {link}, not Ethernet, Linux cooked, loopback or raw IP{hint}")
        }
        Some(Content::Other(kind)) => format!("have EtherType {kind:#06x}, not IPv4 or IPv6"),
        Some(Content::Ip(packet)) => {
            let protocol = match packet.first().map(|byte| byte >> 4) {
                Some(4) => packet.get(9),
                Some(6) => packet.get(6),
                _ => None,
            };
            match protocol {
                Some(&UDP) => "are damaged or cut UDP packets".to_owned(),
                Some(protocol) => format!("have IP protocol {protocol}, not UDP (17)"),
                None => "are not IP packets".to_owned(),
            }
        }
    }
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    bytes.get(at..)?.first_chunk().map(|pair| u16::from_be_bytes(*pair))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn udp_bytes() -> Vec<u8> {
        [&2368_u16.to_be_bytes()[..], &2369_u16.to_be_bytes(), &12_u16.to_be_bytes(), &[0, 0], b"data"].concat()
    }

    fn ipv4() -> Vec<u8> {
        let udp = udp_bytes();
        let mut packet = vec![0x45, 0, 0, 20 + udp.len() as u8, 0, 1, 0, 0, 64, 17, 0, 0];
        packet.extend([192, 168, 1, 201, 255, 255, 255, 255]);
        packet.extend(udp);
        packet
    }

    /// An IPv6 packet with these headers and bytes behind the first header, which names the `next` one.
    fn ipv6(next: u8, bytes: &[u8]) -> Vec<u8> {
        let mut packet = vec![0x60, 0, 0, 0, 0, bytes.len() as u8, next, 64];
        packet.extend([0xfe; 16]);
        packet.extend([0xff; 16]);
        packet.extend(bytes);
        packet
    }

    fn assert_found(link: u32, frame: &[u8]) -> SocketAddrV4 {
        let Some(Udp::Whole(found)) = udp(link, frame) else { panic!("link {link}: {frame:02x?} has no packet") };
        assert_eq!((found.source.port(), found.port, found.payload, found.is_cut), (2368, 2369, &b"data"[..], false));
        found.source
    }

    /// A frame with these types behind each other, the last one of the content.
    fn tagged(types: &[u16], content: &[u8], link: u32) -> Vec<u8> {
        let tags = types[1..].iter().flat_map(|next| [[0, 5], next.to_be_bytes()]).flatten();
        let first = types[0].to_be_bytes();
        let head: Vec<u8> = match link {
            1 => [&[0xff; 12][..], &first].concat(),
            113 => [&[0, 3, 0, 1, 0, 6, 1, 2, 3, 4, 5, 6, 0, 0][..], &first].concat(),
            _ => [&first[..], &[0; 18]].concat(),
        };
        head.into_iter().chain(tags).chain(content.iter().copied()).collect()
    }

    #[test]
    fn packets_are_found_behind_any_tags_in_ethernet_and_cooked_frames() {
        for link in [1, 113, 276] {
            for tags in [&[][..], &[0x8100], &[0x88a8, 0x8100], &[0x9100, 0x8100], &[0x88a8, 0x8100, 0x8100], &[0x9200]]
            {
                let types = |content: u16| [tags, &[content]].concat();
                let source = assert_found(link, &tagged(&types(0x0800), &ipv4(), link));
                assert_eq!(source.ip(), &Ipv4Addr::new(192, 168, 1, 201));
                assert_found(link, &tagged(&types(0x86dd), &ipv6(17, &udp_bytes()), link));
            }
            let pppoe = [&[0x11, 0, 0, 1, 0, 34, 0, 0x21][..], &ipv4()].concat();
            assert_found(link, &tagged(&[0x8864], &pppoe, link));
        }
        assert_found(101, &ipv6(17, &udp_bytes()));
        assert_found(0, &[&[30, 0, 0, 0][..], &ipv6(17, &udp_bytes())].concat());
    }

    #[test]
    fn options_and_fragments_of_ipv6_are_read() {
        let source = assert_found(
            101,
            &ipv6(0, &[&[60, 0, 1, 4, 0, 0, 0, 0, 17, 0, 1, 4, 0, 0, 0, 0][..], &udp_bytes()].concat()),
        );
        assert!(source.ip().octets()[0] >= 240, "{source}");
        let [first, last] = [(0..8, 1), (8..12, 8)].map(|(part, place)| {
            let fragment = [&[17, 0, 0, place, 0, 0, 0, 9][..], &udp_bytes()[part]].concat();
            ipv6(44, &fragment)
        });
        let fragment = |frame| match udp(101, frame) {
            Some(Udp::Fragment(Fragment { key, at, bytes, is_last })) => (key, at, bytes.to_vec(), is_last),
            other => panic!("{other:?}"),
        };
        let [first, last] = [fragment(&first), fragment(&last)];
        assert_eq!(first.0, last.0);
        assert_eq!((first.1, first.3, last.1, last.3), (0, false, 8, true));
        assert_eq!([first.2, last.2].concat(), udp_bytes());
    }

    #[test]
    fn other_frames_are_described() {
        let tcp: Vec<u8> = ipv4().iter().enumerate().map(|(at, byte)| if at == 9 { 6 } else { *byte }).collect();
        for (link, frame, text) in [
            (
                147,
                ipv4(),
                "have link type 147, not Ethernet, Linux cooked, loopback or raw IP; they begin as IP packets",
            ),
            (1, tagged(&[0x8100, 0x0806], &[0; 40], 1), "have EtherType 0x0806"),
            (101, tcp, "have IP protocol 6, not UDP"),
            (1, vec![0; 5], "are too short"),
        ] {
            assert!(udp(link, &frame).is_none());
            assert!(description(link, &frame).starts_with(text), "{}", description(link, &frame));
        }
    }
}
