//! One-dimensional arrays in `NumPy`'s format, version 1.0.

/// An array of float64.
pub fn of_f64s(values: &[f64]) -> Vec<u8> {
    let bytes = values.iter().flat_map(|value| value.to_le_bytes());
    header("<f8", values.len()).into_iter().chain(bytes).collect()
}

/// An array of uint8.
pub fn of_bytes(values: &[u8]) -> Vec<u8> {
    header("|u1", values.len()).into_iter().chain(values.iter().copied()).collect()
}

/// The values of a file that [`of_f64s`] or `NumPy` wrote.
pub fn f64s(file: &[u8]) -> anyhow::Result<Vec<f64>> {
    let chunks = data(file, "'<f8'")?.chunks_exact(8);
    Ok(chunks.map(|chunk| f64::from_le_bytes(std::array::from_fn(|i| chunk[i]))).collect())
}

/// The values of a file that [`of_bytes`] or `NumPy` wrote.
pub fn bytes(file: &[u8]) -> anyhow::Result<Vec<u8>> {
    Ok(data(file, "'|u1'")?.to_vec())
}

fn header(kind: &str, len: usize) -> Vec<u8> {
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({len},), }}");
    // Magic, version, length and text end at a multiple of 64.
    let padded = (10 + text.len() + 1).div_ceil(64) * 64 - 10;
    text.extend(std::iter::repeat_n(' ', padded - 1 - text.len()));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((padded as u16).to_le_bytes());
    bytes.extend(text.into_bytes());
    bytes
}

fn data<'a>(file: &'a [u8], kind: &str) -> anyhow::Result<&'a [u8]> {
    anyhow::ensure!(file.len() >= 10 && file.starts_with(b"\x93NUMPY\x01"), "no NumPy file of version 1");
    let end = 10 + usize::from(u16::from_le_bytes([file[8], file[9]]));
    anyhow::ensure!(file.len() >= end, "the NumPy header is cut off");
    let text = String::from_utf8_lossy(&file[10..end]);
    anyhow::ensure!(text.contains(kind), "the array is {text:?}, expected {kind}");
    Ok(&file[end..])
}
