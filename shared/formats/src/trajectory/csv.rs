//! CSV: a first line that names the columns, in any order, then one pose a line.
//!
//! `stamp` (whole ns since the Unix epoch) or `time_s` (seconds), `x`, `y`, `z` (m), `qx`, `qy`, `qz`, `qw` (unit quaternion).
//! Further columns are passed over. Written: `stamp,x,y,z,qx,qy,qz,qw`.

use super::TrajectoryError;
use super::line::{content_lines, parse_number, parse_stamp, rotation};
use geometry::{Isometry3, Stamp, Trajectory, Translation3};
use std::fmt::Write;

const NUMBERS: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];

/// The trajectory as CSV, with a line of names.
pub fn csv_from_trajectory(trajectory: &Trajectory) -> String {
    let mut text = String::from("stamp,x,y,z,qx,qy,qz,qw\n");
    for (stamp, pose) in trajectory.poses() {
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},{},{},{},{},{},{},{}", stamp.0, t.x, t.y, t.z, q.x, q.y, q.z, q.w);
    }
    text
}

/// Reads CSV by the rules of the [module](super).
pub fn trajectory_from_csv(text: &str) -> Result<Trajectory, TrajectoryError> {
    let mut lines = content_lines(text);
    let (line, names) = lines.next().unwrap_or((1, ""));
    let columns = Columns::from_names(names).map_err(|rule| TrajectoryError { line, rule })?;
    let mut trajectory = Trajectory::default();
    for (line, row) in lines {
        let fault = |rule: String| TrajectoryError { line, rule };
        let fields: Vec<&str> = row.split(',').map(str::trim).collect();
        if fields.len() != columns.n {
            return Err(fault(format!("{} fields, the first line names {}", fields.len(), columns.n)));
        }
        let stamp = fields[columns.time];
        let stamp = if columns.is_seconds { parse_stamp(stamp) } else { parse_nanos(stamp) }.map_err(fault)?;
        let mut numbers = [0.0; 7];
        for (number, (column, name)) in numbers.iter_mut().zip(columns.numbers.iter().zip(NUMBERS)) {
            *number = parse_number(fields[*column]).map_err(|rule| fault(format!("{name}: {rule}")))?;
        }
        let [x, y, z, quaternion @ ..] = numbers;
        let pose = Isometry3::from_parts(Translation3::new(x, y, z), rotation(quaternion).map_err(fault)?);
        super::push(&mut trajectory, line, stamp, pose)?;
    }
    Ok(trajectory)
}

/// Where things stand in a line.
struct Columns {
    n: usize,
    time: usize,
    is_seconds: bool,
    numbers: [usize; 7],
}

impl Columns {
    fn from_names(names: &str) -> Result<Self, String> {
        let names: Vec<&str> = names.split(',').map(str::trim).collect();
        let find = |name: &str| names.iter().position(|found| *found == name);
        let needs = |name: &str| find(name).ok_or_else(|| format!("the first line names no column `{name}`"));
        let (time, is_seconds) = match (find("stamp"), find("time_s")) {
            (Some(column), _) => (column, false),
            (None, Some(column)) => (column, true),
            (None, None) => return Err("the first line names neither `stamp` (ns) nor `time_s`".to_owned()),
        };
        let mut numbers = [0; 7];
        for (number, name) in numbers.iter_mut().zip(NUMBERS) {
            *number = needs(name)?;
        }
        Ok(Self { n: names.len(), time, is_seconds, numbers })
    }
}

fn parse_nanos(field: &str) -> Result<Stamp, String> {
    field.parse().map(Stamp).map_err(|_| format!("stamp: {field:?} is no whole number of ns"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_stand_in_any_order_and_others_are_passed_over() {
        let text = "time_s, qw,qx,qy,qz, z,y,x, quality\n0.5, 1,0,0,0, 3,2,1, good\n";
        let trajectory = trajectory_from_csv(text).expect("parses");
        let [(stamp, pose)] = trajectory.poses() else { panic!("{trajectory:?}") };
        assert_eq!((stamp.0, pose.translation.vector), (500_000_000, geometry::Vector3::new(1.0, 2.0, 3.0)));
    }

    #[test]
    fn broken_lines_are_named() {
        let names = "stamp,x,y,z,qx,qy,qz,qw\n";
        for (text, line, rule) in [
            (String::new(), 1, "neither `stamp` (ns) nor `time_s`"),
            ("stamp,x,y,z,qx,qy,qz\n".to_owned(), 1, "no column `qw`"),
            (format!("{names}1,0,0,0,0,0,1\n"), 2, "7 fields, the first line names 8"),
            (format!("{names}1,0,0,NaN,0,0,0,1\n"), 2, "z: \"NaN\" is no number"),
            (format!("{names}1.5,0,0,0,0,0,0,1\n"), 2, "no whole number of ns"),
            (format!("{names}1,0,0,0,0,0,0,3\n"), 2, "has norm 3, must be 1"),
            (format!("{names}2,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,1\n"), 3, "before that of the line above"),
        ] {
            let error = trajectory_from_csv(&text).expect_err(&text);
            assert_eq!(error.line, line, "{text:?}");
            assert!(error.rule.contains(rule), "{error}");
        }
    }
}
