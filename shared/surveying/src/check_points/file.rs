//! The file of check points.

use crate::error::DeliverError;
use files::regular_file;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Standard deviation of coordinates that state none, horizontally along each axis and up, m: a receiver with corrections.
const DEFAULT_SIGMA_M: [f64; 2] = [0.02, 0.03];

/// Use of a point with known coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PointUse {
    /// It moves the result of a survey.
    Control,
    /// It only shows the accuracy of the result.
    #[default]
    Check,
}

/// A point with known coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CheckPoint {
    /// Name from the file.
    pub name: String,
    /// Coordinates in the system of the delivery, m.
    pub xyz: [f64; 3],
    /// Manually picked position in the cloud, m: in the coordinates of the delivery, or with a drive, of the clouds of its run.
    pub in_cloud: Option<[f64; 3]>,
    /// Use in a survey.
    pub point_use: PointUse,
    /// Standard deviation of the coordinates, horizontally along each axis and up, m. `None`: not stated.
    pub sigma_m: [Option<f64>; 2],
    /// Name of the drive of a survey in whose cloud the position was picked.
    pub drive: Option<String>,
}

impl PointUse {
    /// The word of the column `use`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Control => "control",
            Self::Check => "check",
        }
    }
}

impl CheckPoint {
    /// Standard deviation of the coordinates, horizontally along each axis and up, m: stated, otherwise 0.02 and 0.03.
    pub fn deviation_m(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.sigma_m[axis].unwrap_or(DEFAULT_SIGMA_M[axis]))
    }
}

/// Columns that a file must have.
const REQUIRED: [&str; 4] = ["name", "x", "y", "z"];
/// Columns of the position in the cloud; a file has all of them or lacks all of them.
const IN_CLOUD: [&str; 3] = ["cloud_x", "cloud_y", "cloud_z"];
/// Column with the words `control` and `check`.
const USE: &str = "use";
/// Columns of the standard deviations, m.
const SIGMAS: [&str; 2] = ["sigma_xy", "sigma_z"];
/// Column with the drive of a picked position.
const DRIVE: &str = "drive";

/// Reads a CSV file whose first line names the columns, in any order and in upper or lower case. Other columns are ignored.
/// Fields are separated by commas, semicolons or tabs and may be quoted. Numbers may have decimal commas.
pub fn load_check_points(path: &Path) -> Result<Vec<CheckPoint>, DeliverError> {
    let bytes = regular_file::read(path).map_err(DeliverError::file(path, "read"))?;
    let text = text_from_bytes(&bytes).map_err(|rule| DeliverError::content(path, rule))?;
    check_points_from_csv(text).map_err(|rule| DeliverError::content(path, rule))
}

/// The content of a file as text. The error is the violated rule.
fn text_from_bytes(bytes: &[u8]) -> Result<&str, String> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err("is UTF-16 text; save it as CSV in UTF-8".to_owned());
    }
    std::str::from_utf8(bytes).map_err(|error| {
        let (before, rest) = bytes.split_at(error.valid_up_to());
        let line = before.split(|byte| *byte == b'\n').count();
        let byte = rest.first().copied().unwrap_or_default();
        format!("line {line}: byte {byte:#04x} is not UTF-8; save the file as CSV in UTF-8")
    })
}

/// The check points in the text of such a file. The error is the violated rule, with the line.
pub fn check_points_from_csv(text: &str) -> Result<Vec<CheckPoint>, String> {
    parse(text).map_err(|(line, rule)| if line == 0 { rule } else { format!("line {line}: {rule}") })
}

/// A violated rule, and its line; 0 = the whole file.
type Fault = (usize, String);

fn parse(text: &str) -> Result<Vec<CheckPoint>, Fault> {
    // Spreadsheets put a byte order mark before the first name.
    let text = text.trim_start_matches('\u{feff}');
    // Excel reads the separator from a first line such as "sep=;".
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty());
    let mut found = lines.by_ref().filter(|(_, line)| !line.starts_with('#') && !line.starts_with("sep="));
    let (line, header) = found.next().ok_or((0, "has no line with names".to_owned()))?;
    let table = Table::new(line, header)?;
    let mut points = Vec::new();
    let mut decimals = Decimals::default();
    for (line, row) in lines {
        let fields = fields(row, table.separator);
        if row.starts_with('#') {
            // A comment must not hide a point that is named "#12".
            let point = fields.ok().map(|fields| table.point(line, &fields, &mut Decimals::default()));
            if point.is_some_and(|point| point.is_ok()) {
                return Err((line, "a comment, or a point whose name begins with `#`; rename the point".to_owned()));
            }
            continue;
        }
        let fields = fields.map_err(|rule| (line, rule))?;
        if fields.iter().any(|field| !field.is_empty()) {
            points.push(table.point(line, &fields, &mut decimals)?);
        }
    }
    if points.is_empty() {
        return Err((0, "has no points".to_owned()));
    }
    Ok(points)
}

