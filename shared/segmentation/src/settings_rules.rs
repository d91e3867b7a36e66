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

/// A rule of the settings.
pub struct Rule {
    holds: bool,
    /// Text of the error.
    text: String,
}

impl Rule {
    /// `text` says what was found and what must hold.
    pub fn new(holds: bool, text: String) -> Self {
        Self { holds, text }
    }
    /// The rule of the divisor of logits.
    pub fn for_temperature(temperature: f32) -> Self {
        Self::new((0.1..=10.0).contains(&temperature), format!("temperature = {temperature}, must be 0.1 to 10"))
    }
}

/// # Errors
/// [`SegmentationError::Settings`] with the text of the first rule that does not hold.
pub fn check_rules<const N: usize>(rules: [Rule; N]) -> Result<(), SegmentationError> {
    match rules.into_iter().find(|rule| !rule.holds) {
        Some(violated) => Err(SegmentationError::Settings(violated.text)),
        None => Ok(()),
    }
}
