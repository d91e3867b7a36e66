//! Top views, read from the bytes of TIFF files.

use crate::support::{options, utm, write_run};
use std::path::Path;
use surveying::{
    CloudPoint, DeliverError, GroundSample, RasterOptions, RunFolder, StaticWorld, write_contours, write_rasters,
};

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
    let rasters = RasterOptions { cell_mm: 200, class_colors: [[1, 2, 3]; 256], world: None, keeps_nodes: false };
    let written = write_rasters(std::slice::from_ref(&opened), &frame, &options(), &rasters, &out).expect("writes");
    assert_eq!(written.files, ["height.tif", "density.tif", "terrain.tif", "class.tif", "color.tif"]);
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

/// A world whose vehicles are removed, with level ground between 40 m and 44 m, which no point has.
struct LevelGround;

impl StaticWorld for LevelGround {
    fn is_removed(&self, _run: usize, point: &CloudPoint) -> bool {
        point.class == 10
    }

    fn each_ground(
        &self,
        spacing_m: f64,
        take: &mut dyn FnMut(&[GroundSample]) -> Result<(), DeliverError>,
    ) -> Result<(), DeliverError> {
        let n = (4.0 / spacing_m) as u32;
        let sample = |k: u32| GroundSample {
            xyz: [40.0 + 4.0 * f64::from(k) / f64::from(n), 0.0, 1.0],
            rgb: Some([70, 71, 72]),
        };
        take(&(0..=n).map(sample).collect::<Vec<_>>())
    }
}

#[test]
fn terrain_goes_on_below_a_vehicle_and_the_orthophoto_lacks_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    // A road along 100 m with a vehicle from 40 m to 44 m.
    let is_hidden = |x: f64| (40.0..44.0).contains(&x);
    let points = (0..1000)
        .map(|i| f64::from(i) * 0.1)
        .map(|x| if is_hidden(x) { ([x, 0.0, 2.5], 10) } else { ([x, 0.0, 1.0], 7) });
    write_run(&run, &[(points.collect(), true)]);
    let opened = RunFolder::open(&run).expect("opens");
    let frame = utm(opened.georeference.as_ref().expect("is placed"));
    let rasters =
        RasterOptions { cell_mm: 200, class_colors: [[1, 2, 3]; 256], world: Some(&LevelGround), keeps_nodes: true };
    let deliver = |n_threads: usize| {
        let out = folder.path().join(n_threads.to_string());
        std::fs::create_dir(&out).expect("made");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("a pool");
        let runs = std::slice::from_ref(&opened);
        let written = pool.install(|| write_rasters(runs, &frame, &options(), &rasters, &out)).expect("writes");
        write_contours(&written, 500, &frame, &out).expect("writes");
        (out, written)
    };
    let (out, written) = deliver(1);
    let counts = written.counts;
    // 4 m are 20 cells, and every fifth point moves, so that some cells have no other point.
    assert!((15..=30).contains(&counts.terrain_completed), "{counts:?}");
    assert!(counts.terrain_measured > 300 && counts.orthophoto_completed >= counts.terrain_completed, "{counts:?}");
    let cell = |name: &str, n_bytes: usize, x: f64| {
        let [x, y, _] = frame.from_cloud([x, 0.0, 1.0]).expect("converts");
        let [column, row] = [x, y].map(|value| (value / 0.2).floor() as i64);
        let at = (255 - row.rem_euclid(256) as usize) * 256 + column.rem_euclid(256) as usize;
        let (levels, _) = read(&out.join(name));
        levels[0].tiles.iter().map(|tile| tile[at * n_bytes..][..n_bytes].to_vec()).collect::<Vec<_>>()
    };
    // The vehicle is in the color image and the highest point, and neither in the terrain nor in the orthophoto.
    assert!(cell("terrain_source.tif", 1, 42.05).contains(&vec![2]));
    assert!(cell("terrain_source.tif", 1, 20.05).contains(&vec![1]));
    assert!(cell("orthophoto.tif", 4, 42.05).contains(&vec![70, 71, 72, 255]));
    assert!(cell("class.tif", 1, 42.05).contains(&vec![10]));
    let height = |bytes: &Vec<u8>| f32::from_le_bytes(bytes[..4].try_into().expect("4 bytes"));
    let heights: Vec<f32> =
        cell("terrain.tif", 4, 42.05).iter().map(height).filter(|height| *height > -9999.0).collect();
    let [.., road] = frame.from_cloud([42.05, 0.0, 1.0]).expect("converts");
    assert!(heights.len() == 1 && (f64::from(heights[0]) - road).abs() < 0.01, "{heights:?}, {road}");
    let text = |name: &str| std::fs::read_to_string(out.join(name)).expect("is there");
    assert!(text("terrain_source.tif.aux.xml").contains("<Category>completed</Category>"));
    assert!(text("contours.geojson").contains("urn:ogc:def:crs:EPSG::32631"));
    let (again, _) = deliver(3);
    for entry in std::fs::read_dir(&out).expect("lists") {
        let name = entry.expect("lists").file_name();
        let [a, b] = [&out, &again].map(|folder| std::fs::read(folder.join(&name)).expect("is there"));
        assert!(a == b, "{} depends on the number of threads", name.display());
    }
}
