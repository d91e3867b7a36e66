//! CSV: a first line with the names of the columns in any order, then one pose per line.
//!
//! Columns: `stamp` (integer ns since the Unix epoch) or `time_s` (seconds), `x`, `y`, `z` (m), `qx`, `qy`, `qz`, `qw` (unit
//! quaternion). Other columns are ignored. Written: `stamp,x,y,z,qx,qy,qz,qw`.

use super::line::{content_lines, finite, parse_stamp, rotation};
use super::{PoseFault, TrajectoryError};
use geometry::{Isometry3, Stamp, Trajectory, Translation3};
use std::fmt::Write;

const NUMBERS: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];

/// The trajectory as CSV with a header line.
pub fn csv_from_trajectory(trajectory: &Trajectory) -> String {
    let mut text = String::from("stamp,x,y,z,qx,qy,qz,qw\n");
    for (stamp, pose) in trajectory.poses() {
        let t = pose.translation.vector;
        let q = pose.rotation.coords;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},{},{},{},{},{},{},{}", stamp.0, t.x, t.y, t.z, q.x, q.y, q.z, q.w);
    }
    text
}

/// Reads CSV by the rules of the [module](super).
pub fn trajectory_from_csv(text: &str) -> Result<Trajectory, TrajectoryError> {
    let mut lines = content_lines(text);
    let (line, names) = lines.next().unwrap_or((1, ""));
    let columns = Columns::from_names(names).map_err(|fault| TrajectoryError { line, fault })?;
    let mut trajectory = Trajectory::default();
    for (line, row) in lines {
        let error = |fault: PoseFault| TrajectoryError { line, fault };
        let fields: Vec<&str> = row.split(',').map(str::trim).collect();
        if fields.len() != columns.n {
            return Err(error(PoseFault::FieldCount { found: fields.len(), expected: columns.n }));
        }
        let stamp = fields[columns.time];
        let stamp = if columns.is_seconds { parse_stamp(stamp) } else { parse_nanos(stamp) }.map_err(error)?;
        let mut numbers = [0.0; 7];
        for (number, (column, name)) in numbers.iter_mut().zip(columns.numbers.iter().zip(NUMBERS)) {
            let found = fields[*column];
            *number =
                finite(found).ok_or_else(|| error(PoseFault::Column { column: name, found: found.to_owned() }))?;
        }
        let [x, y, z, quaternion @ ..] = numbers;
        let pose = Isometry3::from_parts(Translation3::new(x, y, z), rotation(quaternion).map_err(error)?);
        super::push(&mut trajectory, line, stamp, pose)?;
    }
    Ok(trajectory)
}

/// Positions of the columns in a line.
struct Columns {
    n: usize,
    time: usize,
    is_seconds: bool,
    numbers: [usize; 7],
}

impl Columns {
    fn from_names(names: &str) -> Result<Self, PoseFault> {
        let names: Vec<&str> = names.split(',').map(str::trim).collect();
        let find = |name: &str| names.iter().position(|found| *found == name);
        let needs = |name: &'static str| find(name).ok_or(PoseFault::MissingColumn(name));
        let (time, is_seconds) = match (find("stamp"), find("time_s")) {
            (Some(column), _) => (column, false),
            (None, Some(column)) => (column, true),
            (None, None) => return Err(PoseFault::MissingTime),
        };
        let mut numbers = [0; 7];
        for (number, name) in numbers.iter_mut().zip(NUMBERS) {
            *number = needs(name)?;
        }
        Ok(Self { n: names.len(), time, is_seconds, numbers })
    }
}

fn parse_nanos(field: &str) -> Result<Stamp, PoseFault> {
    field.parse().map(Stamp).map_err(|_| PoseFault::Nanos { found: field.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_read_in_any_order_and_others_are_ignored() {
        let text = "time_s, qw,qx,qy,qz, z,y,x, quality\n0.5, 1,0,0,0, 3,2,1, good\n";
        let trajectory = trajectory_from_csv(text).expect("parses");
        let [(stamp, pose)] = trajectory.poses() else { panic!("{trajectory:?}") };
        assert_eq!((stamp.0, pose.translation.vector), (500_000_000, geometry::Vector3::new(1.0, 2.0, 3.0)));
    }

    #[test]
    fn invalid_lines_are_reported() {
        let names = "stamp,x,y,z,qx,qy,qz,qw\n";
        for (text, line, rule) in [
            (String::new(), 1, "neither `stamp` (ns) nor `time_s`"),
            ("stamp,x,y,z,qx,qy,qz\n".to_owned(), 1, "no column `qw`"),
            (format!("{names}1,0,0,0,0,0,1\n"), 2, "7 fields, the first line names 8"),
            (format!("{names}1,0,0,NaN,0,0,0,1\n"), 2, "z: \"NaN\" is not a finite number"),
            (format!("{names}1.5,0,0,0,0,0,0,1\n"), 2, "not an integer number of ns"),
            (format!("{names}1,0,0,0,0,0,0,3\n"), 2, "has norm 3, expected 1"),
            (format!("{names}2,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,1\n"), 3, "before the time of the previous line"),
        ] {
            let error = trajectory_from_csv(&text).expect_err(&text);
            assert_eq!(error.line, line, "{text:?}");
            assert!(error.to_string().contains(rule), "{error}");
        }
    }
}
