//! The file of check points.

use crate::error::DeliverError;
use std::path::Path;

/// A point with known coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckPoint {
    /// Name from the file.
    pub name: String,
    /// Coordinates in the system of the delivery, m.
    pub xyz: [f64; 3],
    /// Manually picked position in the cloud, m.
    pub in_cloud: Option<[f64; 3]>,
}

/// Columns that a file must have.
const REQUIRED: [&str; 4] = ["name", "x", "y", "z"];
/// Columns of the position in the cloud; a file has all of them or lacks all of them.
const IN_CLOUD: [&str; 3] = ["cloud_x", "cloud_y", "cloud_z"];

/// Reads a CSV file whose first line names the columns, in any order. Other columns are ignored.
pub fn load_check_points(path: &Path) -> Result<Vec<CheckPoint>, DeliverError> {
    let text = std::fs::read_to_string(path).map_err(DeliverError::file(path, "read"))?;
    check_points_from_csv(&text).map_err(|rule| DeliverError::content(path, rule))
}

/// The check points in the text of such a file. The error is the violated rule, with the line.
pub fn check_points_from_csv(text: &str) -> Result<Vec<CheckPoint>, String> {
    parse(text).map_err(|(line, rule)| if line == 0 { rule } else { format!("line {line}: {rule}") })
}

fn parse(text: &str) -> Result<Vec<CheckPoint>, (usize, String)> {
    // Spreadsheets put a byte order mark before the first name.
    let text = text.trim_start_matches('\u{feff}');
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let (line, names) = lines.next().ok_or((0, "has no line with names".to_owned()))?;
    let names: Vec<&str> = names.split(',').map(str::trim).collect();
    let column = |name: &str| names.iter().position(|found| *found == name);
    let required = |name: &str| column(name).ok_or_else(|| (line, format!("no column `{name}`; needs name,x,y,z")));
    let [name_at, x, y, z] =
        [required(REQUIRED[0])?, required(REQUIRED[1])?, required(REQUIRED[2])?, required(REQUIRED[3])?];
    let in_cloud: Vec<usize> = IN_CLOUD.iter().filter_map(|name| column(name)).collect();
    if !in_cloud.is_empty() && in_cloud.len() != IN_CLOUD.len() {
        return Err((line, "needs all or none of cloud_x, cloud_y, cloud_z".to_owned()));
    }
    let mut points = Vec::new();
    for (line, row) in lines {
        let fields: Vec<&str> = row.split(',').map(str::trim).collect();
        if fields.len() != names.len() {
            return Err((line, format!("{} fields, the first line names {}", fields.len(), names.len())));
        }
        let number = |at: usize| {
            let value = fields[at].parse().ok().filter(|value: &f64| value.is_finite());
            value.ok_or_else(|| (line, format!("{}: {:?} is not a number", names[at], fields[at])))
        };
        let is_found = !in_cloud.is_empty() && in_cloud.iter().any(|at| !fields[*at].is_empty());
        points.push(CheckPoint {
            name: fields[name_at].to_owned(),
            xyz: [number(x)?, number(y)?, number(z)?],
            in_cloud: if is_found {
                Some([number(in_cloud[0])?, number(in_cloud[1])?, number(in_cloud[2])?])
            } else {
                None
            },
        });
    }
    if points.is_empty() {
        return Err((0, "has no points".to_owned()));
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_come_in_any_order_and_places_in_the_cloud_are_optional() {
        let text =
            "\u{feff}z, name, x, y, cloud_x, cloud_y, cloud_z, note\n# comment\n3,A,1,2,,,,n\n6,B,4,5,4.5,5.5,6.5,\n";
        let points = parse(text).expect("parses");
        assert_eq!(points[0], CheckPoint { name: "A".to_owned(), xyz: [1.0, 2.0, 3.0], in_cloud: None });
        assert_eq!(points[1].in_cloud, Some([4.5, 5.5, 6.5]));
    }

    #[test]
    fn invalid_lines_are_reported() {
        for (text, line, rule) in [
            ("", 0, "has no line with names"),
            ("name,x,y\n", 1, "no column `z`"),
            ("name,x,y,z,cloud_x\n", 1, "needs all or none"),
            ("name,x,y,z\n", 0, "has no points"),
            ("name,x,y,z\nA,1,2\n", 2, "3 fields, the first line names 4"),
            ("name,x,y,z\nA,1,nan,3\n", 2, "y: \"nan\" is not a number"),
            ("name,x,y,z,cloud_x,cloud_y,cloud_z\nA,1,2,3,1,,3\n", 2, "cloud_y: \"\" is not a number"),
        ] {
            let (found_line, found) = parse(text).expect_err(text);
            assert!(found_line == line && found.contains(rule), "{found_line}: {found}");
        }
    }
}
