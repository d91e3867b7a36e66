//! LZF (M. Lehmann), the compression of `DATA binary_compressed`: runs of bytes, and copies of earlier output.
//!
//! A control byte below 32 precedes that many bytes and one. Otherwise its upper 3 bits are the length of a copy less 2 (7: the next
//! byte is added), its lower 5 bits and the next byte the distance less 1.

/// Fault of compressed data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LzfFault {
    /// The data ends inside a run or a copy.
    #[error("the compressed data ends inside a run")]
    Truncated,
    /// A copy begins before the output.
    #[error("compressed byte {at} copies from {distance} bytes back; only {n_out} are decoded")]
    Distance {
        /// Offset in the compressed data.
        at: usize,
        /// Distance of the copy.
        distance: usize,
        /// Bytes decoded so far.
        n_out: usize,
    },
    /// The output has another length.
    #[error("the compressed data holds {found} bytes or more; {expected} are declared")]
    Length {
        /// Bytes found.
        found: usize,
        /// Bytes declared.
        expected: usize,
    },
}

/// The `n` bytes of compressed data. The memory is limited by `n`, which the caller limits by the length of the data.
pub(super) fn decompress(data: &[u8], n: usize) -> Result<Vec<u8>, LzfFault> {
    let mut out = Vec::with_capacity(n);
    let mut at = 0;
    let length = |found: usize| LzfFault::Length { found, expected: n };
    while let Some(&control) = data.get(at) {
        at += 1;
        if control < 32 {
            let end = at + usize::from(control) + 1;
            let run = data.get(at..end).ok_or(LzfFault::Truncated)?;
            if run.len() > n - out.len() {
                return Err(length(out.len() + run.len()));
            }
            out.extend_from_slice(run);
            at = end;
            continue;
        }
        let mut next = || {
            let byte = data.get(at).copied().ok_or(LzfFault::Truncated)?;
            at += 1;
            Ok(usize::from(byte))
        };
        let mut n_copied = usize::from(control >> 5) + 2;
        if n_copied == 9 {
            n_copied += next()?;
        }
        let distance = (usize::from(control & 31) << 8) + next()? + 1;
        if n_copied > n - out.len() {
            return Err(length(out.len() + n_copied));
        }
        let first = out.len().checked_sub(distance);
        let first = first.ok_or(LzfFault::Distance { at, distance, n_out: out.len() })?;
        // The copy may overlap its own output.
        for index in first..first + n_copied {
            out.push(out[index]);
        }
    }
    if out.len() == n { Ok(out) } else { Err(length(out.len())) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_and_overlapping_copies_are_decoded() {
        // A run of 3 bytes; 4 bytes from 2 back; 9 + 3 bytes from 1 back.
        let data = [2, b'a', b'b', b'c', 2 << 5, 1, 7 << 5, 3, 0];
        let found = decompress(&data, 19).expect("decodes");
        assert_eq!(found, b"abcbcbcccccccccccccc"[..19]);
        assert_eq!(decompress(&[], 0), Ok(Vec::new()));
    }

    #[test]
    fn damage_is_reported() {
        assert_eq!(decompress(&[5, 1, 2], 6), Err(LzfFault::Truncated));
        assert_eq!(decompress(&[0, 7, 1 << 5], 4), Err(LzfFault::Truncated));
        assert_eq!(decompress(&[0, 7, 1 << 5, 4], 4), Err(LzfFault::Distance { at: 4, distance: 5, n_out: 1 }));
        assert_eq!(decompress(&[1, 7, 7], 1), Err(LzfFault::Length { found: 2, expected: 1 }));
        assert_eq!(decompress(&[1, 7, 7], 3), Err(LzfFault::Length { found: 2, expected: 3 }));
        assert_eq!(decompress(&[0, 7, 7 << 5, 255, 0], 100), Err(LzfFault::Length { found: 265, expected: 100 }));
    }
}
