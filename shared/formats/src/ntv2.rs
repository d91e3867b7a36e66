//! Grids of datum shifts in the format `NTv2` (National Transformation version 2, Geodetic Survey of Canada): shifts of latitude and longitude
//! between two datums at nodes, with finer grids inside of coarser ones.
//!
//! The file has records of 16 bytes in one byte order. A header record is a name of 8 bytes and a value of 8 bytes.
//!
//! | records | content |
//! |---|---|
//! | 11 | overview: `NUM_OREC` = 11 (`i32`), `NUM_SREC` = 11, `NUM_FILE` = number of grids, `GS_TYPE` = unit, the names of both datums |
//! | 11 for each grid | `SUB_NAME`, `PARENT` (`NONE` or a name), dates, `S_LAT`, `N_LAT`, `E_LONG`, `W_LONG`, `LAT_INC`, `LONG_INC` (`f64`, seconds of arc, longitude positive to the **west**), `GS_COUNT` (`i32`, nodes) |
//! | a record for each node | shifts of latitude and longitude and their accuracies, `f32`, seconds of arc; rows from south to north, in a row from **east to west** |
//!
//! The crate proj4rs also reads the format, but into a table of the whole process, and without checks of sizes.

use files::regular_file;
use std::io;
use std::path::{Path, PathBuf};

const RECORD_BYTES: usize = 16;
/// Records of the overview and of the header of each grid.
const HEADER_RECORDS: usize = 11;
/// The largest public files have some hundred grids.
const MAX_GRIDS: usize = 10_000;
/// Rounds of the inverse. Shifts change by less than 1 part in 1000 with the position, so each round gains three digits; the rounds end
/// earlier.
const ROUNDS: usize = 10;
/// Largest difference of the inverse, degrees: a hundredth of a micrometre.
const INVERSE_DEG: f64 = 1e-13;

/// Shifts of latitude and longitude.
#[derive(Clone, Debug)]
pub struct DatumGrid {
    grids: Vec<SubGrid>,
}

/// One grid of a file. Angles are in degrees, longitudes positive to the east.
#[derive(Clone, Debug)]
struct SubGrid {
    name: String,
    /// Index of the grid that contains this one.
    parent: Option<usize>,
    /// Latitude and longitude of the south-east corner.
    south_east: [f64; 2],
    step: [f64; 2],
    n_rows: usize,
    n_cols: usize,
    /// Shifts of latitude to the north and longitude to the west, seconds of arc, from the south-east corner.
    shifts: Vec<[f32; 2]>,
}

/// Error of a file that is not an `NTv2` grid.
#[derive(Debug, thiserror::Error)]
pub enum Ntv2Error {
    /// The file cannot be read.
    #[error("{}: cannot read: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The content does not have the format.
    #[error("{}: is not an NTv2 grid (.gsb): {rule}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The value found and the rule.
        rule: String,
    },
}

/// Header records of one part of the file.
struct Header<'a> {
    bytes: &'a [u8],
    is_little: bool,
    /// Offset in the file, for errors.
    at: usize,
}

impl<'a> Header<'a> {
    fn new(file: &'a [u8], at: usize, is_little: bool) -> Result<Self, String> {
        let end = at.saturating_add(HEADER_RECORDS * RECORD_BYTES);
        let bytes = file.get(at..end).ok_or_else(|| format!("{} bytes, a header ends at byte {end}", file.len()))?;
        Ok(Self { bytes, is_little, at })
    }

    /// The value of a record, which must have this name.
    fn value(&self, record: usize, name: &str) -> Result<[u8; 8], String> {
        let (found, value) = self.bytes[record * RECORD_BYTES..(record + 1) * RECORD_BYTES].split_at(8);
        if text(found) != name {
            let at = self.at + record * RECORD_BYTES;
            return Err(format!("record {:?} at byte {at}, expected {name}", text(found)));
        }
        Ok(std::array::from_fn(|k| value[k]))
    }
    fn text(&self, record: usize, name: &str) -> Result<String, String> {
        Ok(text(&self.value(record, name)?))
    }
    fn count(&self, record: usize, name: &str) -> Result<usize, String> {
        let [a, b, c, d, ..] = self.value(record, name)?;
        let bytes = [a, b, c, d];
        let count = if self.is_little { i32::from_le_bytes(bytes) } else { i32::from_be_bytes(bytes) };
        usize::try_from(count).map_err(|_| format!("{name} is {count} at byte {}", self.at + record * RECORD_BYTES))
    }
    fn number(&self, record: usize, name: &str) -> Result<f64, String> {
        let bytes = self.value(record, name)?;
        let number = if self.is_little { f64::from_le_bytes(bytes) } else { f64::from_be_bytes(bytes) };
        let at = self.at + record * RECORD_BYTES;
        // A turn has 1 296 000 seconds.
        (number.abs() <= 2_592_000.0).then_some(number).ok_or_else(|| format!("{name} is {number} at byte {at}"))
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).trim_matches(|letter: char| letter == '\0' || letter.is_whitespace()).to_owned()
}

