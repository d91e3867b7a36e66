//! Cloud-Optimized GeoTIFF: directories of all levels, then the tiles, coarsest level first (OGC 21-026).
//!
//! The crate tiff writes strips, and needs an extra feature for compression; a directory is a page of code.

use super::Tile;
use super::cells::{Cells, TILE};
use super::content::Content;
use super::directory::{Layout, Tags};
use crate::error::DeliverError;
use crate::target_frame::TargetFrame;
use files::atomic_file::{AtomicFile, write_atomic};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Largest size of a file with offsets of 32 bits, bytes.
const CLASSIC_BYTES: u64 = u32::MAX as u64;

/// Position and number of the tiles of an image.
pub(super) struct Grid {
    /// The tile at the upper left, from the origin of the coordinates.
    pub(super) low: Tile,
    /// Columns and rows of tiles at full resolution.
    pub(super) size: [usize; 2],
    pub(super) n_levels: usize,
    pub(super) cell_m: f64,
}

/// Compressed tiles of an image, in a temporary file until all of them exist.
pub(super) struct ImageTiles<'a> {
    content: Content<'a>,
    file: File,
    folder: PathBuf,
    stored: Mutex<Stored>,
}

/// A tile in the image.
#[derive(Clone, Copy, Default)]
struct TilePlace {
    at: u64,
    n_bytes: u32,
}

/// A tile in the temporary file.
#[derive(Clone, Copy)]
struct StoredTile {
    at: u64,
    n_bytes: usize,
}

/// A directory in the image.
struct DirectoryPlace {
    layout: Layout,
    level: usize,
    at: u64,
    is_last: bool,
}

#[derive(Default)]
struct Stored {
    n_bytes: u64,
    /// Stored tiles by level and tile.
    tiles: BTreeMap<(usize, Tile), StoredTile>,
}

fn compressed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing to a vector cannot fail.
    let _ = encoder.write_all(bytes);
    encoder.finish().unwrap_or_default()
}

impl<'a> ImageTiles<'a> {
    pub(super) fn create(folder: &Path, content: Content<'a>) -> Result<Self, DeliverError> {
        let file = tempfile::tempfile_in(folder).map_err(DeliverError::file(folder, "create a temporary file"))?;
        Ok(Self { content, file, folder: folder.to_owned(), stored: Mutex::default() })
    }

    pub(super) fn add(&self, level: usize, tile: Tile, cells: &Cells) -> Result<(), DeliverError> {
        let bytes = compressed(&self.content.encode(cells));
        let mut stored = self.stored.lock().unwrap_or_else(PoisonError::into_inner);
        let at = stored.n_bytes;
        stored.n_bytes += bytes.len() as u64;
        stored.tiles.insert((level, tile), StoredTile { at, n_bytes: bytes.len() });
        drop(stored);
        self.file.write_all_at(&bytes, at).map_err(DeliverError::file(&self.folder, "write a temporary file"))
    }

    /// Writes the image, and the names of its values next to it.
    pub(super) fn write(&self, path: &Path, grid: &Grid, frame: &TargetFrame<'_>) -> Result<(), DeliverError> {
        let file = AtomicFile::create(path).map_err(DeliverError::file(path, "create"))?;
        let written = self.write_to(file.file(), grid, frame, CLASSIC_BYTES).and_then(|()| file.commit_unsynced());
        written.map_err(DeliverError::file(path, "write"))?;
        let Some(text) = self.content.auxiliary() else { return Ok(()) };
        let path = path.with_added_extension("aux.xml");
        write_atomic(&path, text.as_bytes()).map_err(DeliverError::file(&path, "write"))
    }

