//! Tables of poses with named columns, as Inertial Explorer, Qinertia and many programs export them: lines of a preamble,
//! a line with the names of the columns in any order, an optional line with units, then one pose per line.
//!
//! Columns are separated by commas, semicolons, tabs or blanks. Names are compared without case, blanks, `_`, `-` and
//! units (`roll(rad)`, `Heading [deg]`). Required: a time, a place, an attitude. Other columns are ignored.
//!
//! | columns | names |
//! |---|---|
//! | time | `GPSTime`, `time`, `seconds`, `sow`, `tow` (s); `stamp` (ns); a date as `2020-10-13 16:03:08.029` |
//! | week | `Week`, `GPSWeek` |
//! | place | `Latitude`, `Longitude`, `H-Ell` or `H-MSL` with `Undulation`; `Easting`, `Northing` and a height; `x`, `y`, `z` |
//! | attitude | `Roll`, `Pitch`, `Heading` (or `Yaw`, `Azimuth`); `qx`, `qy`, `qz`, `qw` |
//! | deviations | `SDNorth`, `SDEast`, `SDHeight`, `SDRoll`, `SDPitch`, `SDHeading` |

mod columns;
mod date;

use columns::{Columns, Separator};

/// Lines in which the names of the columns are searched.
const MAX_PREAMBLE: usize = 200;

/// Kind of the places of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaceKind {
    /// Latitude, longitude (degrees), height (m).
    Geodetic,
    /// Easting, northing, height (m).
    Projected,
    /// x, y, z (m).
    Local,
}

/// Kind of the times of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeKind {
    /// Seconds, of a week or of an epoch.
    Seconds,
    /// Nanoseconds since the Unix epoch.
    Nanos,
    /// Dates.
    Date,
}

/// Attitude of a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Attitude {
    /// Roll, pitch and heading, degrees.
    Angles([f64; 3]),
    /// Quaternion x y z w.
    Quaternion([f64; 4]),
}

/// A line of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseRow {
    /// Number of the line, from 1.
    pub line: usize,
    /// GPS week, if the table has it.
    pub week: Option<u32>,
    /// Time in ns: of the week, or since the epoch of its clock.
    pub time_nanos: i64,
    /// Place, see [`PlaceKind`]. Heights are above the ellipsoid if the table has the undulation.
    pub place: [f64; 3],
    /// Attitude.
    pub attitude: Attitude,
    /// Standard deviations along north, east and up, m.
    pub north_east_up_m: Option<[f64; 3]>,
    /// Standard deviations of roll, pitch and heading, degrees.
    pub roll_pitch_heading_deg: Option<[f64; 3]>,
}

/// Content of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseTable {
    /// Kind of the times.
    pub time: TimeKind,
    /// Kind of the places.
    pub place: PlaceKind,
    /// Whether heights are above the geoid because the table has no undulation.
    pub is_above_geoid: bool,
    /// Poses in the order of the file.
    pub rows: Vec<PoseRow>,
}

/// A table that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {fault}")]
pub struct TableError {
    /// Line, from 1.
    pub line: usize,
    /// Fault of the line.
    pub fault: TableFault,
}

/// Fault of a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TableFault {
    /// No line names the columns.
    #[error(
        "no line names the columns; expected a time, a place and an attitude, such as GPSTime, Latitude, Longitude, H-Ell, Roll, Pitch, Heading"
    )]
    NoHeader,
    /// The columns lack a quantity.
    #[error("the columns have no {lacking}; found {found}")]
    Lacking {
        /// The quantity with the names of its columns.
        lacking: &'static str,
        /// Names of the columns.
        found: String,
    },
    /// A name stands twice.
    #[error("two columns are a {0}; rename one")]
    Twice(&'static str),
    /// A line has fewer fields than the columns need.
    #[error("{found} fields, the columns are {expected}")]
    FieldCount {
        /// Fields of the line.
        found: usize,
        /// Columns.
        expected: usize,
    },
    /// A field is not a number.
    #[error("{column}: {found:?} is not a finite number")]
    Number {
        /// Name of the column.
        column: &'static str,
        /// Text found.
        found: String,
    },
    /// A time cannot be read.
    #[error("time {found:?} is neither seconds nor a date such as 2020-10-13 16:03:08.029")]
    Time {
        /// Text found.
        found: String,
    },
}