impl DatumGrid {
    /// Reads a file.
    pub fn load(path: &Path) -> Result<Self, Ntv2Error> {
        let bytes = regular_file::read(path).map_err(|source| Ntv2Error::File { path: path.to_owned(), source })?;
        Self::decode(&bytes).map_err(|rule| Ntv2Error::Content { path: path.to_owned(), rule })
    }

    /// Decodes the content of a file. The error is the rule that it breaks.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        let is_little = bytes.get(8..12) == Some(&[HEADER_RECORDS as u8, 0, 0, 0]);
        let overview = Header::new(bytes, 0, is_little)?;
        for (record, name) in [(0, "NUM_OREC"), (1, "NUM_SREC")] {
            let found = overview.count(record, name)?;
            if found != HEADER_RECORDS {
                return Err(format!("{name} is {found}, expected {HEADER_RECORDS}"));
            }
        }
        let n_grids = overview.count(2, "NUM_FILE")?;
        if !(1..=MAX_GRIDS).contains(&n_grids) {
            return Err(format!("NUM_FILE is {n_grids}, expected 1 to {MAX_GRIDS}"));
        }
        let unit = overview.text(3, "GS_TYPE")?;
        if unit != "SECONDS" {
            return Err(format!("GS_TYPE is {unit:?}, expected SECONDS"));
        }
        let mut grids: Vec<SubGrid> = Vec::new();
        let mut parents = Vec::new();
        let mut at = HEADER_RECORDS * RECORD_BYTES;
        for _ in 0..n_grids {
            let header = Header::new(bytes, at, is_little)?;
            parents.push(header.text(1, "PARENT")?);
            let grid = SubGrid::decode(&header, bytes)?;
            at += (HEADER_RECORDS + grid.shifts.len()) * RECORD_BYTES;
            grids.push(grid);
        }
        for (k, parent) in parents.iter().enumerate().filter(|(_, parent)| *parent != "NONE") {
            let found = grids.iter().position(|grid| grid.name == *parent).filter(|found| *found != k);
            let name = &grids[k].name;
            grids[k].parent =
                Some(found.ok_or_else(|| format!("grid {name:?} has the parent {parent:?}, which is absent"))?);
        }
        Ok(Self { grids })
    }

    /// Position in the second datum of a position in the first, latitude and longitude in degrees. `None` outside of the grid.
    pub fn forward(&self, position_deg: [f64; 2]) -> Option<[f64; 2]> {
        let [north, east] = self.shift(position_deg)?;
        Some([position_deg[0] + north, position_deg[1] + east])
    }

    /// Position in the first datum of a position in the second, latitude and longitude in degrees. `None` outside of the grid.
    pub fn inverse(&self, position_deg: [f64; 2]) -> Option<[f64; 2]> {
        let mut found = position_deg;
        for _ in 0..ROUNDS {
            let [north, east] = self.shift(found)?;
            let next = [position_deg[0] - north, position_deg[1] - east];
            let change = (next[0] - found[0]).abs().max((next[1] - found[1]).abs());
            found = next;
            if change < INVERSE_DEG {
                break;
            }
        }
        Some(found)
    }

    /// Shift to the north and east at a position of the first datum, degrees, bilinear between the nodes of the finest grid.
    fn shift(&self, position_deg: [f64; 2]) -> Option<[f64; 2]> {
        let contains = |parent: Option<usize>| {
            let mut children = self.grids.iter().enumerate().filter(move |(_, grid)| grid.parent == parent);
            children.find_map(|(k, grid)| grid.cell(position_deg).map(|cell| (k, cell)))
        };
        let mut found = contains(None)?;
        // A cycle of parents has no grid without parent; the count guards all the same.
        for _ in 0..self.grids.len() {
            match contains(Some(found.0)) {
                Some(finer) => found = finer,
                None => break,
            }
        }
        let (k, [row, col]) = found;
        Some(self.grids[k].bilinear(row, col))
    }
}

