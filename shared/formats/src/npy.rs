//! NPY files (`NumPy`): checks of the header that the reader, candle, does not make.

/// Error of a header that is not read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NpyError {
    /// The file ends within the header.
    #[error("the NPY header has {found} bytes; the file has {n_bytes}")]
    Length {
        /// Bytes of the header.
        found: usize,
        /// Bytes of the file.
        n_bytes: usize,
    },
    /// The header has nested brackets, whose parsing takes exponential time.
    #[error("the NPY header has nested brackets; only plain arrays are read")]
    Nested,
    /// The shape has more elements than the file: the reader multiplies its sizes without checking the product.
    #[error("the shape {shape} of the NPY header has more elements than the file has bytes, which is {n_bytes}")]
    Shape {
        /// Shape in the header.
        shape: String,
        /// Bytes of the file.
        n_bytes: usize,
    },
}

/// Checks that the header lies in the file and describes a plain array. Damage of other kinds is left to the reader.
pub fn check_header(bytes: &[u8]) -> Result<(), NpyError> {
    // Magic, version, and the length of the text: 2 bytes in version 1, then 4.
    let (n_bytes, start) = match bytes.get(6..12) {
        Some([1, _, a, b, _, _]) => (usize::from(u16::from_le_bytes([*a, *b])), 10),
        Some([_, _, a, b, c, d]) => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, 12),
        _ => return Ok(()),
    };
    let text = bytes[start.min(bytes.len())..].get(..n_bytes);
    let text = text.ok_or(NpyError::Length { found: n_bytes, n_bytes: bytes.len() })?;
    let n_brackets = text.iter().filter(|byte| b"([{".contains(byte)).count();
    // A dictionary and a shape.
    if n_brackets > 2 {
        return Err(NpyError::Nested);
    }
    let shape = text.iter().position(|byte| *byte == b'(').map_or(&[][..], |begin| &text[begin..]);
    let shape = shape.iter().position(|byte| *byte == b')').map_or(shape, |end| &shape[..=end]);
    let shape = String::from_utf8_lossy(shape).into_owned();
    let sizes = shape.split(|letter: char| !letter.is_ascii_digit()).filter(|digits| !digits.is_empty());
    let n_elements = sizes.map(|digits| digits.parse::<u64>().ok()).try_fold(1_u64, |n, size| n.checked_mul(size?));
    // An element has at least one byte.
    let fits = n_elements.is_some_and(|n| n <= bytes.len() as u64);
    if fits { Ok(()) } else { Err(NpyError::Shape { shape, n_bytes: bytes.len() }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_and_nested_headers_are_refused() {
        let file = |version: u8, length: &[u8], text: &[u8]| [b"\x93NUMPY", &[version, 0][..], length, text].concat();
        let text = b"{'descr': '<f4', 'fortran_order': False, 'shape': (8, 3), }";
        assert_eq!(check_header(&file(1, &[59, 0], text)), Ok(()));
        assert_eq!(check_header(&file(2, &[59, 0, 0, 0], text)), Ok(()));
        assert_eq!(
            check_header(&file(3, &[255; 4], text)),
            Err(NpyError::Length { found: 0xffff_ffff, n_bytes: 12 + 59 })
        );
        assert_eq!(check_header(&file(1, &[20, 0], b"{'shape': (8, (8, (8")), Err(NpyError::Nested));
        assert_eq!(check_header(b"short"), Ok(()));
    }

    #[test]
    fn shapes_whose_elements_exceed_the_file_are_refused() {
        let check = |shape: &str| {
            let text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
            let file =
                [b"\x93NUMPY\x01\x00", &(text.len() as u16).to_le_bytes()[..], text.as_bytes(), &[0; 96]].concat();
            check_header(&file).map_err(|error| error.to_string())
        };
        for shape in ["()", "(24,)", "(8, 3)", "(0, 3)", "(008, 3L)"] {
            assert_eq!(check(shape), Ok(()), "{shape}");
        }
        // The product of the second has 66 bits.
        for shape in ["(8000, 3)", "(4, 11273010267266948198)", "(99999999999999999999999,)"] {
            let error = check(shape).expect_err("refused");
            assert!(error.contains(&format!("the shape {shape} of the NPY header has more elements")), "{error}");
        }
    }
}