impl PoseTable {
    /// Reads a table.
    pub fn from_text(text: &str) -> Result<Self, TableError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim())).peekable();
        let (line, names) = lines
            .by_ref()
            .take(MAX_PREAMBLE)
            .find(|(_, line)| columns::is_header(line))
            .ok_or(TableError { line: 1, fault: TableFault::NoHeader })?;
        let separator = Separator::of(names);
        let columns = Columns::from_names(names, separator).map_err(|fault| TableError { line, fault })?;
        // A line of units follows the names.
        let is_units = |line: &str| line.starts_with('(') || line.starts_with('[');
        lines.next_if(|(_, line)| is_units(line));
        let mut table = Self {
            time: TimeKind::Seconds,
            place: columns.place_kind(),
            is_above_geoid: columns.is_above_geoid(),
            rows: Vec::new(),
        };
        for (line, text) in lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')) {
            let fields: Vec<&str> = separator.split(text).collect();
            let read = columns.row(line, &fields).map_err(|fault| TableError { line, fault })?;
            table.time = read.time;
            table.rows.push(read.row);
        }
        Ok(table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn export_of_inertial_explorer_is_read_by_its_names() {
        let text = "Project: street\nProgram: Inertial Explorer 8.90\n\n\
                    Week GPSTime Latitude Longitude H-Ell VEast Roll Pitch Heading SDNorth SDEast SDHeight Q\n\
                    (weeks) (sec) (deg) (deg) (m) (m/s) (deg) (deg) (deg) (m) (m) (m)\n\
                    2331 476818.125 48.5 2.25 104.5 1.0 0.5 -0.25 135.0 0.01 0.02 0.03 1\n";
        let table = PoseTable::from_text(text).expect("is a table");
        assert_eq!((table.time, table.place, table.is_above_geoid), (TimeKind::Seconds, PlaceKind::Geodetic, false));
        let [row] = table.rows[..] else { panic!("{table:?}") };
        assert_eq!((row.line, row.week, row.time_nanos), (6, Some(2331), 476_818_125_000_000));
        assert_eq!((row.place, row.attitude), ([48.5, 2.25, 104.5], Attitude::Angles([0.5, -0.25, 135.0])));
        assert_eq!((row.north_east_up_m, row.roll_pitch_heading_deg), (Some([0.01, 0.02, 0.03]), None));
    }

    #[test]
    fn units_of_names_and_heights_above_the_geoid_are_used() {
        let names = "time,lat(rad),lon(rad),H-MSL,Undulation,roll[rad],pitch[rad],yaw[rad]";
        let row = PoseTable::from_text(&format!("{names}\n1.5,0.5,0.25,60,44.5,0,0,1\n")).expect("is a table").rows[0];
        let [latitude, longitude, height] = row.place;
        assert!((latitude - 0.5_f64.to_degrees()).abs() < 1e-12 && (longitude - 0.25_f64.to_degrees()).abs() < 1e-12);
        assert_eq!((height, row.attitude), (104.5, Attitude::Angles([0.0, 0.0, 1.0_f64.to_degrees()])));
        let without = PoseTable::from_text("stamp;x;y;z;qx;qy;qz;qw\n12;1;2;3;0;0;0;1\n").expect("is a table");
        assert_eq!((without.time, without.place), (TimeKind::Nanos, PlaceKind::Local));
        assert_eq!(without.rows[0].time_nanos, 12);
        assert!(PoseTable::from_text("time,lat,lon,H-MSL,roll,pitch,yaw\n").expect("is a table").is_above_geoid);
    }

    #[test]
    fn faults_are_named_with_their_lines() {
        let names = "time,lat,lon,height,roll,pitch,heading\n";
        for (text, line, words) in [
            ("1 2 3\n".to_owned(), 1, "no line names the columns"),
            ("time,lat,lon,height,roll,pitch\n".to_owned(), 1, "no attitude"),
            ("time,lat,lon,roll,pitch,heading\n".to_owned(), 1, "no height"),
            ("time,lat,lon,height,roll,pitch,heading,yaw\n".to_owned(), 1, "two columns are a heading"),
            (format!("{names}1,2,3\n"), 2, "3 fields, the columns are 7"),
            (format!("{names}1,48,2,100,0,nan,0\n"), 2, "pitch: \"nan\" is not a finite number"),
            (format!("{names}noon,48,2,100,0,0,0\n"), 2, "time \"noon\""),
        ] {
            let error = PoseTable::from_text(&text).expect_err(&text);
            assert_eq!(error.line, line, "{text:?}");
            assert!(error.to_string().contains(words), "{error}");
        }
    }

    #[real_data::test("trajectories/novatel_ins_csv/novatel-enu.csv.gz")]
    fn solution_of_a_car_has_its_rate_and_its_angles_in_degrees() {
        let path = real_data::path("trajectories/novatel_ins_csv/novatel-enu.csv.gz");
        let output = std::process::Command::new("gzip").arg("-dc").arg(path).output().expect("gzip starts");
        let table = PoseTable::from_text(&String::from_utf8(output.stdout).expect("text")).expect("is a table");
        assert_eq!((table.time, table.place), (TimeKind::Date, PlaceKind::Local));
        let first = table.rows[0];
        // 2020-10-13 16:03:08.029, read as UTC.
        assert_eq!(first.time_nanos, 1_602_604_988_029_000_000);
        let Attitude::Angles([_, _, yaw_deg]) = first.attitude else { panic!("{first:?}") };
        assert!((yaw_deg - 2.348_586_f64.to_degrees()).abs() < 1e-9);
        let seconds = (table.rows[table.rows.len() - 1].time_nanos - first.time_nanos) as f64 * 1e-9;
        assert!((seconds - 189.641).abs() < 0.01, "{seconds}");
    }
}
