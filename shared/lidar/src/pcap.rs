//! Packet captures: classic pcap (libpcap) and pcapng (IETF draft-ietf-opsawg-pcapng), limited to what sensors send.
//!
//! Read: both byte orders, microsecond and nanosecond stamps, UDP over IPv4 and IPv6 over Ethernet and Linux cooked (with VLAN tags and `PPPoE`), loopback
//! and raw IP, whole or in fragments. Other packets are counted as foreign. Senders of IPv6 get addresses of 240.0.0.0/4.
//! Written: classic pcap, microseconds, little-endian, with the headers of a sensor broadcast. A capture can be read while it is
//! being written, see [`Recorder`].
//!
//! No existing crate is used: reading resumes at a saved byte offset after a crash and follows a file that is still being
//! written. Existing crates do neither.

mod blocks;
mod compressed;
mod damage;
mod fragments;
mod link;
mod order;
mod reader;
mod recorder;
mod tail;
mod unread;
mod writer;

pub use compressed::Compression;
pub use damage::Damage;
pub use order::{has_capture_magic, is_capture_name, sort_by_time};
pub use reader::{PacketReader, ReadStats, UdpPacket};
pub use recorder::{Frontier, Recorder};
pub use tail::last_stamp;
pub(crate) use unread::unread_frames;
pub use writer::Writer;

use std::path::PathBuf;

/// Error of a capture that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PcapError {
    /// The operating system reported an error.
    #[error("{path}: {cause}", path = path.display())]
    Io {
        /// The capture.
        path: PathBuf,
        /// Error of the operating system. Not named `source`, because the message contains it already.
        cause: std::io::Error,
    },
    /// The capture is damaged.
    #[error("{path}, byte {offset}: {damage}", path = path.display())]
    Damaged {
        /// The capture.
        path: PathBuf,
        /// Offset of the damage.
        offset: u64,
        /// The value found and the value expected.
        damage: Damage,
    },
}
