//! Positions and units of the columns of a table.

use super::{Attitude, PlaceKind, PoseRow, TableFault, TimeKind, date};

/// Character between the fields of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    Char(char),
    Blanks,
}

impl Separator {
    pub fn of(names: &str) -> Self {
        [',', ';', '\t'].into_iter().find(|c| names.contains(*c)).map_or(Self::Blanks, Self::Char)
    }
    pub fn split(self, line: &str) -> Box<dyn Iterator<Item = &str> + '_> {
        match self {
            Self::Char(c) => Box::new(line.split(c).map(str::trim)),
            Self::Blanks => Box::new(line.split_whitespace()),
        }
    }
}

/// Quantity of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quantity {
    Time,
    Nanos,
    Week,
    Latitude,
    Longitude,
    Height,
    HeightAboveGeoid,
    Undulation,
    Easting,
    Northing,
    X,
    Y,
    Z,
    Roll,
    Pitch,
    Heading,
    Qx,
    Qy,
    Qz,
    Qw,
    SdNorth,
    SdEast,
    SdUp,
    SdRoll,
    SdPitch,
    SdHeading,
}

use Quantity as Q;

/// Names without case, separators and units; the first is used in messages.
const NAMES: [(Quantity, &[&str]); 26] = [
    (
        Q::Time,
        &[
            "time",
            "gpstime",
            "seconds",
            "sow",
            "tow",
            "gpssow",
            "gpstow",
            "gpsseconds",
            "secondsofweek",
            "times",
            "timestamp",
            "utctime",
            "unixtime",
            "t",
        ],
    ),
    (Q::Nanos, &["stamp", "stampns", "timestampns", "timens"]),
    (Q::Week, &["week", "gpsweek", "weeknumber"]),
    (Q::Latitude, &["latitude", "lat"]),
    (Q::Longitude, &["longitude", "lon", "long"]),
    (Q::Height, &["height", "hell", "ellipsoidalheight", "heightell", "ellheight", "altitude", "alt", "h"]),
    (
        Q::HeightAboveGeoid,
        &["height above the geoid", "hmsl", "heightmsl", "orthometricheight", "hortho", "horthometric"],
    ),
    (Q::Undulation, &["undulation", "geoid", "geoidseparation", "und"]),
    (Q::Easting, &["easting", "east", "e", "utmeast"]),
    (Q::Northing, &["northing", "north", "n", "utmnorth"]),
    (Q::X, &["x", "px", "tx", "posx"]),
    (Q::Y, &["y", "py", "ty", "posy"]),
    (Q::Z, &["z", "pz", "tz", "posz", "up", "u"]),
    (Q::Roll, &["roll"]),
    (Q::Pitch, &["pitch"]),
    (Q::Heading, &["heading", "yaw", "azimuth", "hdg"]),
    (Q::Qx, &["qx"]),
    (Q::Qy, &["qy"]),
    (Q::Qz, &["qz"]),
    (Q::Qw, &["qw"]),
    (Q::SdNorth, &["sdnorth", "stdnorth", "sigmanorth", "northsd", "northstd", "latitudestd"]),
    (Q::SdEast, &["sdeast", "stdeast", "sigmaeast", "eastsd", "eaststd", "longitudestd"]),
    (Q::SdUp, &["sdheight", "sdup", "stdheight", "stdup", "sigmaup", "heightsd", "heightstd", "altitudestd"]),
    (Q::SdRoll, &["sdroll", "stdroll", "rollsd", "rollstd"]),
    (Q::SdPitch, &["sdpitch", "stdpitch", "pitchsd", "pitchstd"]),
    (Q::SdHeading, &["sdheading", "stdheading", "headingsd", "headingstd", "sdyaw", "yawstd", "sdazimuth"]),
];

