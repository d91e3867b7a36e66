//! Reading and changing coordinates in encoded rows.

use formats::ply::{Header, Kind, PlyError, PlyRows};
use std::sync::{Mutex, PoisonError};

/// Names of the first coordinate of each optional triple.
const TRIPLES: [&str; 2] = ["x", "x_lidar_position"];
/// Rows per block: 300 KB at 64 bytes a row.
const BLOCK_ROWS: usize = 1 << 12;

/// Smallest and largest x y z. `None` without points.
pub(crate) type Bounds = Option<[[f64; 3]; 2]>;

/// Positions of coordinates in a row.
pub(crate) struct Coordinates {
    row_size: usize,
    /// Offsets of the triples.
    triples: Vec<usize>,
    kind: Kind,
}

impl Coordinates {
    /// The coordinates of a cloud. `None` if there are no coordinates, or they have different types.
    pub(crate) fn from_header(cloud: &Header) -> Option<Self> {
        let mut triples = Vec::new();
        let mut offset = 0;
        let mut kind = None;
        for (k, property) in cloud.properties.iter().enumerate() {
            if TRIPLES.contains(&property.name.as_str()) {
                let three = cloud.properties.get(k..k + 3)?;
                let is_one = three.iter().all(|other| other.kind == property.kind);
                if !is_one || *kind.get_or_insert(property.kind) != property.kind {
                    return None;
                }
                triples.push(offset);
            }
            offset += property.kind.size();
        }
        let kind = kind.filter(|kind| matches!(kind, Kind::Float | Kind::Double))?;
        Some(Self { row_size: offset, triples, kind })
    }

    /// Replaces all triples of all rows by their transforms. The error includes the index of its row.
    pub(crate) fn replace<E>(
        &self,
        rows: &mut [u8],
        transform: impl Fn([f64; 3]) -> Result<[f64; 3], E>,
    ) -> Result<(), (usize, E)> {
        for (i, row) in rows.chunks_exact_mut(self.row_size).enumerate() {
            for at in &self.triples {
                let xyz = transform(self.read(row, *at)).map_err(|cause| (i, cause))?;
                self.write(row, *at, xyz);
            }
        }
        Ok(())
    }

    fn read(&self, row: &[u8], at: usize) -> [f64; 3] {
        match self.kind {
            Kind::Double => fields(row, at).map(f64::from_le_bytes),
            _ => fields(row, at).map(|bytes| f64::from(f32::from_le_bytes(bytes))),
        }
    }

    fn write(&self, row: &mut [u8], at: usize, xyz: [f64; 3]) {
        match self.kind {
            Kind::Double => row[at..at + 24].copy_from_slice(xyz.map(f64::to_le_bytes).as_flattened()),
            _ => row[at..at + 12].copy_from_slice(xyz.map(|value| (value as f32).to_le_bytes()).as_flattened()),
        }
    }

    /// Bounds of the points.
    pub(crate) fn bounds(&self, rows: &[u8]) -> Bounds {
        let mut min = [f64::INFINITY; 3];
        let mut max = [f64::NEG_INFINITY; 3];
        for row in rows.chunks_exact(self.row_size) {
            let xyz = self.read(row, self.triples[0]);
            for k in 0..3 {
                // `f64::min` is several times slower because of NaN.
                min[k] = if xyz[k] < min[k] { xyz[k] } else { min[k] };
                max[k] = if xyz[k] > max[k] { xyz[k] } else { max[k] };
            }
        }
        (!rows.is_empty()).then_some([min, max])
    }

    /// Bounds of all points of a file.
    pub(crate) fn bounds_of_all(&self, cloud: &PlyRows) -> Result<Bounds, PlyError> {
        let mut bounds = None;
        let mut block = Vec::new();
        for first in (0..cloud.len()).step_by(BLOCK_ROWS) {
            block.resize(BLOCK_ROWS.min(cloud.len() - first) * self.row_size, 0);
            cloud.read_into(first, &mut block)?;
            bounds = union(bounds, self.bounds(&block));
        }
        Ok(bounds)
    }
}

/// Bounds extended by several threads. The result does not depend on their order.
#[derive(Default)]
pub(crate) struct SharedBounds(Mutex<Bounds>);

impl SharedBounds {
    pub(crate) fn add(&self, other: Bounds) {
        let mut bounds = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *bounds = union(*bounds, other);
    }
    pub(crate) fn all(self) -> Bounds {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

fn union(a: Bounds, b: Bounds) -> Bounds {
    let (Some([a_min, a_max]), Some([b_min, b_max])) = (a, b) else { return a.or(b) };
    Some([std::array::from_fn(|k| a_min[k].min(b_min[k])), std::array::from_fn(|k| a_max[k].max(b_max[k]))])
}

/// Three fields of `N` bytes. [`Coordinates::from_header`] guarantees that they are inside the row.
fn fields<const N: usize>(row: &[u8], at: usize) -> [[u8; N]; 3] {
    std::array::from_fn(|axis| {
        let from = at + axis * N;
        row[from..from + N].try_into().expect("N bytes")
    })
}
