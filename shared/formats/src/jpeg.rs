//! Checks that a JPEG file is complete and undamaged. Decoders fill the missing part of a cut image with gray, and
//! continue after damage.

mod bits;
mod entropy;
mod huffman;

/// Markers without a segment: `TEM` and `RST0` to `RST7`.
const ALONE: [u8; 9] = [0x01, 0xd0, 0xd1, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7];
const START_OF_SCAN: u8 = 0xda;
const END_OF_IMAGE: u8 = 0xd9;

/// Fault of a JPEG file.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum JpegError {
    /// Data is missing at the end.
    #[error("the JPEG data ends after {n_bytes} bytes without the end of the image; the file is cut")]
    Cut {
        /// Size of the file.
        n_bytes: usize,
    },
    /// A code is not in the table.
    #[error("damaged JPEG data: invalid code before byte {at}, in block {block} of {n_blocks}")]
    Code {
        /// Offset after the code.
        at: usize,
        /// Number of the block, from 1.
        block: u64,
        /// Blocks of the scan.
        n_blocks: u64,
    },
    /// The scan has fewer blocks than the image.
    #[error("damaged JPEG data: it ends at byte {at}, in block {block} of {n_blocks}")]
    Short {
        /// Offset of the end.
        at: usize,
        /// Number of the block, from 1.
        block: u64,
        /// Blocks of the scan.
        n_blocks: u64,
    },
    /// The scan has more data than the blocks of the image.
    #[error("damaged JPEG data: {n_bytes} bytes before byte {at} follow after the last of {n_blocks} blocks")]
    Long {
        /// Offset of the end.
        at: usize,
        /// Bytes that belong to no block.
        n_bytes: usize,
        /// Blocks of the scan.
        n_blocks: u64,
    },
    /// A marker is missing or out of order.
    #[error("damaged JPEG data: no restart marker {number} at byte {at}")]
    Restart {
        /// Offset where the marker is expected.
        at: usize,
        /// Number of the marker, 0 to 7.
        number: u8,
    },
    /// The mean of a block is outside the range of samples.
    #[error("damaged JPEG data: impossible brightness before byte {at}, in block {block} of {n_blocks}")]
    Brightness {
        /// Offset after the code.
        at: usize,
        /// Number of the block, from 1.
        block: u64,
        /// Blocks of the scan.
        n_blocks: u64,
    },
}

/// Checks that a JPEG file is complete and, if it is sequential with Huffman codes, that its data decodes to exactly the
/// blocks of the image.
///
/// Damage of the data changes the number of blocks or leaves invalid codes, except for a few bits that change only the values of
/// coefficients: the format has no checksum.
pub fn check(bytes: &[u8]) -> Result<(), JpegError> {
    if !is_complete(bytes) {
        return Err(JpegError::Cut { n_bytes: bytes.len() });
    }
    entropy::check(bytes)
}

/// Whether the bytes begin like a JPEG file.
pub fn is_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(&[0xff, 0xd8])
}

/// Whether the image data of a JPEG file ends with the marker "end of image". Bytes after it are ignored. Segments are
/// skipped by their lengths, so the end of an embedded thumbnail does not count.
fn is_complete(bytes: &[u8]) -> bool {
    let mut at = 2;
    let mut has_scan = false;
    while let Some((marker, after)) = next_marker(bytes, at) {
        match marker {
            END_OF_IMAGE => return has_scan,
            marker if ALONE.contains(&marker) => at = after,
            marker => {
                has_scan |= marker == START_OF_SCAN;
                // The entropy-coded data after the header of a scan has no markers but restarts.
                let Some(length) = bytes.get(after..).and_then(<[u8]>::first_chunk) else { return false };
                at = after + usize::from(u16::from_be_bytes(*length));
            }
        }
    }
    false
}

/// The next marker and the offset after it. `ff 00` is a stuffed byte of entropy-coded data, and `ff ff` is padding.
fn next_marker(bytes: &[u8], from: usize) -> Option<(u8, usize)> {
    let pairs = bytes.get(from..)?.windows(2).enumerate();
    let mut markers = pairs.filter(|(_, pair)| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0xff));
    markers.next().map(|(offset, pair)| (pair[1], from + offset + 2))
}
