//! Huffman codes of a JPEG file.

use super::bits::Bits;

/// Bits of the codes that are found by one table look-up. Longer codes are rare.
const N_FAST: u32 = 9;
/// Longest code, bits.
const N_MAX: usize = 16;

/// A Huffman table.
#[derive(Clone)]
pub(super) struct Huffman {
    /// Symbol and length by the next [`N_FAST`] bits; length 0: the code is longer.
    fast: Vec<(u8, u8)>,
    /// Upper limit of the codes of each length (index: length less one): the code after the last one, left-aligned to 16
    /// bits.
    end: [usize; N_MAX],
    /// Offset for each length (index: length less one): added to a code, it gives the index of the code's symbol.
    offset: [isize; N_MAX],
    symbols: Vec<u8>,
}

impl Huffman {
    /// Builds a table from the numbers of codes by length, and the symbols. `None` if there are more codes than the
    /// lengths allow.
    pub(super) fn new(counts: &[u8; N_MAX], symbols: &[u8]) -> Option<Self> {
        let mut table =
            Self { fast: vec![(0, 0); 1 << N_FAST], end: [0; N_MAX], offset: [0; N_MAX], symbols: symbols.to_vec() };
        let mut code = 0_usize;
        let mut index = 0_usize;
        for (length, count) in (1_u32..).zip(counts) {
            let slot = length as usize - 1;
            table.offset[slot] = index as isize - code as isize;
            for _ in 0..*count {
                let symbol = *symbols.get(index)?;
                if length <= N_FAST {
                    let n = 1 << (N_FAST - length);
                    table.fast.get_mut(code * n..(code + 1) * n)?.fill((symbol, length as u8));
                }
                code += 1;
                index += 1;
            }
            if code > 1 << length {
                return None;
            }
            table.end[slot] = code << (N_MAX as u32 - length);
            code <<= 1;
        }
        Some(table)
    }

    /// The next symbol. `None` if the bits are not a code. At least 11 more bits can be skipped after it.
    #[inline]
    pub(super) fn next(&self, bits: &mut Bits<'_>) -> Option<u8> {
        let peeked = bits.peek();
        let (symbol, length) = self.fast[peeked >> (N_MAX as u32 - N_FAST)];
        if length > 0 {
            bits.skip(u32::from(length));
            return Some(symbol);
        }
        let slot = self.end.iter().position(|end| peeked < *end)?;
        let length = slot as u32 + 1;
        bits.skip(length);
        let index = (peeked >> (N_MAX as u32 - length)) as isize + self.offset[slot];
        self.symbols.get(usize::try_from(index).ok()?).copied()
    }
}
