//! The bits of the entropy-coded data of a JPEG file, up to its next marker.

/// Reads the bits of one restart interval. Behind its end it gives zeros and counts them.
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    /// Offset of the next byte.
    at: usize,
    /// The next bits, from the highest bit down.
    held: u64,
    n_held: u32,
    /// Bits of `held` that lie behind the end of the data.
    n_padding: u32,
}

impl<'a> Bits<'a> {
    /// From this offset of the file on.
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

    /// The next 16 bits, which stay.
    pub(super) fn peek(&mut self) -> usize {
        while self.n_held <= 48 {
            let byte = self.next_byte();
            self.n_padding += if byte.is_none() { 8 } else { 0 };
            self.held |= u64::from(byte.unwrap_or_default()) << (56 - self.n_held);
            self.n_held += 8;
        }
        (self.held >> 48) as usize
    }

    /// Skips bits, at most those that were peeked.
    pub(super) fn skip(&mut self, n: u32) {
        self.held <<= n;
        self.n_held -= n;
    }

    /// Whether bits behind the end of the data were skipped.
    pub(super) fn is_behind_end(&self) -> bool {
        self.n_held < self.n_padding
    }

    /// Skips the rest of the data. Returns the number of its whole bytes that are not zero: encoders may add zeros.
    pub(super) fn skip_rest(&mut self) -> usize {
        self.skip(self.n_held % 8);
        let n_held = self.n_held.saturating_sub(self.n_padding) / 8;
        let mut n_rest = self.held.to_be_bytes()[..n_held as usize].iter().filter(|byte| **byte != 0).count();
        (self.held, self.n_held, self.n_padding) = (0, 0, 0);
        while let Some(byte) = self.next_byte() {
            n_rest += usize::from(byte != 0);
        }
        n_rest
    }
}
