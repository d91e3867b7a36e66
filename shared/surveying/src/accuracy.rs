//! Accuracy at points with known coordinates and between drives, in the measures of surveying.
//!
//! | measure | source |
//! |---|---|
//! | `RMSE_H`, `RMSE_V`, accuracy classes, number of check points, `RMSDz` | ASPRS Positional Accuracy Standards, edition 2 (2023) |
//! | CE95, LE95 | NSSDA (FGDC-STD-007.3-1998) |
//!
//! Residuals are result minus known coordinates. `replica survey` and `replica deliver` both report by this module.

mod class;
mod heights;
mod table;

pub use class::{AccuracyClass, MIN_CHECK_POINTS};
pub use heights::DriveHeights;
pub use table::{accuracy_table, heights_rows};

use crate::check_points::PointUse;
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;

/// CE95 as a multiple of the root mean square of the horizontal distance, for equal errors of both axes (NSSDA).
const CE95: f64 = 1.7308;
/// LE95 as a multiple of the root mean square of the height difference (NSSDA).
const LE95: f64 = 1.96;

/// Residual of a point with known coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointResidual {
    /// Its name.
    pub name: String,
    /// Whether it moved the result.
    pub point_use: PointUse,
    /// East and north, m. `None`: not measured.
    pub east_north_m: Option<[f64; 2]>,
    /// Up, m. `None`: not measured.
    pub up_m: Option<f64>,
    /// Standard deviation of the known coordinates: horizontally along each axis, and up, m.
    pub sigma_m: [f64; 2],
}

/// Accuracy over points of one use.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Accuracy {
    /// East, north and up axes.
    pub axes: [AxisAccuracy; 3],
    /// Root of the mean square of the horizontal distance, m. `None` without horizontal residuals.
    pub rmse_h_m: Option<f64>,
    /// Horizontal distance that 90 % of the points do not exceed, m. `None` without horizontal residuals.
    pub ce90_m: Option<f64>,
    /// Height difference that 90 % of the points do not exceed, m. `None` without residuals.
    pub le90_m: Option<f64>,
    /// 1.7308 times `rmse_h_m`: the distance that 95 % of normal errors do not exceed, m.
    pub ce95_m: Option<f64>,
    /// 1.96 times the RMSE up: the difference that 95 % of normal errors do not exceed, m.
    pub le95_m: Option<f64>,
    /// Horizontal accuracy class. `None` for control points and without horizontal residuals.
    pub horizontal_class: Option<AccuracyClass>,
    /// Vertical accuracy class. `None` for control points and without residuals.
    pub vertical_class: Option<AccuracyClass>,
}

/// Residuals of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AxisAccuracy {
    /// Number of residuals.
    pub n: usize,
    /// Mean, m; 0 without residuals.
    pub mean_m: f64,
    /// Root of the mean square, m; 0 without residuals.
    pub rmse_m: f64,
}

/// Accuracy at control points and at check points, which did not move the result.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointAccuracy {
    /// Points that moved the result: how well it fits them.
    pub control: Accuracy,
    /// Points that did not move the result: how accurate it is.
    pub check: Accuracy,
}

impl AxisAccuracy {
    fn from_residuals(residuals: &[f64]) -> Self {
        let n = residuals.len();
        let mean = |value: fn(f64) -> f64| residuals.iter().map(|r| value(*r)).sum::<f64>() / n.max(1) as f64;
        Self { n, mean_m: mean(|r| r), rmse_m: mean(|r| r * r).sqrt() }
    }
}

impl Accuracy {
    fn from_residuals(residuals: &[&PointResidual]) -> Self {
        let horizontal: Vec<[f64; 2]> = residuals.iter().filter_map(|residual| residual.east_north_m).collect();
        let up: Vec<f64> = residuals.iter().filter_map(|residual| residual.up_m).collect();
        let axis =
            |k: usize| AxisAccuracy::from_residuals(&horizontal.iter().map(|residual| residual[k]).collect::<Vec<_>>());
        let axes = [axis(0), axis(1), AxisAccuracy::from_residuals(&up)];
        let rmse_h_m = (axes[0].n > 0).then(|| axes[0].rmse_m.hypot(axes[1].rmse_m));
        Self {
            axes,
            rmse_h_m,
            ce90_m: percentile(horizontal.iter().map(|[x, y]| x.hypot(*y)).collect(), 0.9),
            le90_m: percentile(up.iter().map(|up| up.abs()).collect(), 0.9),
            ce95_m: rmse_h_m.map(|rmse| CE95 * rmse),
            le95_m: (axes[2].n > 0).then(|| LE95 * axes[2].rmse_m),
            horizontal_class: None,
            vertical_class: None,
        }
    }

    fn with_classes(self, residuals: &[&PointResidual]) -> Self {
        let [mut horizontal, mut up] = [Vec::new(), Vec::new()];
        for PointResidual { east_north_m, up_m, sigma_m: [sigma_xy, sigma_z], .. } in residuals {
            // The deviation along each of two axes.
            horizontal.extend(east_north_m.map(|_| sigma_xy * std::f64::consts::SQRT_2));
            up.extend(up_m.map(|_| sigma_z));
        }
        Self {
            horizontal_class: self.rmse_h_m.and_then(|rmse| AccuracyClass::new(rmse, &horizontal)),
            vertical_class: AccuracyClass::new(self.axes[2].rmse_m, &up),
            ..self
        }
    }

    /// Number of points with a residual along any axis, at least.
    fn n(&self) -> usize {
        self.axes[0].n.max(self.axes[2].n)
    }