/// The columns of a file.
struct Table {
    separator: char,
    /// Lower case.
    names: Vec<String>,
    name_at: usize,
    /// Indices of x, y and z.
    xyz: [usize; 3],
    /// Indices of the position in the cloud.
    in_cloud: Option<[usize; 3]>,
    use_at: Option<usize>,
    sigmas_at: [Option<usize>; 2],
    drive_at: Option<usize>,
}

impl Table {
    fn new(line: usize, header: &str) -> Result<Self, Fault> {
        let separator = [';', '\t'].into_iter().find(|separator| header.contains(*separator)).unwrap_or(',');
        let names = fields(header, separator).map_err(|rule| (line, rule))?;
        let names: Vec<String> = names.iter().map(|name| name.to_lowercase()).collect();
        let column = |name: &str| {
            let mut found = names.iter().enumerate().filter(|(_, found)| *found == name).map(|(at, _)| at);
            let at = found.next();
            if found.next().is_some() { Err((line, format!("two columns `{name}`"))) } else { Ok(at) }
        };
        let required = |name: &str| {
            let missing = || (line, format!("no column `{name}` in {names:?}; needs name,x,y,z"));
            column(name)?.ok_or_else(missing)
        };
        let [name_at, x, y, z] =
            [required(REQUIRED[0])?, required(REQUIRED[1])?, required(REQUIRED[2])?, required(REQUIRED[3])?];
        let in_cloud = match [column(IN_CLOUD[0])?, column(IN_CLOUD[1])?, column(IN_CLOUD[2])?] {
            [None, None, None] => None,
            [Some(x), Some(y), Some(z)] => Some([x, y, z]),
            _ => return Err((line, "needs all or none of cloud_x, cloud_y, cloud_z".to_owned())),
        };
        let sigmas_at = [column(SIGMAS[0])?, column(SIGMAS[1])?];
        let (use_at, drive_at) = (column(USE)?, column(DRIVE)?);
        Ok(Self { separator, name_at, xyz: [x, y, z], in_cloud, use_at, sigmas_at, drive_at, names })
    }

    fn point(&self, line: usize, fields: &[String], decimals: &mut Decimals) -> Result<CheckPoint, Fault> {
        let Self { separator, names, name_at, xyz, in_cloud, use_at, sigmas_at, drive_at } = self;
        if fields.len() != names.len() {
            let hint = match (separator, fields.len() > names.len()) {
                (',', true) => "; numbers with decimal commas need semicolons between the fields",
                _ => "",
            };
            return Err((line, format!("{} fields, the first line names {}{hint}", fields.len(), names.len())));
        }
        let mut number = |at: usize| -> Result<f64, Fault> {
            let number = decimals.number(&fields[at], *separator);
            number.map_err(|rule| (line, format!("{}: {:?} {rule}", names[at], fields[at])))
        };
        let filled = |at: &Option<usize>| at.filter(|at| !fields[*at].is_empty());
        let mut sigma_m = [None; 2];
        for (sigma, at) in sigma_m.iter_mut().zip(sigmas_at) {
            *sigma = filled(at).map(&mut number).transpose()?;
            if let Some(value) = sigma.filter(|value| *value <= 0.0) {
                return Err((line, format!("a standard deviation of {value}; must be above 0, in m")));
            }
        }
        let mut numbers =
            |at: &[usize; 3]| -> Result<[f64; 3], Fault> { Ok([number(at[0])?, number(at[1])?, number(at[2])?]) };
        let in_cloud = in_cloud.as_ref().filter(|at| at.iter().any(|at| !fields[*at].is_empty()));
        let point_use = match filled(use_at).map(|at| fields[at].as_str()) {
            None | Some("check") => PointUse::Check,
            Some("control") => PointUse::Control,
            Some(other) => return Err((line, format!("{USE}: {other:?} must be control or check"))),
        };
        Ok(CheckPoint {
            name: fields[*name_at].clone(),
            xyz: numbers(xyz)?,
            in_cloud: in_cloud.map(&mut numbers).transpose()?,
            point_use,
            sigma_m,
            drive: filled(drive_at).map(|at| fields[at].clone()),
        })
    }
}

