//! MATLAB files of version 5: the arrays named `Segmentation` in structures of cells, as BSDS500 has them.
//!
//! A separate reader, because crates for MATLAB files read only plain arrays.

use anyhow::{Context, bail, ensure};
use flate2::read::ZlibDecoder;
use std::io::Read;

/// A matrix of labels, row by row.
pub struct Segmentation {
    /// Columns and rows.
    pub size: [usize; 2],
    pub labels: Vec<u32>,
}

/// Largest matrix that is unpacked, bytes.
const MAX_BYTES: u64 = 1 << 28;

const HEADER: usize = 128;
const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;
const CELL_CLASS: u8 = 1;
const STRUCT_CLASS: u8 = 2;

/// All arrays named `Segmentation`, in the order of the file.
pub fn segmentations(bytes: &[u8]) -> anyhow::Result<Vec<Segmentation>> {
    ensure!(bytes.starts_with(b"MATLAB 5.0"), "is not a MATLAB file of version 5");
    let mut found = Vec::new();
    let mut elements = Elements(bytes.get(HEADER..).context("ends in its header")?);
    while let Some((kind, data)) = elements.next()? {
        if kind == COMPRESSED {
            let mut unpacked = Vec::new();
            ZlibDecoder::new(data).take(MAX_BYTES).read_to_end(&mut unpacked)?;
            let (kind, data) = Elements(&unpacked).next()?.context("a compressed element is empty")?;
            visit(kind, data, false, &mut found)?;
        } else {
            visit(kind, data, false, &mut found)?;
        }
    }
    Ok(found)
}

/// A sequence of elements: a kind and its data.
struct Elements<'a>(&'a [u8]);

impl<'a> Elements<'a> {
    fn next(&mut self) -> anyhow::Result<Option<(u32, &'a [u8])>> {
        if self.0.is_empty() {
            return Ok(None);
        }
        let word = |at: usize| {
            let bytes = self.0.get(at..at + 4).context("an element ends in its tag")?;
            Ok::<u32, anyhow::Error>(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
        };
        let tag = word(0)?;
        // Up to four bytes of data are in the tag itself.
        let (kind, begin, length, whole) = if tag >> 16 > 0 {
            (tag & 0xffff, 4, (tag >> 16) as usize, 8)
        } else {
            let length = word(4)? as usize;
            // Compressed elements are not padded to eight bytes.
            (tag, 8, length, 8 + if tag == COMPRESSED { length } else { length.next_multiple_of(8) })
        };
        let data = self.0.get(begin..begin + length).context("an element is longer than its file")?;
        self.0 = self.0.get(whole..).unwrap_or_default();
        Ok(Some((kind, data)))
    }

    fn required(&mut self) -> anyhow::Result<&'a [u8]> {
        Ok(self.next()?.context("a matrix lacks a part")?.1)
    }
}

/// Visits cells and structures. `is_wanted`: the matrix is a field of the wanted name.
fn visit(kind: u32, data: &[u8], is_wanted: bool, found: &mut Vec<Segmentation>) -> anyhow::Result<()> {
    if kind != MATRIX || data.is_empty() {
        return Ok(());
    }
    let mut parts = Elements(data);
    let class = *parts.required()?.first().context("a matrix has no class")?;
    let dimensions: Vec<usize> =
        parts.required()?.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize).collect();
    let _name = parts.required()?;
    match class {
        CELL_CLASS => {
            while let Some((kind, data)) = parts.next()? {
                visit(kind, data, false, found)?;
            }
        }
        STRUCT_CLASS => {
            let length = *parts.required()?.first().context("a structure has no field names")? as usize;
            ensure!(length > 0, "a structure has field names of length 0");
            let names: Vec<&[u8]> = parts.required()?.chunks_exact(length).collect();
            let is_named = |name: &[u8]| name.split(|byte| *byte == 0).next() == Some(b"Segmentation");
            for name in names.iter().cycle() {
                let Some((kind, data)) = parts.next()? else { break };
                visit(kind, data, is_named(name), found)?;
            }
        }
        _ if is_wanted => found.push(labels(&mut parts, &dimensions)?),
        _ => {}
    }
    Ok(())
}

/// Labels by columns, as stored, to labels by rows.
fn labels(parts: &mut Elements<'_>, dimensions: &[usize]) -> anyhow::Result<Segmentation> {
    let [rows, columns] = *dimensions else { bail!("a segmentation has {} dimensions; must have 2", dimensions.len()) };
    let (kind, data) = parts.next()?.context("a segmentation has no values")?;
    let by_columns: Vec<u32> = match kind {
        2 => data.iter().map(|value| u32::from(*value)).collect(),
        4 => data.chunks_exact(2).map(|b| u32::from(u16::from_le_bytes([b[0], b[1]]))).collect(),
        _ => bail!("a segmentation has values of kind {kind}; must be 2 (8 bits) or 4 (16 bits)"),
    };
    ensure!(by_columns.len() == rows * columns, "a segmentation has {} values of {rows} x {columns}", by_columns.len());
    let at = |index: usize| by_columns[index % columns * rows + index / columns];
    Ok(Segmentation { size: [columns, rows], labels: (0..rows * columns).map(at).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[real_data::test("bsds500/groundTruth/train/100075.mat")]
    fn segmentations_of_a_real_file_have_the_labels_of_scipy() {
        let bytes = std::fs::read(real_data::path("bsds500/groundTruth/train/100075.mat")).expect("a file");
        let found = segmentations(&bytes).expect("a MATLAB file");
        assert_eq!(found.len(), 6);
        assert!(found.iter().all(|segmentation| segmentation.size == [481, 321]));
        // scipy.io.loadmat: sums of the labels.
        let sums: Vec<u64> = found.iter().map(|s| s.labels.iter().map(|label| u64::from(*label)).sum()).collect();
        assert_eq!(sums, [716_581, 312_756, 630_156, 622_282, 1_266_318, 810_927]);
        assert!(segmentations(&bytes[..5000]).is_err());
    }
}