/// A name without case, separators and unit, and whether its unit is radians.
fn plain(name: &str) -> (String, bool) {
    let lower = name.trim().trim_matches('"').to_lowercase();
    let unit_at = lower.find(['(', '[']);
    let unit = unit_at.map_or("", |at| &lower[at..]);
    let word: String = lower[..unit_at.unwrap_or(lower.len())].chars().filter(char::is_ascii_alphanumeric).collect();
    // A unit may follow after a separator, as in `roll_rad` or `latitude_deg`.
    let suffix = |word: &str, end: &str| word.strip_suffix(end).filter(|rest| rest.len() > 2).map(str::to_owned);
    if let Some(rest) = suffix(&word, "rad") {
        return (rest, true);
    }
    (suffix(&word, "deg").unwrap_or(word), unit.contains("rad"))
}

fn quantity(word: &str) -> Option<Quantity> {
    NAMES.iter().find(|(_, names)| names.contains(&word)).map(|(quantity, _)| *quantity)
}

/// Whether a line names columns: a time and at least four more quantities.
pub(super) fn is_header(line: &str) -> bool {
    let found: Vec<Quantity> = Separator::of(line).split(line).filter_map(|name| quantity(&plain(name).0)).collect();
    found.len() >= 5 && found.iter().any(|quantity| matches!(quantity, Q::Time | Q::Nanos))
}

/// A column.
#[derive(Clone, Copy, Debug)]
struct Column {
    quantity: Quantity,
    index: usize,
    /// Degrees per unit of the column.
    factor: f64,
}

/// The columns of a table that are used.
pub(super) struct Columns {
    n: usize,
    columns: Vec<Column>,
    place: [Column; 3],
    attitude: Vec<Column>,
}

/// A line, and the kind of its time.
pub(super) struct ReadRow {
    pub time: TimeKind,
    pub row: PoseRow,
}

impl Columns {
    pub fn from_names(names: &str, separator: Separator) -> Result<Self, TableFault> {
        let names: Vec<&str> = separator.split(names).collect();
        let column = |(index, name): (usize, &&str)| {
            let (word, is_radians) = plain(name);
            let factor = if is_radians { 1.0_f64.to_degrees() } else { 1.0 };
            Some(Column { quantity: quantity(&word)?, index, factor })
        };
        let columns: Vec<Column> = names.iter().enumerate().filter_map(column).collect();
        for (number, column) in columns.iter().enumerate() {
            if columns[..number].iter().any(|before| before.quantity == column.quantity) {
                return Err(TableFault::Twice(name_of(column.quantity)));
            }
        }
        let find = |quantity: Quantity| columns.iter().find(|column| column.quantity == quantity).copied();
        let lacking = |lacking: &'static str| TableFault::Lacking { lacking, found: names.join(", ") };
        let height = find(Q::Height).or_else(|| find(Q::HeightAboveGeoid));
        let place = if let (Some(latitude), Some(longitude)) = (find(Q::Latitude), find(Q::Longitude)) {
            [latitude, longitude, height.ok_or_else(|| lacking("height (H-Ell)"))?]
        } else if let (Some(east), Some(north)) = (find(Q::Easting), find(Q::Northing)) {
            [east, north, height.or_else(|| find(Q::Z)).ok_or_else(|| lacking("height (H-Ell)"))?]
        } else {
            let [x, y, z] = [find(Q::X), find(Q::Y), find(Q::Z).or(height)];
            let none = || lacking("place (Latitude, Longitude, H-Ell; Easting, Northing, H-Ell; x, y, z)");
            [x.ok_or_else(none)?, y.ok_or_else(none)?, z.ok_or_else(none)?]
        };
        let all =
            |quantities: &[Quantity]| quantities.iter().map(|quantity| find(*quantity)).collect::<Option<Vec<_>>>();
        let attitude = all(&[Q::Qx, Q::Qy, Q::Qz, Q::Qw])
            .or_else(|| all(&[Q::Roll, Q::Pitch, Q::Heading]))
            .ok_or_else(|| lacking("attitude (Roll, Pitch, Heading, or qx, qy, qz, qw)"))?;
        Ok(Self { n: names.len(), place, attitude, columns })
    }

