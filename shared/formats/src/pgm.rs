//! Raw images as binary PGM (Netpbm `P5`): 16 bits big-endian, or 8 bits if the largest value is below 256.

/// Error of bytes that are not an image.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[error("byte {offset}: {fault}")]
pub struct PgmError {
    /// Offset of the fault.
    pub offset: usize,
    /// Fault at the offset.
    pub fault: PgmFault,
}

/// Fault of an image.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum PgmFault {
    /// The file has another format.
    #[error("the file does not begin with P5 (binary PGM)")]
    Magic,
    /// A number of the header is absent or too large.
    #[error("{name} {text:?} must be 1 to {limit}")]
    Number {
        /// Name of the number.
        name: &'static str,
        /// Its digits.
        text: String,
        /// Largest allowed value.
        limit: u32,
    },
    /// The header does not end.
    #[error("expected one blank after the header")]
    HeaderEnd,
    /// The file has fewer samples than pixels.
    #[error("{width} x {height} samples of {sample_bytes} bytes are declared, {n_bytes} bytes follow")]
    Cut {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Bytes of a sample.
        sample_bytes: usize,
        /// Bytes after the header.
        n_bytes: usize,
    },
}

/// Longest side of an image, px. No supported camera has longer sides.
const MAX_SIDE: u32 = 32_768;

/// An image that borrows the bytes of its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pgm<'a> {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Largest possible value of a sample, 1 to 65535.
    pub max: u32,
    samples: &'a [u8],
}

impl<'a> Pgm<'a> {
    /// Reads the header and checks that all samples are present.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, PgmError> {
        let mut at = 2;
        if bytes.get(..2) != Some(b"P5") {
            return Err(PgmError { offset: 0, fault: PgmFault::Magic });
        }
        let mut number = |name: &'static str, limit: u32| {
            at = skip_blanks(bytes, at);
            let digits = bytes[at..].iter().take_while(|byte| byte.is_ascii_digit()).take(9).count();
            let text = std::str::from_utf8(&bytes[at..at + digits]).unwrap_or_default();
            let value = text.parse().ok().filter(|value| (1..=limit).contains(value));
            let offset = at;
            at += digits;
            let fault = || PgmFault::Number { name, text: text.to_owned(), limit };
            value.ok_or_else(|| PgmError { offset, fault: fault() })
        };
        let width = number("width", MAX_SIDE)?;
        let height = number("height", MAX_SIDE)?;
        let max = number("maximum", 65_535)?;
        if !bytes.get(at).is_some_and(u8::is_ascii_whitespace) {
            return Err(PgmError { offset: at, fault: PgmFault::HeaderEnd });
        }
        let sample_bytes = if max > 255 { 2 } else { 1 };
        let n_bytes = width as usize * height as usize * sample_bytes;
        let Some(samples) = bytes.get(at + 1..at + 1 + n_bytes) else {
            let fault = PgmFault::Cut { width, height, sample_bytes, n_bytes: bytes.len() - at - 1 };
            return Err(PgmError { offset: at + 1, fault });
        };
        Ok(Self { width, height, max, samples })
    }

    /// Number of samples.
    pub fn n_samples(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Writes the samples to `out`, row-major from the top left. `out` must have [`Pgm::n_samples`] entries.
    pub fn samples_into(&self, out: &mut [u16]) {
        if self.max > 255 {
            for (out, pair) in out.iter_mut().zip(self.samples.chunks_exact(2)) {
                *out = u16::from_be_bytes([pair[0], pair[1]]);
            }
        } else {
            for (out, sample) in out.iter_mut().zip(self.samples) {
                *out = u16::from(*sample);
            }
        }
    }

    /// The samples, row-major from the top left.
    pub fn samples(&self) -> Vec<u16> {
        let mut samples = vec![0; self.n_samples()];
        self.samples_into(&mut samples);
        samples
    }
}

/// Content of a file. `max` (1 to 65535) is the largest possible value of a sample. Missing samples are zero, extra samples are
/// ignored.
pub fn pgm_from_samples(width: u32, height: u32, max: u16, samples: &[u16]) -> Vec<u8> {
    let n_samples = width as usize * height as usize;
    let mut bytes = format!("P5\n{width} {height}\n{}\n", max.max(1)).into_bytes();
    let samples = samples.iter().copied().chain(std::iter::repeat(0)).take(n_samples);
    if max > 255 {
        bytes.extend(samples.flat_map(u16::to_be_bytes));
    } else {
        bytes.extend(samples.map(|sample| sample.min(255) as u8));
    }
    bytes
}

/// Offset after blanks and comments.
fn skip_blanks(bytes: &[u8], mut at: usize) -> usize {
    while let Some(byte) = bytes.get(at) {
        match byte {
            b'#' => at += bytes[at..].iter().position(|byte| *byte == b'\n').unwrap_or(bytes.len() - at),
            byte if byte.is_ascii_whitespace() => at += 1,
            _ => break,
        }
    }
    at.min(bytes.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_both_depths_survive_round_trip() {
        let samples: Vec<u16> = (0..15).map(|i| i * 70).collect();
        let deep = pgm_from_samples(5, 3, 1023, &samples);
        assert_eq!(deep.len(), 12 + 30);
        let image = Pgm::parse(&deep).expect("parses");
        assert_eq!((image.width, image.height, image.max, image.samples()), (5, 3, 1023, samples));
        let shallow = b"P5 # made by hand\n# two lines\n2\t2 255\n\x00\x01\xfe\xff";
        assert_eq!(Pgm::parse(shallow).expect("parses").samples(), [0, 1, 254, 255]);
    }

    #[test]
    fn faults_are_reported_with_their_offset() {
        for (bytes, offset, rule) in [
            (&b"P2\n2 2\n255\n"[..], 0, "P5"),
            (b"P5", 2, "width"),
            (b"P5 0 2 255 ", 3, "1 to 32768"),
            (b"P5 2 99999 255 ", 5, "height \"99999\""),
            (b"P5 2 2 70000 ", 7, "maximum"),
            (b"P5 2 2 255", 10, "one blank"),
            (b"P5 2 2 256 1234567", 11, "7 bytes follow"),
        ] {
            let error = Pgm::parse(bytes).expect_err(rule);
            assert_eq!(error.offset, offset, "{error}");
            assert!(error.to_string().contains(rule), "{error}");
        }
    }
}
