//! The checksum of saved states and of the files that results depend on. It is FNV-1a over 64-bit words, not a CRC: the format
//! of state files depends on it.

use messages::pod::{FINGERPRINT_START, fingerprint};

/// FNV-1a by words of 8 bytes, in four lanes: a single lane would wait five cycles for its product at every word, and a
/// state may have hundreds of megabytes. Bytes may be added in pieces of any length.
pub struct Checksum {
    lanes: [u64; 4],
    /// Up to 31 bytes of an incomplete block.
    rest: Vec<u8>,
    n_bytes: u64,
}

type Block = [u8; 32];

impl Default for Checksum {
    fn default() -> Self {
        Self::new()
    }
}

impl Checksum {
    /// The checksum of no bytes.
    pub fn new() -> Self {
        Self { lanes: [0, 1, 2, 3].map(|lane| FINGERPRINT_START ^ lane), rest: Vec::new(), n_bytes: 0 }
    }

    /// Adds bytes.
    pub fn add(&mut self, mut bytes: &[u8]) {
        self.n_bytes += bytes.len() as u64;
        if !self.rest.is_empty() {
            let (more, later) = bytes.split_at(bytes.len().min(size_of::<Block>() - self.rest.len()));
            self.rest.extend_from_slice(more);
            bytes = later;
            let Some(block) = self.rest.first_chunk::<{ size_of::<Block>() }>() else { return };
            self.lanes = add_block(self.lanes, block);
            self.rest.clear();
        }
        let (blocks, rest) = bytes.as_chunks::<{ size_of::<Block>() }>();
        self.lanes = blocks.iter().fold(self.lanes, add_block);
        self.rest.extend_from_slice(rest);
    }

    /// The checksum of the bytes added so far.
    pub fn sum(&self) -> u64 {
        let lanes = self.lanes.iter().fold(FINGERPRINT_START, |sum, lane| fingerprint(sum, &lane.to_le_bytes()));
        fingerprint(fingerprint(lanes, &self.rest), &self.n_bytes.to_le_bytes())
    }
}

fn add_block(lanes: [u64; 4], block: &Block) -> [u64; 4] {
    let words = block.as_chunks::<8>().0;
    // The rotation moves the upper bits down, which products alone never do.
    std::array::from_fn(|i| (lanes[i] ^ u64::from_le_bytes(words[i])).wrapping_mul(0x0100_0000_01b3).rotate_left(29))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(pieces: &[&[u8]]) -> u64 {
        let mut checksum = Checksum::new();
        for piece in pieces {
            checksum.add(piece);
        }
        checksum.sum()
    }

    #[test]
    fn checksum_depends_on_every_byte_and_not_on_pieces() {
        let bytes: Vec<u8> = (0..147_u32).map(|i| (i * i % 251) as u8).collect();
        let whole = sum(&[&bytes]);
        for cut in 0..bytes.len() {
            let (before, after) = bytes.split_at(cut);
            let (first, second) = after.split_at(after.len() / 3);
            assert_eq!(sum(&[before, first, &[], second]), whole, "cut at {cut}");
            assert_ne!(sum(&[before]), whole, "only {cut} bytes");
            let mut changed = bytes.clone();
            changed[cut] ^= 0x80;
            assert_ne!(sum(&[&changed]), whole, "byte {cut} changed");
        }
        let mut swapped = bytes.clone();
        swapped[..16].rotate_left(8);
        assert_ne!(sum(&[&swapped]), whole, "two words in the other order");
    }
}
