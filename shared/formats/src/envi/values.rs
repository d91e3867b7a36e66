//! The numbers behind a header.

use super::{DataType, Header, Interleave};

/// All values, band-sequential. Fills in `lines` if the header does not say how many there are.
pub fn decode(header: &mut Header, bytes: &[u8]) -> Result<Vec<f32>, String> {
    let offset = header.header_offset;
    let Some(bytes) = bytes.get(offset..) else {
        return Err(format!("{} bytes; header offset = {offset} is behind its end", bytes.len()));
    };
    let size = header.data_type.size();
    let line_bytes = header.samples.checked_mul(header.bands).and_then(|n| n.checked_mul(size)).ok_or("too large")?;
    if header.lines == 0 {
        header.lines = bytes.len() / line_bytes;
    }
    let expected = line_bytes.checked_mul(header.lines).ok_or("too large")?;
    if bytes.len() < expected || expected == 0 {
        return Err(format!(
            "{} bytes of values; {} samples, {} lines and {} bands of {size} bytes are {expected}",
            bytes.len(),
            header.samples,
            header.lines,
            header.bands
        ));
    }
    let stored = numbers(header.data_type, header.is_big_endian, &bytes[..expected]);
    Ok(sequential(header, stored))
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

fn sequential(header: &Header, stored: Vec<f32>) -> Vec<f32> {
    let [samples, lines, bands] = [header.samples, header.lines, header.bands];
    // Where sample, line and band are multiplied with what.
    let [by_sample, by_line, by_band] = match header.interleave {
        Interleave::Bsq => return stored,
        Interleave::Bil => [1, samples * bands, samples],
        Interleave::Bip => [bands, samples * bands, 1],
    };
    let mut values = Vec::with_capacity(stored.len());
    for band in 0..bands {
        for line in 0..lines {
            let start = line * by_line + band * by_band;
            values.extend((0..samples).map(|sample| stored[start + sample * by_sample]));
        }
    }
    values
}