/// The decimal separators seen so far. A file with both could have thousands separators, which change the value.
#[derive(Default)]
struct Decimals {
    has_points: bool,
    has_commas: bool,
}

impl Decimals {
    /// The number in a field. The error is the violated rule.
    fn number(&mut self, field: &str, separator: char) -> Result<f64, &'static str> {
        self.has_points |= field.contains('.');
        self.has_commas |= field.contains(',');
        if self.has_points && self.has_commas {
            return Err("mixes decimal commas and decimal points; write all numbers with decimal points");
        }
        let value = field.replacen(',', ".", 1).parse().ok().filter(|value: &f64| value.is_finite());
        let groups = field.trim_start_matches(['-', '+']).split_once(',');
        let may_be_thousands = groups.is_some_and(|(whole, rest)| whole.len() <= 3 && rest.len() == 3);
        if value.is_some() && separator != ';' && may_be_thousands {
            return Err("has a decimal comma or a separator of thousands; write all numbers with decimal points");
        }
        value.ok_or("is not a number")
    }
}

/// The fields of a line, without quotes and blanks around them (RFC 4180). The error is the violated rule.
fn fields(line: &str, separator: char) -> Result<Vec<String>, String> {
    let mut fields = Vec::new();
    let mut rest = line;
    loop {
        let text = rest.trim_start_matches(|c: char| c.is_whitespace() && c != separator);
        let Some(quoted) = text.strip_prefix('"') else {
            let (field, after) = text.split_once(separator).map_or((text, None), |(field, after)| (field, Some(after)));
            fields.push(field.trim().to_owned());
            match after {
                Some(after) => rest = after,
                None => return Ok(fields),
            }
            continue;
        };
        let (field, after) = unquoted(quoted).ok_or("a field has an opening quote without a closing one")?;
        fields.push(field.trim().to_owned());
        let after = after.trim_start_matches(|c: char| c.is_whitespace() && c != separator);
        if after.is_empty() {
            return Ok(fields);
        }
        rest = after.strip_prefix(separator).ok_or_else(|| format!("text after a closing quote: {after:?}"))?;
    }
}

