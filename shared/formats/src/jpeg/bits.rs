//! The bits of the entropy-coded data of a JPEG file, up to its next marker.

/// Bits that are held after each peek: a code of 16 bits and the 11 of its value.
pub(super) const MIN_HELD: u32 = 27;

/// Reads the bits of one restart interval. Past its end it returns zeros and counts them.
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    /// Offset of the next byte.
    at: usize,
    /// The next bits, from the highest bit down.
    held: u64,
    n_held: u32,
    /// Bits of `held` that lie past the end of the data.
    n_padding: u32,
}

impl<'a> Bits<'a> {
    /// Bits of the file from this offset on.
    pub(super) fn new(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at, held: 0, n_held: 0, n_padding: 0 }
    }

    /// Offset of the next byte to read, for messages.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// The next byte of data: `ff 00` is a stuffed `ff`; `ff` and another byte begin a marker.
    fn next_byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        if byte != 0xff {
            self.at += 1;
            return Some(byte);
        }
        (self.bytes.get(self.at + 1) == Some(&0)).then(|| {
            self.at += 2;
            byte
        })
    }

    /// The next 16 bits, without skipping them. At least [`MIN_HELD`] bits can be skipped afterwards.
    #[inline]
    pub(super) fn peek(&mut self) -> usize {
        if self.n_held < MIN_HELD {
            self.refill();
        }
        (self.held >> 48) as usize
    }

    fn refill(&mut self) {
        let next = self.bytes.get(self.at..).and_then(|bytes| bytes.first_chunk());
        if let Some(word) = next.map(|chunk| u64::from_be_bytes(*chunk)).filter(|word| !has_ff(*word)) {
            // At most seven bytes: the mask below cannot be shifted by 64 bits.
            let n = (63 - self.n_held) / 8;
            self.held |= (word & !(u64::MAX >> (8 * n))) >> self.n_held;
            self.at += n as usize;
            self.n_held += 8 * n;
            return;
        }
        while self.n_held <= 48 {
            let byte = self.next_byte();
            self.n_padding += if byte.is_none() { 8 } else { 0 };
            self.held |= u64::from(byte.unwrap_or_default()) << (56 - self.n_held);
            self.n_held += 8;
        }
    }

    /// Skips bits, at most those that are held.
    #[inline]
    pub(super) fn skip(&mut self, n: u32) {
        self.held <<= n;
        self.n_held -= n;
    }

    /// Whether bits past the end of the data were skipped.
    pub(super) fn is_behind_end(&self) -> bool {
        self.n_held < self.n_padding
    }

    /// Skips the rest of the data. Returns the number of its complete bytes that are not zero: encoders may add zeros.
    pub(super) fn skip_rest(&mut self) -> usize {
        self.skip(self.n_held % 8);
        let n_held = self.n_held.saturating_sub(self.n_padding) / 8;
        let mut n_rest = self.held.to_be_bytes()[..n_held as usize].iter().filter(|byte| **byte != 0).count();
        self.held = 0;
        self.n_held = 0;
        self.n_padding = 0;
        while let Some(byte) = self.next_byte() {
            n_rest += usize::from(byte != 0);
        }
        n_rest
    }
}

/// Whether one of the bytes is `ff`.
fn has_ff(word: u64) -> bool {
    // The lowest zero byte of the inverse loses its highest bit when one is subtracted from each byte (Warren, Hacker's Delight, 6-1).
    let inverse = !word;
    inverse.wrapping_sub(0x0101_0101_0101_0101) & word & 0x8080_8080_8080_8080 != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_those_of_the_bytes_without_stuffing() {
        let mut bytes: Vec<u8> = (0..200_u32).map(|i| (i * i * 7 + 13 * i) as u8).collect();
        bytes.extend([0xff, 1, 2, 3, 4, 5, 6, 7, 0xff, 0xff, 8]);
        let mut coded = Vec::new();
        let mut expected = Vec::new();
        for byte in &bytes {
            coded.push(*byte);
            coded.extend((*byte == 0xff).then_some(0));
            expected.extend((0..8).rev().map(|k| byte >> k & 1));
        }
        coded.extend([0xff, 0xd9]);
        let mut bits = Bits::new(&coded, 0);
        let mut read = Vec::new();
        for n in (1..=16).cycle() {
            let peeked = bits.peek();
            assert!(bits.n_held >= MIN_HELD);
            read.extend((0..n).map(|k| (peeked >> (15 - k) & 1) as u8));
            bits.skip(n);
            if bits.is_behind_end() {
                break;
            }
        }
        assert_eq!(read[..expected.len()], expected);
        assert!(read[expected.len()..].iter().all(|bit| *bit == 0));
        assert_eq!(bits.at(), coded.len() - 2);
    }
}
