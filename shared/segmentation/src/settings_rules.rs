//! Rules shared by the settings of all network models.

use crate::SegmentationError;
use messages::{ClassId, UnknownClass};

/// The classes with these names.
///
/// # Errors
/// [`SegmentationError::Settings`] if a name is not in the class table.
pub fn classes_of_names(names: &[String]) -> Result<Vec<ClassId>, SegmentationError> {
    let classes: Result<Vec<ClassId>, _> = names.iter().map(|name| name.parse()).collect();
    classes.map_err(|unknown: UnknownClass| SegmentationError::Settings(format!("classes: {unknown}")))
}

/// The rule of the divisor of logits, with its text.
pub fn temperature_rule(temperature: f32) -> (bool, String) {
    ((0.1..=10.0).contains(&temperature), format!("temperature = {temperature}, must be 0.1 to 10"))
}

/// # Errors
/// [`SegmentationError::Settings`] with the text of the first rule that does not hold.
pub fn check_rules<const N: usize>(rules: [(bool, String); N]) -> Result<(), SegmentationError> {
    match rules.into_iter().find(|(holds, _)| !holds) {
        Some((_, text)) => Err(SegmentationError::Settings(text)),
        None => Ok(()),
    }
}
