//! TUM (Sturm et al., IROS 2012): one pose per line, `t tx ty tz qx qy qz qw`, seconds since the Unix epoch, m, unit
//! quaternion. A comment before the first pose may name another order of the quaternion, as `qw qx qy qz`.

use super::line::{content_lines, parse_numbers, parse_stamp, rotation};
use super::{PoseFault, TrajectoryError};
use geometry::{Isometry3, Trajectory, Translation3};
use std::fmt::Write;

/// The trajectory in TUM format, stamps to the nanosecond.
pub fn tum_from_trajectory(trajectory: &Trajectory) -> String {
    let mut text = String::new();
    for (stamp, pose) in trajectory.poses() {
        let t = pose.translation.vector;
        let q = pose.rotation.coords;
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{stamp} {} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w);
    }
    text
}

/// Reads TUM format by the rules of the [module](super).
pub fn trajectory_from_tum(text: &str) -> Result<Trajectory, TrajectoryError> {
    let order = quaternion_order(text);
    let mut trajectory = Trajectory::default();
    for (line, fields) in content_lines(text) {
        let error = |fault: PoseFault| TrajectoryError { line, fault };
        let (stamp, numbers) = fields.split_once(char::is_whitespace).unwrap_or((fields, ""));
        let stamp = parse_stamp(stamp).map_err(error)?;
        let [x, y, z, quaternion @ ..] = parse_numbers::<7>(numbers).map_err(error)?;
        let pose =
            Isometry3::from_parts(Translation3::new(x, y, z), rotation(order.map(|at| quaternion[at])).map_err(error)?);
        super::push(&mut trajectory, line, stamp, pose)?;
    }
    Ok(trajectory)
}

/// Positions of x y z w among the four numbers of a quaternion: as named by the last comment before the first pose that names all
/// four one after the other, otherwise x y z w.
fn quaternion_order(text: &str) -> [usize; 4] {
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let heads = lines.map_while(|line| line.strip_prefix('#')).filter_map(order_in_words);
    heads.last().unwrap_or([0, 1, 2, 3])
}

fn order_in_words(head: &str) -> Option<[usize; 4]> {
    let is_separator = |c: char| c.is_whitespace() || ",;[](){}:".contains(c);
    let words = head.split(is_separator).filter(|word| !word.is_empty());
    let words: Vec<String> = words.map(|word| word.to_lowercase().replace('_', "")).collect();
    let position = |name: &str| words.iter().position(|word| word == name);
    let [x, y, z, w] = [position("qx")?, position("qy")?, position("qz")?, position("qw")?];
    let first = x.min(y).min(z).min(w);
    let order = [x, y, z, w].map(|at| at - first);
    order.iter().all(|at| *at < 4).then_some(order)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_of_the_quaternion_is_the_one_that_the_header_names() {
        let turned = |text: &str| {
            let trajectory = trajectory_from_tum(text).expect(text);
            trajectory.poses()[0].1.rotation.euler_angles().2
        };
        let row = "1 0 0 0 0.6 0 0 0.8\n";
        let expected = 2.0 * 0.6_f64.atan2(0.8);
        for head in [
            "# timestamp tx ty tz qw qx qy qz",
            "#t [s], x, y, z, q_w, q_x, q_y, q_z",
            "# by us\n# TUM: t x y z QW QX QY QZ",
        ] {
            let found = turned(&format!("{head}\n{row}"));
            let about_z = 2.0 * 0.8_f64.atan2(0.6);
            assert!((found - about_z).abs() < 1e-12, "{head}: {found}");
        }
        // About x: the vertical angle stays 0.
        for head in ["", "# timestamp tx ty tz qx qy qz qw\n", "# qw first\n", "# a\n\n"] {
            let text = format!("{head}{row}# qw qx qy qz\n2 0 0 0 0.6 0 0 0.8\n");
            let trajectory = trajectory_from_tum(&text).expect("parses");
            let angles = trajectory.poses()[0].1.rotation.euler_angles();
            assert!((angles.0 - expected).abs() < 1e-12 && angles.2.abs() < 1e-12, "{head}: {angles:?}");
        }
    }
}