    /// Writes the image, as `BigTIFF` if a classic file would have more than `classic_bytes`.
    fn write_to(&self, file: &File, grid: &Grid, frame: &TargetFrame<'_>, classic_bytes: u64) -> io::Result<()> {
        let stored = self.stored.lock().unwrap_or_else(PoisonError::into_inner);
        let empty = compressed(&self.content.empty());
        // The sizes of the directories do not depend on the offsets of the tiles.
        let first_tile = |layout: Layout| {
            let directory = |level| {
                let place = DirectoryPlace { layout, level, at: 0, is_last: false };
                self.directory(grid, &place, frame, &[]).len() as u64
            };
            layout.signature().len() as u64 + (0..grid.n_levels).map(directory).sum::<u64>()
        };
        let n_tile_bytes = stored.n_bytes + (grid.n_levels * empty.len()) as u64;
        let fits = first_tile(Layout::Classic) + n_tile_bytes <= classic_bytes;
        let layout = if fits { Layout::Classic } else { Layout::Big };
        let mut at = first_tile(layout);
        let mut places: Vec<Vec<TilePlace>> = vec![Vec::new(); grid.n_levels];
        // Tiles in the file: all existing tiles, and for each level one empty tile to which all positions without points
        // refer.
        let mut order: Vec<Option<StoredTile>> = Vec::new();
        for level in (0..grid.n_levels).rev() {
            let [columns, rows] = grid.tiles(level);
            let empty_at = at;
            order.push(None);
            at += empty.len() as u64;
            for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row as i64, column as i64))) {
                let found = stored.tiles.get(&(level, (column, row))).copied();
                places[level].push(match found {
                    Some(tile) => TilePlace { at, n_bytes: tile.n_bytes as u32 },
                    None => TilePlace { at: empty_at, n_bytes: empty.len() as u32 },
                });
                if let Some(tile) = found {
                    order.push(found);
                    at += tile.n_bytes as u64;
                }
            }
        }
        let mut writer = BufWriter::with_capacity(1 << 20, file);
        writer.write_all(layout.signature())?;
        let mut at = layout.signature().len() as u64;
        for (level, places) in places.iter().enumerate() {
            let place = DirectoryPlace { layout, level, at, is_last: level + 1 == grid.n_levels };
            let directory = self.directory(grid, &place, frame, places);
            at += directory.len() as u64;
            writer.write_all(&directory)?;
        }
        for tile in order {
            let Some(StoredTile { at, n_bytes }) = tile else {
                writer.write_all(&empty)?;
                continue;
            };
            let mut bytes = vec![0; n_bytes];
            self.file.read_exact_at(&mut bytes, at)?;
            writer.write_all(&bytes)?;
        }
        writer.flush()
    }

    /// The directory of a level.
    fn directory(&self, grid: &Grid, place: &DirectoryPlace, frame: &TargetFrame<'_>, places: &[TilePlace]) -> Vec<u8> {
        let &DirectoryPlace { layout, level, at, is_last } = place;
        let [columns, rows] = grid.tiles(level);
        let places = if places.is_empty() { &vec![TilePlace::default(); columns * rows] } else { places };
        let [width, height] = grid.size.map(|n| (n * TILE).div_ceil(1 << level) as u32);
        let bits = self.content.bits();
        let n_samples = bits.len() as u16;
        let mut tags = Tags::new(layout);
        tags.longs(254, &[u32::from(level > 0)]);
        tags.longs(256, &[width]);
        tags.longs(257, &[height]);
        tags.shorts(258, &bits);
        // Deflate.
        tags.shorts(259, &[8]);
        let palette = self.content.palette();
        let photometric = match (&palette, self.content.is_color()) {
            (Some(_), _) => 3,
            (None, true) => 2,
            (None, false) => 1,
        };
        tags.shorts(262, &[photometric]);
        tags.shorts(277, &[n_samples]);
        tags.shorts(284, &[1]);
        if let Some(colors) = palette {
            let channel = |channel: usize| colors.iter().map(move |color| u16::from(color[channel]) * 257);
            tags.shorts(320, &(0..3).flat_map(channel).collect::<Vec<u16>>());
        }
        tags.shorts(322, &[TILE as u16]);
        tags.shorts(323, &[TILE as u16]);
        let begins: Vec<u64> = places.iter().map(|place| place.at).collect();
        let sizes: Vec<u32> = places.iter().map(|place| place.n_bytes).collect();
        tags.places(324, &begins);
        tags.longs(325, &sizes);
        if self.content.is_color() {
            // The fourth sample is opacity.
            tags.shorts(338, &[2]);
        }
        // Unsigned integers, or floats.
        tags.shorts(339, &vec![if n_samples == 1 && bits[0] == 32 { 3 } else { 1 }; bits.len()]);
        if level == 0 {
            tags.doubles(33_550, &[grid.cell_m, grid.cell_m, 0.0]);
            let side_m = TILE as f64 * grid.cell_m;
            let corner = [grid.low.0 as f64 * side_m, (grid.low.1 + 1) as f64 * side_m];
            tags.doubles(33_922, &[0.0, 0.0, 0.0, corner[0], corner[1], 0.0]);
            tags.shorts(34_735, &geo_keys(frame));
        }
        if level == 0 {
            tags.text(42_112, &self.content.metadata());
        }
        if let Some(value) = self.content.no_data() {
            tags.text(42_113, &value);
        }
        tags.bytes(at, is_last)
    }
}