/// The text up to the closing quote, and the text after it. A doubled quote is a quote of the text.
fn unquoted(text: &str) -> Option<(String, &str)> {
    let mut field = String::new();
    let mut rest = text;
    loop {
        let (before, after) = rest.split_once('"')?;
        field.push_str(before);
        let Some(next) = after.strip_prefix('"') else { return Some((field, after)) };
        field.push('"');
        rest = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_come_in_any_order_and_places_in_the_cloud_are_optional() {
        let text =
            "\u{feff}z, name, x, y, cloud_x, cloud_y, cloud_z, note\n# comment\n3,A,1,2,,,,n\n6,B,4,5,4.5,5.5,6.5,\n";
        let points = parse(text).expect("parses");
        assert_eq!(points[0], CheckPoint { name: "A".to_owned(), xyz: [1.0, 2.0, 3.0], ..CheckPoint::default() });
        assert_eq!(points[1].in_cloud, Some([4.5, 5.5, 6.5]));
    }

    #[test]
    fn uses_and_deviations_of_a_survey_are_read() {
        let text = "name,x,y,z,use,sigma_xy,sigma_z,drive\nA,1,2,3,control,0.02,,north\nB,1,2,3,,,0.01,\n";
        let points = parse(text).expect("parses");
        assert_eq!((points[0].point_use, points[1].point_use), (PointUse::Control, PointUse::Check));
        assert_eq!([points[0].sigma_m, points[1].sigma_m], [[Some(0.02), None], [None, Some(0.01)]]);
        assert_eq!((points[0].drive.as_deref(), points[1].drive.as_deref()), (Some("north"), None));
    }

    #[test]
    fn tables_of_spreadsheets_are_read() {
        let expected = [("P 1", [452_060.5, 5_410_567.25, 50.0]), ("P2", [452_080.0, 5_410_569.0, -1.5])];
        for text in [
            "name,x,y,z\nP 1,452060.5,5410567.25,50\nP2,452080,5410569,-1.5\n",
            "name;x;y;z\r\nP 1;452060,5;5410567,25;50,0\r\nP2;452080,0;5410569,0;-1,5\r\n;;;\r\n",
            "\u{feff}sep=;\nName;X;Y;Z\nP 1;452060.5;5410567.25;50\nP2;452080;5410569;-1.5\n",
            "# site A, \"old\" marks\nname,x,y,z\n# a, \"x\" y\nP 1,452060.5,5410567.25,50\nP2,452080,5410569,-1.5\n",
            "name\tx\ty\tz\nP 1\t452060.5\t5410567.25\t50\nP2\t452080\t5410569\t-1.5\n",
            "\"name\", \"x\",\"y\",\"z\"\n\"P 1\",\"452060,5\",\"5410567,25\",50\n\"P2\" ,452080,5410569,\"-1,5\"\n",
            "\u{feff}\"Name\";\"X\";\"Y\";\"Z\"\n\"P 1\";452060,5;5410567,25;50\nP2;452080;5410569;-1,5\n",
        ] {
            let points = parse(text).unwrap_or_else(|fault| panic!("{text}: {fault:?}"));
            let found: Vec<(&str, [f64; 3])> = points.iter().map(|point| (point.name.as_str(), point.xyz)).collect();
            assert_eq!(found, expected, "{text}");
        }
        let points = parse("name,x,y,z\n\"a, \"\"b\"\"\",1,2,3\n").expect("parses");
        assert_eq!(points[0].name, "a, \"b\"");
        let points = parse("sep=,\nname,x,y,z\nsep=1,1,2,3\n").expect("parses");
        assert_eq!(points[0].name, "sep=1");
    }

    #[test]
    fn text_in_another_encoding_is_refused_with_its_line() {
        let error = |bytes: &[u8]| text_from_bytes(bytes).expect_err("is refused");
        assert_eq!(error(b"\xff\xfen\0a\0"), "is UTF-16 text; save it as CSV in UTF-8");
        let latin = error(b"name,x,y,z\nStra\xdfe,1,2,3\n");
        assert_eq!(latin, "line 2: byte 0xdf is not UTF-8; save the file as CSV in UTF-8");
    }

    #[test]
    fn invalid_lines_are_reported() {
        for (text, line, rule) in [
            ("", 0, "has no line with names"),
            ("name,x,y\n", 1, "no column `z` in [\"name\", \"x\", \"y\"]; needs name,x,y,z"),
            ("name,x,X,y,z\n", 1, "two columns `x`"),
            ("sep=;\n\"name;x;y;z\n", 2, "an opening quote without a closing one"),
            ("name,x,y,z\n\"A\"b,1,2,3\n", 2, "text after a closing quote: \"b,1,2,3\""),
            (
                "name,x,y,z\nP1,452060,0,5410567,2,50,0\n",
                2,
                "7 fields, the first line names 4; numbers with decimal commas",
            ),
            ("name\tx\ty\tz\nA\t1,234\t2\t3\n", 2, "x: \"1,234\" has a decimal comma or a separator of thousands"),
            ("name;x;y;z\nA;1.234,5;2;3\n", 2, "x: \"1.234,5\" mixes decimal commas and decimal points"),
            ("name;x;y;z\nA;452,060;1;2\nB;3.5;1;2\n", 3, "x: \"3.5\" mixes decimal commas"),
            ("name,x,y,z\nA,\"1,234\",2,3\n", 2, "x: \"1,234\" has a decimal comma or a separator of thousands"),
            ("name;x;y;z\nA;1,2,3;2;3\n", 2, "x: \"1,2,3\" is not a number"),
            ("name,x,y,z\nA,1,2,3\n#12,1,2,3\n", 3, "a comment, or a point whose name begins with `#`"),
            ("name,x,y,z,cloud_x\n", 1, "needs all or none"),
            ("name,x,y,z\n", 0, "has no points"),
            ("name,x,y,z\nA,1,2\n", 2, "3 fields, the first line names 4"),
            ("name,x,y,z\nA,1,nan,3\n", 2, "y: \"nan\" is not a number"),
            ("name,x,y,z,use\nA,1,2,3,fixed\n", 2, "use: \"fixed\" must be control or check"),
            ("name,x,y,z,sigma_z\nA,1,2,3,0\n", 2, "a standard deviation of 0; must be above 0, in m"),
            ("name,x,y,z,cloud_x,cloud_y,cloud_z\nA,1,2,3,1,,3\n", 2, "cloud_y: \"\" is not a number"),
        ] {
            let (found_line, found) = parse(text).expect_err(text);
            assert!(found_line == line && found.contains(rule), "{found_line}: {found}");
        }
    }
}
