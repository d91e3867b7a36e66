//! Files that hold the points of tiles until all points are known.

use crate::error::{At, ImportError};
use files::regular_file;
use messages::SubmapPoint;
use messages::pod::{bytes_from_rows, rows_from_bytes};
use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::{Read, Write};
use std::path::PathBuf;

/// Maximum number of points of a submap: half the limit of the topic, so that a tile with all columns takes less than 1
/// GB of memory.
const MAX_POINTS: usize = 1 << 22;
/// Maximum number of bytes of points that wait to be written to their files.
const MAX_WAITING: usize = 1 << 26;
/// Bytes of a point, its class, color and instance.
const ROW_BYTES: usize = size_of::<SubmapPoint>() + 8;

/// A point with its truth and its color.
#[derive(Clone, Copy, Debug)]
pub(super) struct TilePoint {
    pub point: SubmapPoint,
    pub class: u8,
    pub color: [u8; 3],
    pub instance: u32,
}

/// One file per tile. The folder is removed with the folder of the import.
pub(super) struct TileFiles {
    folder: PathBuf,
    waiting: BTreeMap<usize, Vec<u8>>,
    n_waiting: usize,
}

impl TileFiles {
    /// Creates an empty folder.
    pub fn create(folder: PathBuf) -> Result<Self, ImportError> {
        if folder.exists() {
            fs::remove_dir_all(&folder).at(&folder)?;
        }
        fs::create_dir_all(&folder).at(&folder)?;
        Ok(Self { folder, waiting: BTreeMap::new(), n_waiting: 0 })
    }

    fn path(&self, tile: usize) -> PathBuf {
        self.folder.join(format!("{tile:07}"))
    }

    /// Adds a point to a tile.
    pub fn add(&mut self, tile: usize, added: &TilePoint) -> Result<(), ImportError> {
        let TilePoint { point, class, color, instance } = added;
        let waiting = self.waiting.entry(tile).or_default();
        waiting.extend_from_slice(bytes_from_rows(std::slice::from_ref(point)));
        waiting.push(*class);
        waiting.extend(color);
        waiting.extend(instance.to_le_bytes());
        self.n_waiting += ROW_BYTES;
        if self.n_waiting >= MAX_WAITING { self.write() } else { Ok(()) }
    }

    fn write(&mut self) -> Result<(), ImportError> {
        for (tile, bytes) in std::mem::take(&mut self.waiting) {
            let path = self.path(tile);
            let mut file = OpenOptions::new().create(true).append(true).open(&path).at(&path)?;
            file.write_all(&bytes).at(&path)?;
        }
        self.n_waiting = 0;
        Ok(())
    }

    /// Passes the points of a tile to `take`, in parts that fit in a submap, each sorted by sweep and time. Removes the file.
    pub fn take(
        &mut self,
        tile: usize,
        mut take: impl FnMut(&[TilePoint]) -> Result<(), ImportError>,
    ) -> Result<(), ImportError> {
        if self.n_waiting > 0 {
            self.write()?;
        }
        let path = self.path(tile);
        if !path.exists() {
            return Ok(());
        }
        let mut file = regular_file::open(&path).at(&path)?;
        let mut left = file.metadata().at(&path)?.len() as usize / ROW_BYTES;
        while left > 0 {
            let n = left.min(MAX_POINTS);
            let mut bytes = vec![0; n * ROW_BYTES];
            file.read_exact(&mut bytes).at(&path)?;
            let mut points: Vec<TilePoint> = bytes.chunks_exact(ROW_BYTES).filter_map(tile_point).collect();
            drop(bytes);
            // Stable: points of equal time keep the order of the file.
            points.sort_by_key(|found| (found.point.sweep_idx, found.point.offset_nanos));
            take(&points)?;
            left -= n;
        }
        fs::remove_file(&path).at(&path)
    }
}

fn tile_point(bytes: &[u8]) -> Option<TilePoint> {
    let (point, rest) = bytes.split_at_checked(size_of::<SubmapPoint>())?;
    let point = *rows_from_bytes::<SubmapPoint>(point)?.first()?;
    let ([class, color @ ..], instance) = rest.split_first_chunk::<4>()?;
    let instance = u32::from_le_bytes(*instance.first_chunk()?);
    Some(TilePoint { point, class: *class, color: *color, instance })
}