impl SubGrid {
    fn decode(header: &Header<'_>, file: &[u8]) -> Result<Self, String> {
        let name = header.text(0, "SUB_NAME")?;
        let seconds = [(4, "S_LAT"), (5, "N_LAT"), (6, "E_LONG"), (7, "W_LONG"), (8, "LAT_INC"), (9, "LONG_INC")];
        let mut values = [0.0; 6];
        for (value, (record, name)) in values.iter_mut().zip(seconds) {
            *value = header.number(record, name)?;
        }
        let [south, north, east, west, lat_step, lon_step] = values;
        let n_nodes = header.count(10, "GS_COUNT")?;
        if !(lat_step > 0.0 && lon_step > 0.0 && north > south && west > east) {
            return Err(format!(
                "grid {name:?} from {south} to {north} and {east} to {west} in steps of {lat_step} and {lon_step} seconds"
            ));
        }
        // Seconds are at most 2 592 000; steps of a millionth of a second give numbers that fit.
        let n_rows = ((north - south) / lat_step).round() + 1.0;
        let n_cols = ((west - east) / lon_step).round() + 1.0;
        let at = header.at + HEADER_RECORDS * RECORD_BYTES;
        let nodes = file.get(at..).unwrap_or_default().as_chunks::<RECORD_BYTES>().0;
        if n_rows < 2.0 || n_cols < 2.0 || n_rows * n_cols != n_nodes as f64 || nodes.len() < n_nodes {
            return Err(format!(
                "grid {name:?} at byte {}: {n_rows} rows of {n_cols} columns, {n_nodes} nodes stated, {} in the file",
                header.at,
                nodes.len()
            ));
        }
        let float =
            |bytes: [u8; 4]| if header.is_little { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) };
        let shifts: Vec<[f32; 2]> = nodes[..n_nodes]
            .iter()
            .map(|node| [0, 4].map(|at| float([node[at], node[at + 1], node[at + 2], node[at + 3]])))
            .collect();
        if let Some(k) = shifts.iter().position(|shift| shift.iter().any(|value| !value.is_finite())) {
            return Err(format!("grid {name:?}: the shift at byte {} is not finite", at + k * RECORD_BYTES));
        }
        Ok(Self {
            name,
            parent: None,
            south_east: [south / 3600.0, -east / 3600.0],
            step: [lat_step / 3600.0, lon_step / 3600.0],
            n_rows: n_rows as usize,
            n_cols: n_cols as usize,
            shifts,
        })
    }

    /// Row from the south and column from the east of a position, in nodes.
    fn cell(&self, [latitude, longitude]: [f64; 2]) -> Option<[f64; 2]> {
        let row = (latitude - self.south_east[0]) / self.step[0];
        let col = (self.south_east[1] - longitude) / self.step[1];
        let inside = |value: f64, n: usize| (0.0..=(n - 1) as f64).contains(&value);
        (inside(row, self.n_rows) && inside(col, self.n_cols)).then_some([row, col])
    }

    /// Shift to the north and east, degrees.
    fn bilinear(&self, row: f64, col: f64) -> [f64; 2] {
        // The last row and column belong to the cell before them.
        let i = row.floor().min((self.n_rows - 2) as f64);
        let j = col.floor().min((self.n_cols - 2) as f64);
        let up = row - i;
        let west = col - j;
        let value = |i: usize, j: usize, axis: usize| f64::from(self.shifts[i * self.n_cols + j][axis]);
        let i = i as usize;
        let j = j as usize;
        let [north, to_west] = [0, 1].map(|axis| {
            let below = value(i, j, axis) * (1.0 - west) + value(i, j + 1, axis) * west;
            let above = value(i + 1, j, axis) * (1.0 - west) + value(i + 1, j + 1, axis) * west;
            below * (1.0 - up) + above * up
        });
        [north / 3600.0, -to_west / 3600.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of a file.
    struct Part {
        name: &'static str,
        parent: &'static str,
        /// South, north, east and west, degrees, longitudes positive to the west.
        bounds: [f64; 4],
        step: f64,
        /// Shift of latitude and of longitude to the west, seconds, of latitude and longitude (west) in degrees.
        shift: fn(f64, f64) -> [f32; 2],
    }

    fn file(parts: &[Part], is_little: bool) -> Vec<u8> {
        let int = |value: i32| if is_little { value.to_le_bytes() } else { value.to_be_bytes() };
        let count = |name: &str, value: i32| [format!("{name:8}").as_bytes(), &int(value), &[0; 4]].concat();
        let double = |name: &str, value: f64| {
            let bytes = if is_little { value.to_le_bytes() } else { value.to_be_bytes() };
            [format!("{name:8}").as_bytes(), &bytes[..]].concat()
        };
        let word = |name: &str, value: &str| format!("{name:8}{value:8}").into_bytes();
        let float = |value: f32| if is_little { value.to_le_bytes() } else { value.to_be_bytes() };
        let mut records = vec![count("NUM_OREC", 11), count("NUM_SREC", 11), count("NUM_FILE", parts.len() as i32)];
        records.push(word("GS_TYPE", "SECONDS"));
        let names = ["VERSION", "SYSTEM_F", "SYSTEM_T", "MAJOR_F", "MINOR_F", "MAJOR_T", "MINOR_T"];
        records.extend(names.map(|name| word(name, "")));
        for Part { name, parent, bounds, step, shift } in parts {
            let n_rows = ((bounds[1] - bounds[0]) / step).round() as usize + 1;
            let n_cols = ((bounds[3] - bounds[2]) / step).round() as usize + 1;
            records.extend([word("SUB_NAME", name), word("PARENT", parent), word("CREATED", ""), word("UPDATED", "")]);
            let names = ["S_LAT", "N_LAT", "E_LONG", "W_LONG"];
            records.extend(names.iter().zip(bounds).map(|(name, degrees)| double(name, degrees * 3600.0)));
            records.extend([double("LAT_INC", step * 3600.0), double("LONG_INC", step * 3600.0)]);
            records.push(count("GS_COUNT", (n_rows * n_cols) as i32));
            for (row, col) in (0..n_rows).flat_map(|row| (0..n_cols).map(move |col| (row, col))) {
                let [lat, lon] = shift(bounds[0] + row as f64 * step, bounds[2] + col as f64 * step);
                records.push([lat, lon, 0.1, 0.1].into_iter().flat_map(float).collect());
            }
        }
        records.concat()
    }

    /// Latitudes 50 to 52, longitudes -1 to 3, with a finer grid around latitude 51, longitude 2.
    fn two_grids() -> [Part; 2] {
        let coarse = |lat: f64, west: f64| [(lat - 50.0) as f32 * 3.6, west as f32 * 7.2];
        let fine = |_: f64, _: f64| [36.0, -72.0];
        [
            Part { name: "COARSE", parent: "NONE", bounds: [50.0, 52.0, -3.0, 1.0], step: 1.0, shift: coarse },
            Part { name: "FINE", parent: "COARSE", bounds: [50.75, 51.25, -2.25, -1.75], step: 0.25, shift: fine },
        ]
    }

    #[test]
    fn shifts_are_bilinear_and_the_finest_grid_counts() {
        for is_little in [true, false] {
            let grid = DatumGrid::decode(&file(&two_grids(), is_little)).expect("is a grid");
            // 3.6 seconds are 0.001 degrees; longitudes to the west are negative ones to the east.
            for (position, expected) in [
                ([50.5, 0.25], [50.5005, 0.2505]),
                ([52.0, 3.0], [52.002, 3.006]),
                ([51.0, 2.0], [51.01, 2.02]),
                ([50.0, -1.0], [50.0, -1.002]),
            ] {
                let found = grid.forward(position).expect("is inside");
                assert!((0..2).all(|k| (found[k] - expected[k]).abs() < 1e-6), "{position:?}: {found:?}");
                let back = grid.inverse(found);
                // Shifted positions of edges may be outside.
                let is_back = |back: [f64; 2]| (0..2).all(|k| (back[k] - position[k]).abs() < 1e-12);
                assert!(back.is_none_or(is_back), "{position:?}: {back:?}");
            }
            assert!(grid.inverse([50.5005, 0.2505]).is_some());
            for position in [[49.99, 0.0], [50.5, 3.01], [50.5, -1.01], [f64::NAN, 0.0]] {
                assert_eq!(grid.forward(position), None, "{position:?}");
            }
        }
    }

    #[test]
    fn other_and_damaged_files_are_refused() {
        let sound = file(&two_grids(), true);
        let changed = |at: usize, bytes: &[u8]| {
            let mut file = sound.clone();
            file[at..at + bytes.len()].copy_from_slice(bytes);
            file
        };
        let first = HEADER_RECORDS * RECORD_BYTES;
        for (bytes, rule) in [
            (b"no grid".to_vec(), "7 bytes, a header ends at byte 176"),
            (changed(0, b"X"), "record \"XUM_OREC\" at byte 0, expected NUM_OREC"),
            (changed(40, &[0; 4]), "NUM_FILE is 0, expected 1 to 10000"),
            (changed(40, &[3, 0, 0, 0]), "a header ends at byte"),
            (changed(56, b"DEGREES "), "GS_TYPE is \"DEGREES\", expected SECONDS"),
            (changed(first + 72, &f64::NAN.to_le_bytes()), "S_LAT is NaN at byte 240"),
            (changed(first + 136, &0.0_f64.to_le_bytes()), "in steps of 0 and 3600 seconds"),
            (changed(first + 168, &i32::MAX.to_le_bytes()), "3 rows of 5 columns, 2147483647 nodes stated"),
            (changed(2 * first, &f32::NAN.to_le_bytes()), "the shift at byte 352 is not finite"),
            (changed(first + 24, b"OTHER   "), "has the parent \"OTHER\", which is absent"),
            (sound[..sound.len() - 1].to_vec(), "9 nodes stated, 8 in the file"),
        ] {
            let error = DatumGrid::decode(&bytes).expect_err("is refused");
            assert!(error.contains(rule), "{error}\nhas not: {rule}");
        }
    }
}
