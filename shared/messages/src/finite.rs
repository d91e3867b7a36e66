//! Checks that the numbers of a message are finite: NaN and infinity spread through every later stage.

use crate::pod::bytes_from_rows;
use crate::{Message, Pod};

/// A number of a message that is NaN or infinite.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{topic}: {place} {field} is {value}: all numbers must be finite")]
pub struct NotFinite {
    /// The topic.
    pub topic: &'static str,
    /// `header`, or the number of the row.
    pub place: String,
    /// Name of the field, with the index of an array's element.
    pub field: String,
    /// The number found.
    pub value: f64,
}

/// Checks the header of a message.
pub fn check_header<T: Message>(header: &T::Header) -> Result<(), NotFinite> {
    if header.is_finite() { Ok(()) } else { Err(first_fault::<T, _>(header, "header".to_owned())) }
}

/// Checks the rows of a message, if its topic requires it: [`Message::FINITE_ROWS`].
pub fn check_rows<T: Message>(rows: &[T::Row]) -> Result<(), NotFinite> {
    if !T::FINITE_ROWS {
        return Ok(());
    }
    match rows.iter().position(|row| !row.is_finite()) {
        Some(index) => Err(first_fault::<T, _>(&rows[index], format!("row {index}"))),
        None => Ok(()),
    }
}

/// The first number that is not finite.
fn first_fault<T: Message, P: Pod>(value: &P, place: String) -> NotFinite {
    let bytes = bytes_from_rows(std::slice::from_ref(value));
    let mut fields = Vec::new();
    P::describe("", 0, &mut fields);
    for field in fields {
        let elements = |size: usize| bytes[field.offset..].chunks_exact(size).take(field.count).enumerate();
        let numbers: Vec<(usize, f64)> = match field.kind.as_str() {
            "f32" => {
                elements(4).map(|(i, b)| (i, f64::from(f32::from_le_bytes(b.try_into().expect("4 bytes"))))).collect()
            }
            "f64" => elements(8).map(|(i, b)| (i, f64::from_le_bytes(b.try_into().expect("8 bytes")))).collect(),
            _ => Vec::new(),
        };
        if let Some((index, value)) = numbers.into_iter().find(|(_, value)| !value.is_finite()) {
            let field = if field.count > 1 { format!("{}[{index}]", field.name) } else { field.name };
            return NotFinite { topic: T::TOPIC, place, field, value };
        }
    }
    NotFinite { topic: T::TOPIC, place, field: "a number".to_owned(), value: f64::NAN }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{StampedPose, SubmapHeader, SubmapTopic, SweepHeader, SweepPoint, SweepTopic, TrajectoryTopic};

    #[test]
    fn first_number_that_is_not_finite_is_named() {
        let mut header = SubmapHeader::default();
        assert_eq!(check_header::<SubmapTopic>(&header), Ok(()));
        header.sweeps[3].submap_from_lidar_end[2] = f32::NEG_INFINITY;
        let fault = check_header::<SubmapTopic>(&header).expect_err("infinite");
        assert_eq!((fault.field.as_str(), fault.value), ("sweeps.3.submap_from_lidar_end[2]", f64::NEG_INFINITY));
        header.odom_from_submap.translation[1] = f64::NAN;
        let text = check_header::<SubmapTopic>(&header).expect_err("NaN").to_string();
        assert_eq!(text, "submap: header odom_from_submap.translation[1] is NaN: all numbers must be finite");
    }

    #[test]
    fn poses_are_checked_and_points_are_not() {
        let mut rows = [StampedPose::default(); 3];
        assert_eq!(check_rows::<TrajectoryTopic>(&rows), Ok(()));
        rows[2].odom_from_body.rotation[3] = f64::INFINITY;
        let text = check_rows::<TrajectoryTopic>(&rows).expect_err("infinite").to_string();
        assert_eq!(text, "trajectory: row 2 odom_from_body.rotation[3] is inf: all numbers must be finite");
        assert_eq!(check_header::<SweepTopic>(&SweepHeader::default()), Ok(()));
        assert_eq!(check_rows::<SweepTopic>(&[SweepPoint { x: f32::NAN, ..SweepPoint::default() }]), Ok(()));
    }
}
