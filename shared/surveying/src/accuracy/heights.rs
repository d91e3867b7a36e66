//! Height differences between the ground of two drives.

use super::class::{AccuracyClass, least_class_cm};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Largest root mean square height difference between drives, as a share of the vertical class (swath to swath).
const MAX_SHARE: f64 = 0.8;

/// How far the ground of two drives is apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriveHeights {
    /// Names of the drives.
    pub drives: [String; 2],
    /// Number of places at which both show the ground.
    pub n: usize,
    /// Mean height of the first drive above the second one, m.
    pub mean_m: f64,
    /// Root mean square difference (`RMSDz`), m.
    pub rmsd_m: f64,
    /// Smallest vertical class in whole cm of which 0.8 is at least `rmsd_m`.
    pub class_cm: u32,
    /// Whether `rmsd_m` is at most 0.8 of the vertical class by the check points. `None` without check points.
    pub is_within_class: Option<bool>,
}

impl DriveHeights {
    /// The measures of differences, m. `class`: the vertical class by the check points. `None` without differences.
    pub fn new(drives: [String; 2], differences_m: &[f64], class: Option<&AccuracyClass>) -> Option<Self> {
        let n = differences_m.len();
        if n == 0 {
            return None;
        }
        let mean = |value: fn(f64) -> f64| differences_m.iter().map(|d| value(*d)).sum::<f64>() / n as f64;
        let rmsd_m = mean(|d| d * d).sqrt();
        Some(Self {
            drives,
            n,
            mean_m: mean(|d| d),
            rmsd_m,
            class_cm: least_class_cm(rmsd_m / MAX_SHARE),
            is_within_class: class.map(|class| least_class_cm(rmsd_m / MAX_SHARE) <= class.class_cm),
        })
    }
}

impl fmt::Display for DriveHeights {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { drives: [a, b], n, mean_m, rmsd_m, class_cm, is_within_class } = self;
        write!(f, "{a} and {b}: RMSDz {rmsd_m:.3} m, mean {mean_m:.3} m at {n} places of the ground; ")?;
        match is_within_class {
            Some(true) => write!(f, "within 0.8 of the vertical class"),
            Some(false) => write!(f, "NOT within 0.8 of the vertical class, which would need {class_cm} cm"),
            None => write!(f, "a vertical class of {class_cm} cm allows it"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_compared_with_eight_tenths_of_the_class() {
        let names = || ["a".to_owned(), "b".to_owned()];
        let class = |cm: f64| AccuracyClass::new(cm / 100.0, &[0.0]);
        let heights = |class: Option<&AccuracyClass>| DriveHeights::new(names(), &[0.016, -0.016], class).expect("has");
        // 1.6 cm is 0.8 of 2 cm.
        let plain = heights(None);
        assert_eq!((plain.n, plain.class_cm, plain.is_within_class), (2, 2, None));
        assert!(plain.mean_m.abs() < 1e-12 && (plain.rmsd_m - 0.016).abs() < 1e-12);
        assert_eq!(heights(class(2.0).as_ref()).is_within_class, Some(true));
        assert_eq!(heights(class(1.0).as_ref()).is_within_class, Some(false));
        assert_eq!(DriveHeights::new(names(), &[], None), None);
    }
}