impl Grid {
    /// Columns and rows of tiles of a level.
    fn tiles(&self, level: usize) -> [usize; 2] {
        self.size.map(|n| n.div_ceil(1 << level))
    }
}

/// Keys of the coordinate reference system (OGC 19-008): sorted, each with a number.
fn geo_keys(frame: &TargetFrame<'_>) -> Vec<u16> {
    // Pixels represent areas, not points.
    let mut keys = vec![(1025, 1)];
    if let Some((crs, vertical)) = frame.crs() {
        // A projected system by its number, in m.
        keys.extend([(1024, 1), (3072, crs.epsg() as u16), (3076, 9001)]);
        if let Some(epsg) = vertical.epsg() {
            keys.extend([(4096, epsg as u16), (4099, 9001)]);
        }
    }
    keys.sort_unstable();
    let mut words = vec![1, 1, 0, keys.len() as u16];
    words.extend(keys.into_iter().flat_map(|(key, value)| [key, 0, 1, value]));
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of a directory at a byte: the values of tag `tag`, and the offset of the next directory.
    fn values(bytes: &[u8], layout: Layout, at: u64, tag: u16) -> (Vec<u64>, u64) {
        let (count_bytes, word) = if layout == Layout::Big { (8, 8) } else { (2, 4) };
        let number =
            |at: usize, n: usize| bytes[at..at + n].iter().rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte));
        let (at, n_entries) = (at as usize, number(at as usize, count_bytes) as usize);
        let entry = |k: usize| at + count_bytes + k * (4 + 2 * word);
        let found = (0..n_entries).map(entry).find(|at| number(*at, 2) == u64::from(tag)).expect("has the tag");
        let size = match number(found + 2, 2) {
            3 => 2,
            4 => 4,
            16 => 8,
            kind => panic!("type {kind}"),
        };
        let n = number(found + 4, word) as usize;
        let first = if n * size <= word { found + 4 + word } else { number(found + 4 + word, word) as usize };
        ((0..n).map(|k| number(first + k * size, size)).collect(), number(entry(n_entries), word))
    }

    #[test]
    fn large_image_is_a_big_tiff_with_the_same_tiles() {
        let folder = tempfile::tempdir().expect("a folder");
        let image = ImageTiles::create(folder.path(), Content::Height).expect("creates");
        let grid = Grid { low: (0, 0), size: [2, 1], n_levels: 2, cell_m: 0.2 };
        let mut tiles = Vec::new();
        for (level, tile, height) in [(0, (1, 0), 2.5), (1, (0, 0), 7.0)] {
            let mut cells = Cells::joined(&[]);
            cells.height.fill(height);
            image.add(level, tile, &cells).expect("adds");
            tiles.push(compressed(&image.content.encode(&cells)));
        }
        let write = |name: &str, classic_bytes: u64| {
            let path = folder.path().join(name);
            let file = File::create(&path).expect("creates");
            image.write_to(&file, &grid, &TargetFrame::local(None), classic_bytes).expect("writes");
            std::fs::read(&path).expect("reads")
        };
        let empty = compressed(&image.content.empty());
        let classic = write("classic.tif", CLASSIC_BYTES);
        for (bytes, layout) in [(&classic, Layout::Classic), (&write("big.tif", classic.len() as u64 - 1), Layout::Big)]
        {
            assert!(bytes.starts_with(layout.signature()), "{layout:?}");
            let first = layout.signature().len() as u64;
            let (begins, second) = values(bytes, layout, first, 324);
            let (sizes, _) = values(bytes, layout, first, 325);
            let tile = |begin: u64, size: u64| &bytes[begin as usize..(begin + size) as usize];
            assert_eq!(tile(begins[0], sizes[0]), empty, "{layout:?}");
            assert_eq!(tile(begins[1], sizes[1]), tiles[0], "{layout:?}");
            let (begins, last) = values(bytes, layout, second, 324);
            let (sizes, _) = values(bytes, layout, second, 325);
            assert_eq!((tile(begins[0], sizes[0]), last), (&tiles[1][..], 0), "{layout:?}");
            assert_eq!(values(bytes, layout, first, 256).0, [2 * TILE as u64]);
        }
        assert_eq!(write("fits.tif", classic.len() as u64), classic);
    }
}