    fn find(&self, quantity: Quantity) -> Option<Column> {
        self.columns.iter().find(|column| column.quantity == quantity).copied()
    }

    pub fn place_kind(&self) -> PlaceKind {
        match self.place[0].quantity {
            Q::Latitude => PlaceKind::Geodetic,
            Q::Easting => PlaceKind::Projected,
            _ => PlaceKind::Local,
        }
    }

    pub fn is_above_geoid(&self) -> bool {
        self.place[2].quantity == Q::HeightAboveGeoid && self.find(Q::Undulation).is_none()
    }

    pub fn row(&self, line: usize, fields: &[&str]) -> Result<ReadRow, TableFault> {
        // An empty field may follow the last column.
        if fields.len() < self.n {
            return Err(TableFault::FieldCount { found: fields.len(), expected: self.n });
        }
        let number = |column: Column| {
            let text = fields[column.index];
            let value = text.parse().ok().filter(|value: &f64| value.is_finite());
            value.ok_or_else(|| TableFault::Number { column: name_of(column.quantity), found: text.to_owned() })
        };
        let degrees = |column: Column| Ok::<f64, TableFault>(number(column)? * column.factor);
        let (time, time_nanos) = self.time(fields)?;
        let week = self.find(Q::Week).map(number).transpose()?.map(|week| week as u32);
        let [a, b, height] = self.place;
        let undulation = self.find(Q::Undulation).filter(|_| height.quantity == Q::HeightAboveGeoid);
        let undulation_m = undulation.map(number).transpose()?.unwrap_or(0.0);
        let place = match self.place_kind() {
            PlaceKind::Geodetic => [degrees(a)?, degrees(b)?, number(height)? + undulation_m],
            PlaceKind::Projected | PlaceKind::Local => [number(a)?, number(b)?, number(height)? + undulation_m],
        };
        let attitude = match self.attitude[..] {
            [roll, pitch, heading] => Attitude::Angles([degrees(roll)?, degrees(pitch)?, degrees(heading)?]),
            [x, y, z, w] => Attitude::Quaternion([number(x)?, number(y)?, number(z)?, number(w)?]),
            _ => return Err(TableFault::NoHeader),
        };
        let three = |quantities: [Quantity; 3]| {
            let [a, b, c] = quantities.map(|quantity| self.find(quantity));
            let (Some(a), Some(b), Some(c)) = (a, b, c) else { return Ok(None) };
            Ok::<_, TableFault>(Some([degrees(a)?, degrees(b)?, degrees(c)?]))
        };
        let north_east_up_m = three([Q::SdNorth, Q::SdEast, Q::SdUp])?;
        let roll_pitch_heading_deg = three([Q::SdRoll, Q::SdPitch, Q::SdHeading])?;
        let row = PoseRow { line, week, time_nanos, place, attitude, north_east_up_m, roll_pitch_heading_deg };
        Ok(ReadRow { time, row })
    }

    fn time(&self, fields: &[&str]) -> Result<(TimeKind, i64), TableFault> {
        if let Some(column) = self.find(Q::Nanos) {
            let text = fields[column.index];
            let error = || TableFault::Number { column: "stamp", found: text.to_owned() };
            return Ok((TimeKind::Nanos, text.parse().map_err(|_| error())?));
        }
        let column = self.find(Q::Time).ok_or(TableFault::NoHeader)?;
        let text = fields[column.index];
        let seconds = crate::trajectory::nanos_from_seconds(text).map(|nanos| (TimeKind::Seconds, nanos));
        let found = seconds.or_else(|| date::nanos(text).map(|nanos| (TimeKind::Date, nanos)));
        found.ok_or_else(|| TableFault::Time { found: text.to_owned() })
    }
}

fn name_of(quantity: Quantity) -> &'static str {
    NAMES.iter().find(|(named, _)| *named == quantity).map_or("column", |(_, names)| names[0])
}
