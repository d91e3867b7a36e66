//! Kinds of damage of a capture.

use super::blocks::{MAX_FRAME, MAX_INTERFACES};
use super::compressed::Compression;

/// Damage of a capture: the value found and the value expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Damage {
    /// The file is too short for any capture.
    #[error("the file is shorter than the header of a capture")]
    NoHeader,
    /// The header of a pcap file is cut.
    #[error("the file ends inside the header")]
    CutHeader,
    /// The file is compressed.
    #[error("the file {0}")]
    Compressed(Compression),
    /// The variant of pcap is not read.
    #[error("magic number {0:08x}: a variant of pcap with longer records; convert it with `editcap -F pcap IN OUT`")]
    Variant(u32),
    /// The file is not a capture.
    #[error("magic number {0:08x} is neither pcap nor pcapng")]
    Magic(u32),
    /// A record of pcap is too long, or its time is impossible.
    #[error(
        "record of {captured} bytes ({wire} on the wire) at {seconds} s and {fraction_nanos} ns; expected at most {MAX_FRAME} bytes \
         and less than 1000000000 ns"
    )]
    Record {
        /// Bytes in the file.
        captured: u32,
        /// Bytes of the packet.
        wire: u32,
        /// Seconds of its stamp.
        seconds: u32,
        /// Rest of its stamp, ns.
        fraction_nanos: i64,
    },
    /// The length of a block of pcapng is impossible.
    #[error("block of {0} bytes; expected at least 12 and a multiple of 4")]
    BlockLength(u32),
    /// A packet block is longer than any frame.
    #[error("packet block of {0} bytes; a frame has at most {MAX_FRAME}")]
    PacketBlock(u32),
    /// The byte order of a section is not stated.
    #[error("section with byte-order magic {0:08x}")]
    ByteOrder(u32),
    /// A section has too many interfaces.
    #[error("more than {MAX_INTERFACES} interfaces")]
    Interfaces,
    /// A packet names an interface that the section does not declare.
    #[error("packet of interface {index}; {n_declared} are declared")]
    Interface {
        /// Interface of the packet.
        index: u32,
        /// Interfaces of the section.
        n_declared: usize,
    },
    /// A packet is longer than its block.
    #[error("packet of {captured} bytes in a block with room for {room}")]
    PacketLength {
        /// Bytes of the packet.
        captured: usize,
        /// Bytes available in the block.
        room: usize,
    },
}
