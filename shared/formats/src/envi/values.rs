//! Decoding of the data file.

use super::error::EnviFault;
use super::{DataType, Header, Interleave};
use ndarray::ArrayView3;

/// All values, band-sequential. Sets `lines` from the size of the file if the header has no entry.
pub fn decode(header: &mut Header, bytes: &[u8]) -> Result<Vec<f32>, EnviFault> {
    let offset = header.header_offset;
    let Some(bytes) = bytes.get(offset..) else {
        return Err(EnviFault::Offset { n_bytes: bytes.len(), offset });
    };
    let size = header.data_type.size();
    let line_bytes = header.samples.checked_mul(header.bands).and_then(|n| n.checked_mul(size));
    let line_bytes = line_bytes.ok_or(EnviFault::TooLarge)?;
    if header.lines == 0 {
        header.lines = bytes.len() / line_bytes;
    }
    let expected = line_bytes.checked_mul(header.lines).ok_or(EnviFault::TooLarge)?;
    if bytes.len() < expected || expected == 0 {
        let Header { samples, lines, bands, .. } = *header;
        return Err(EnviFault::DataSize { n_bytes: bytes.len(), samples, lines, bands, size, expected });
    }
    let stored = numbers(header.data_type, header.is_big_endian, &bytes[..expected]);
    Ok(band_sequential(header, stored))
}

fn numbers(data_type: DataType, is_big_endian: bool, bytes: &[u8]) -> Vec<f32> {
    macro_rules! all {
        ($number:ty) => {{
            let (numbers, _) = bytes.as_chunks();
            let number = if is_big_endian { <$number>::from_be_bytes } else { <$number>::from_le_bytes };
            numbers.iter().map(|bytes| number(*bytes) as f32).collect()
        }};
    }
    match data_type {
        DataType::U8 => all!(u8),
        DataType::I16 => all!(i16),
        DataType::I32 => all!(i32),
        DataType::F32 => all!(f32),
        DataType::F64 => all!(f64),
        DataType::U16 => all!(u16),
        DataType::U32 => all!(u32),
        DataType::I64 => all!(i64),
        DataType::U64 => all!(u64),
    }
}

fn band_sequential(header: &Header, stored: Vec<f32>) -> Vec<f32> {
    let Header { samples, lines, bands, .. } = *header;
    // Shape of the data file, and its axes in the order band, line, sample.
    let (shape, axes) = match header.interleave {
        Interleave::Bsq => return stored,
        Interleave::Bil => ((lines, bands, samples), [1, 0, 2]),
        Interleave::Bip => ((lines, samples, bands), [2, 0, 1]),
    };
    let view = ArrayView3::from_shape(shape, &stored).expect("as many values as in the header");
    let mut values = Vec::with_capacity(stored.len());
    // `iter` keeps the order of the axes; `for_each` of a view visits the values in the order of memory.
    values.extend(view.permuted_axes(axes).iter());
    values
}