    /// One measure per line, each after `subject`, such as `check points`. Empty without residuals.
    pub fn text(&self, subject: &str) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        for (name, AxisAccuracy { n, mean_m, rmse_m }) in ["x", "y", "z"].iter().zip(self.axes) {
            if n > 0 {
                let _ = writeln!(text, "{subject}, {name}: {n} points, RMSE {rmse_m:.3} m, mean {mean_m:.3} m");
            }
        }
        if let (Some(rmse), Some(ce95), Some(ce90)) = (self.rmse_h_m, self.ce95_m, self.ce90_m) {
            let _ = writeln!(text, "{subject}: RMSE_H {rmse:.3} m, CE95 {ce95:.3} m, CE90 {ce90:.3} m");
        }
        if let (Some(le95), Some(le90)) = (self.le95_m, self.le90_m) {
            let rmse = self.axes[2].rmse_m;
            let _ = writeln!(text, "{subject}: RMSE_V {rmse:.3} m, LE95 {le95:.3} m, LE90 {le90:.3} m");
        }
        for (name, class) in [("horizontal", &self.horizontal_class), ("vertical", &self.vertical_class)] {
            if let Some(class) = class {
                let _ = writeln!(text, "{name} accuracy class (ASPRS 2023): {class}");
            }
        }
        text
    }
}

impl PointAccuracy {
    /// The accuracy at points of both uses.
    pub fn from_residuals(residuals: &[PointResidual]) -> Self {
        let with_use = |point_use: PointUse| -> Vec<&PointResidual> {
            residuals.iter().filter(|residual| residual.point_use == point_use).collect()
        };
        let check = with_use(PointUse::Check);
        Self {
            control: Accuracy::from_residuals(&with_use(PointUse::Control)),
            check: Accuracy::from_residuals(&check).with_classes(&check),
        }
    }

    /// One measure per line.
    pub fn text(&self) -> String {
        self.control.text("control points") + &self.check.text("check points")
    }
}

/// The value that this share of the values (0 to 1) does not exceed, linear between the sorted values. `None` without
/// values.
pub fn percentile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let at = share * values.len().checked_sub(1)? as f64;
    let below = values[at.floor() as usize];
    let above = values[at.ceil() as usize];
    Some(below + (above - below) * at.fract())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn residual(east_north_m: Option<[f64; 2]>, up_m: Option<f64>) -> PointResidual {
        let sigma_m = [0.01, 0.015];
        PointResidual { name: "A".to_owned(), point_use: PointUse::Check, east_north_m, up_m, sigma_m }
    }

    #[test]
    fn measures_equal_results_by_hand() {
        let residuals = [
            residual(Some([0.03, 0.04]), Some(-0.02)),
            residual(Some([-0.03, 0.0]), Some(0.04)),
            residual(None, Some(0.04)),
            residual(None, None),
        ];
        let accuracy = PointAccuracy::from_residuals(&residuals).check;
        assert_eq!(accuracy.axes.map(|axis| axis.n), [2, 2, 3]);
        assert!((accuracy.axes[0].rmse_m - 0.03).abs() < 1e-12 && accuracy.axes[0].mean_m.abs() < 1e-12);
        let rmse_v = (0.0036_f64 / 3.0).sqrt();
        assert!((accuracy.axes[2].rmse_m - rmse_v).abs() < 1e-12);
        // Distances 0.03 and 0.05.
        assert!((accuracy.ce90_m.expect("has some") - 0.048).abs() < 1e-12, "{accuracy:?}");
        assert!((accuracy.le90_m.expect("has some") - 0.04).abs() < 1e-12);
        let rmse_h = 0.0017_f64.sqrt();
        assert!((accuracy.rmse_h_m.expect("has some") - rmse_h).abs() < 1e-12);
        assert!((accuracy.ce95_m.expect("has some") - 1.7308 * rmse_h).abs() < 1e-12);
        assert!((accuracy.le95_m.expect("has some") - 1.96 * rmse_v).abs() < 1e-12);
        // Horizontal: 0.0017 and 2 times 0.01² of the check points; vertical: 0.0012 and 0.015².
        let [horizontal, vertical] =
            [accuracy.horizontal_class, accuracy.vertical_class].map(|class| class.expect("is"));
        assert!((horizontal.rmse_m - 0.0019_f64.sqrt()).abs() < 1e-12 && horizontal.class_cm == 5, "{horizontal:?}");
        assert!((vertical.rmse_m - 0.001_425_f64.sqrt()).abs() < 1e-12 && vertical.class_cm == 4, "{vertical:?}");
        assert_eq!((horizontal.n, horizontal.n_missing, vertical.n_missing), (2, 28, 27));
    }

    #[test]
    fn control_points_are_reported_apart_and_have_no_class() {
        let control = PointResidual { point_use: PointUse::Control, ..residual(Some([0.2, 0.0]), Some(0.3)) };
        let accuracy = PointAccuracy::from_residuals(&[control, residual(None, Some(0.01))]);
        assert_eq!([accuracy.control.n(), accuracy.check.n()], [1, 1]);
        assert!((accuracy.control.axes[2].rmse_m - 0.3).abs() < 1e-12);
        assert!((accuracy.check.axes[2].rmse_m - 0.01).abs() < 1e-12);
        assert_eq!((accuracy.control.horizontal_class, accuracy.control.vertical_class), (None, None));
        assert_eq!(accuracy.check.horizontal_class, None);
        assert!(accuracy.text().contains("control points: RMSE_V 0.300 m, LE95 0.588 m"), "{}", accuracy.text());
        assert_eq!(PointAccuracy::from_residuals(&[]).text(), "");
    }
}
