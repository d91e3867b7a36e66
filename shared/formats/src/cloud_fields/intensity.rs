//! One scale of the intensities of a recording. Sweeps hold intensities of 8 bits.
//!
//! | intensities | factor | reason |
//! |---|---|---|
//! | 8 bits, or up to 255 | 1 | the range of the sweeps |
//! | numbers with fraction up to 1 | 255 | KITTI |
//! | multiples of 257 or of 256 | 1/257, 1/256 | 8 bits, spread over 16: LAS, PCL, deliveries of this project |
//! | more than 1 % above 255 | 1/2, 1/4, ... | the largest power of two for which 99 % are at most 255: raw counts of 10 to 16 bits |
//!
//! A power of two is the same for different samples of a recording, and 1 % of retroreflectors would otherwise darken all other
//! surfaces.

use super::{Column, ValueType};
use std::fmt::Write;

/// Largest intensity of a sweep.
const MAX_INTENSITY: f64 = 255.0;
/// Quantile of the intensities that stays within the range.
const KEPT: f64 = 0.99;
/// Values of a cloud that are kept, evenly spaced.
const MAX_VALUES: usize = 200_000;
/// Factors of the page of the drive folder, which need no report.
const DOCUMENTED: [f64; 2] = [1.0, MAX_INTENSITY];
/// Smallest and largest factor.
const LIMITS: [f64; 2] = [1e-9, 1e9];

/// Intensities of some clouds of a recording.
#[derive(Clone, Debug, Default)]
pub struct IntensitySample {
    value_type: Option<ValueType>,
    name: String,
    values: Vec<f64>,
}

/// Scale of the intensities of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct IntensityScale {
    /// Factor by which intensities are multiplied.
    pub factor: f64,
    /// Text for the report; empty if intensities are read as they are.
    pub text: String,
}

impl Default for IntensityScale {
    fn default() -> Self {
        Self { factor: 1.0, text: String::new() }
    }
}

impl IntensitySample {
    /// Adds the intensities of a cloud.
    pub fn add(&mut self, column: &Column) {
        self.name.clone_from(&column.name);
        self.add_values(column.value_type, column.values.iter().copied());
    }

    /// Adds intensities of this type. Values that are not finite are ignored.
    pub fn add_values(&mut self, value_type: ValueType, values: impl ExactSizeIterator<Item = f64>) {
        self.value_type = Some(value_type);
        let step = values.len().div_ceil(MAX_VALUES).max(1);
        self.values.extend(values.step_by(step).filter(|value| value.is_finite()));
    }

    /// The scale of the recording.
    pub fn scale(mut self) -> IntensityScale {
        let Some(value_type) = self.value_type else { return IntensityScale::default() };
        if value_type.size() == 1 || self.values.is_empty() {
            return IntensityScale::default();
        }
        self.values.sort_by(f64::total_cmp);
        let n = self.values.len();
        let max = self.values[n - 1];
        let (factor, reason) = self.factor(value_type, max);
        let share = |is_one: &dyn Fn(f64) -> bool| {
            100.0 * self.values.iter().filter(|value| is_one(**value)).count() as f64 / n as f64
        };
        let saturated = share(&|value| value * factor > MAX_INTENSITY + 0.5);
        let negative = share(&|value| value < -0.5 / factor);
        let name = if self.name.is_empty() { "intensity" } else { &self.name };
        let mut text = String::new();
        if !DOCUMENTED.contains(&factor) || saturated > 0.0 || negative > 0.0 {
            text = format!("intensities: {name} ({}, up to {max}) times {factor}: {reason}", value_type.name());
        }
        for (percent, what) in [(saturated, "larger ones become 255"), (negative, "negative ones become 0")] {
            if percent > 0.0 {
                let _ = write!(text, "; {what}, {percent:.2} % of a sample");
            }
        }
        IntensityScale { factor, text }
    }

    /// The factor and its reason. The values are sorted.
    fn factor(&self, value_type: ValueType, max: f64) -> (f64, &'static str) {
        if max <= 1.0 && value_type.is_float() {
            return (MAX_INTENSITY, "numbers from 0 to 1");
        }
        if max <= MAX_INTENSITY {
            return (1.0, "numbers from 0 to 255");
        }
        for (step, reason) in [(257.0, "multiples of 257: 8 bits in 16"), (256.0, "multiples of 256: 8 bits in 16")] {
            if self.values.iter().all(|value| value % step == 0.0) && max <= step * MAX_INTENSITY {
                return (1.0 / step, reason);
            }
        }
        let kept = self.values[((self.values.len() - 1) as f64 * KEPT) as usize];
        let mut factor = 1.0;
        // Larger intensities are damage.
        while kept * factor > MAX_INTENSITY && factor > 2.0 * LIMITS[0] {
            factor *= 0.5;
        }
        (factor, "the largest power of two for which 99 % of a sample are at most 255")
    }
}

impl IntensityScale {
    /// Whether a factor is one that a user can set.
    pub fn is_factor(factor: f64) -> bool {
        (LIMITS[0]..=LIMITS[1]).contains(&factor)
    }

    /// The scale with a factor of the user.
    pub fn set(factor: f64) -> Self {
        Self { factor, text: String::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factor(value_type: ValueType, values: impl IntoIterator<Item = f64>) -> IntensityScale {
        let mut sample = IntensitySample::default();
        let values: Vec<f64> = values.into_iter().collect();
        sample.add_values(value_type, values.into_iter());
        sample.scale()
    }

    #[test]
    fn intensities_of_8_bits_stay_as_they_are() {
        let bytes = || (0..256).map(f64::from);
        for value_type in [ValueType::U8, ValueType::U16, ValueType::F32] {
            assert_eq!(factor(value_type, bytes()), IntensityScale::default(), "{value_type:?}");
        }
        // A dark recording of bytes.
        assert_eq!(factor(ValueType::U8, [0.0, 1.0, 1.0]), IntensityScale::default());
        assert_eq!(factor(ValueType::F32, [0.0, 0.25, 1.0]).factor, 255.0);
        assert_eq!(IntensitySample::default().scale(), IntensityScale::default());
    }

    #[test]
    fn intensities_of_16_bits_are_not_cut_at_255() {
        let lossless = factor(ValueType::U16, (0..256).map(|value| f64::from(value * 257)));
        assert!((0..256).all(|value| (f64::from(value * 257) * lossless.factor).round() == f64::from(value)));
        assert_eq!(factor(ValueType::U16, [256.0, 65_280.0]).factor, 1.0 / 256.0);
        // An Ouster: the ground at 255, retroreflectors in the thousands.
        let ouster = (0..1000).map(|k| if k < 5 { 9000.0 } else { f64::from(k) });
        let scale = factor(ValueType::F32, ouster);
        assert_eq!(scale.factor, 0.25);
        assert!(scale.text.contains("times 0.25") && scale.text.contains("0.50 % of a sample"), "{}", scale.text);
        // Decibels.
        assert!(factor(ValueType::F32, [-20.0, -3.0, 5.0]).text.contains("negative ones become 0, 66.67 %"));
        assert!(IntensityScale::is_factor(factor(ValueType::F32, [1e30; 9]).factor));
        assert!(factor(ValueType::F32, [f64::NAN, f64::INFINITY]).text.is_empty());
    }
}
