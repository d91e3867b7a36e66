//! Top views, read from the bytes of TIFF files.

use crate::support::{options, utm, write_run};
use std::path::Path;
use surveying::{RasterOptions, RunFolder, write_rasters};

/// One level of an image.
struct Level {
    width: usize,
    height: usize,
    /// Tiles, decompressed, row by row.
    tiles: Vec<Vec<u8>>,
}

fn read(path: &Path) -> (Vec<Level>, Vec<u8>) {
    let bytes = std::fs::read(path).expect("is there");
    let word = |at: usize| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
    let long = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes")) as usize;
    let mut at = long(4);
    let mut levels = Vec::new();
    while at != 0 {
        let n = word(at);
        let entry =
            |tag: usize| (0..n).map(|k| at + 2 + 12 * k).find(|entry| word(*entry) == tag).expect("has the tag");
        let longs = |tag: usize| -> Vec<usize> {
            let entry = entry(tag);
            let n = long(entry + 4);
            let begin = if n == 1 { entry + 8 } else { long(entry + 8) };
            (0..n).map(|k| long(begin + 4 * k)).collect()
        };
        let tile = |(place, n_bytes): (&usize, &usize)| {
            let mut decoder = flate2::read::ZlibDecoder::new(&bytes[*place..place + n_bytes]);
            let mut tile = Vec::new();
            std::io::Read::read_to_end(&mut decoder, &mut tile).expect("decompresses");
            tile
        };
        let tiles = longs(324).iter().zip(&longs(325)).map(tile).collect();
        levels.push(Level { width: longs(256)[0], height: longs(257)[0], tiles });
        at = long(at + 2 + 12 * n);
    }
    (levels, bytes)
}

#[test]
fn cells_have_the_heights_classes_and_colors_of_their_points() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let out = folder.path().join("out");
    std::fs::create_dir(&out).expect("made");
    // A road along 100 m, and a wall over its start. Every fifth point moves and is left out.
    let mut points: Vec<([f64; 3], u8)> = (0..500).map(|i| ([f64::from(i) * 0.2, 0.0, 1.0], 7)).collect();
    points.push(([0.2, 0.0, 6.0], 2));
    points.insert(500, ([0.2, 0.0, 9.0], 10));
    write_run(&run, &[(points, true)]);
    let opened = RunFolder::open(&run).expect("opens");
    let frame = utm(opened.georeference.as_ref().expect("is placed"));
    let rasters = RasterOptions { cell_mm: 200, class_colors: [[1, 2, 3]; 256] };
    let names = write_rasters(std::slice::from_ref(&opened), &frame, &options(), rasters, &out).expect("writes");
    assert_eq!(names, ["height.tif", "terrain.tif", "class.tif", "color.tif"]);
    // The wall and the ground are in the same cell.
    let [x, y, z] = frame.from_cloud([0.2, 0.0, 6.0]).expect("converts");
    let column = (x / 0.2).floor() as i64;
    let row = (y / 0.2).floor() as i64;
    for (name, bytes_of_cell) in [("height.tif", 4), ("terrain.tif", 4), ("class.tif", 1), ("color.tif", 4)] {
        let (levels, bytes) = read(&out.join(name));
        let first = &levels[0];
        assert!(
            first.width == 256 * first.width.div_ceil(256) && first.tiles.len() == first.width * first.height / 65_536
        );
        assert!(levels.len() >= 2, "100 m are more than a tile of 51 m");
        assert_eq!(levels.last().expect("has some").tiles.len(), 1);
        let tile = first.tiles.iter().find_map(|tile| {
            let at = (255 - row.rem_euclid(256) as usize) * 256 + column.rem_euclid(256) as usize;
            let cell = tile[at * bytes_of_cell..][..bytes_of_cell].to_vec();
            let is_wall = match name {
                "class.tif" => cell == [2],
                "color.tif" => cell[3] == 255 && cell[..2] == [10, 20],
                "height.tif" => (f32::from_le_bytes(cell.clone().try_into().expect("4 bytes")) - z as f32).abs() < 2e-3,
                _ => (f32::from_le_bytes(cell.clone().try_into().expect("4 bytes")) - (z - 5.0) as f32).abs() < 0.01,
            };
            is_wall.then_some(())
        });
        assert!(tile.is_some(), "{name}: no tile has the wall at its cell");
        let left = (column.div_euclid(256) * 256) as f64 * 0.2;
        let has_double = bytes.windows(8).any(|window| window == left.to_le_bytes());
        assert!(has_double, "{name}: the tie point is at {left}");
        // Moving points, 9 m above the road, are left out.
        if name == "height.tif" {
            let highest =
                first.tiles.iter().flat_map(|tile| tile.as_chunks::<4>().0).map(|cell| f32::from_le_bytes(*cell));
            assert!(highest.fold(f32::MIN, f32::max) < z as f32 + 1.0);
        }
    }
}
