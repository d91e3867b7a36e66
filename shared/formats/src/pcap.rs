//! Packet captures: classic pcap (libpcap) and pcapng (IETF draft-ietf-opsawg-pcapng), as far as sensors need them.
//!
//! Read: both byte orders, microsecond and nanosecond stamps, UDP over IPv4 over Ethernet (with VLAN tags), Linux cooked,
//! loopback and raw IP. Everything else on the network is counted as foreign.
//! Written: classic pcap, microseconds, little-endian, as a sensor's broadcast looks on the wire. A capture can be read
//! while it is being written, see [`Recorder`].

mod blocks;
mod link;
mod reader;
mod recorder;
mod writer;

pub use reader::{PacketReader, ReadStats, UdpPacket};
pub use recorder::{Frontier, Recorder};
pub use writer::Writer;

use std::path::PathBuf;

/// Why a capture cannot be read on.
#[derive(Debug, thiserror::Error)]
pub enum PcapError {
    /// The operating system.
    #[error("{path}: {cause}", path = path.display())]
    Io {
        /// The capture.
        path: PathBuf,
        /// What it says. Not named `source`: the text holds it, and a chain of causes would say it twice.
        cause: std::io::Error,
    },
    /// Bytes that are no capture.
    #[error("{path}, byte {offset}: {rule}", path = path.display())]
    Damaged {
        /// The capture.
        path: PathBuf,
        /// Where.
        offset: u64,
        /// What was found and what must be there.
        rule: String,
    },
}
