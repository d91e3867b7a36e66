//! Tables of residuals.

use super::Residual;
use files::csv::csv_cell;
use serde::Serialize;
use std::fmt::Write as _;

/// Accuracy over all check points.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Accuracy {
    /// East, north and up axes.
    pub axes: [AxisAccuracy; 3],
    /// Horizontal distance that 90 % of the points do not exceed, m. `None` without horizontal residuals.
    pub ce90_m: Option<f64>,
    /// Height difference that 90 % of the points do not exceed, m. `None` without residuals.
    pub le90_m: Option<f64>,
}

/// Residuals of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct AxisAccuracy {
    /// Number of residuals.
    pub n: usize,
    /// Mean, m; 0 without residuals.
    pub mean_m: f64,
    /// Root of the mean square, m; 0 without residuals.
    pub rmse_m: f64,
}

impl AxisAccuracy {
    fn from_residuals(residuals: &[f64]) -> Self {
        let n = residuals.len();
        let mean = |value: fn(f64) -> f64| residuals.iter().map(|r| value(*r)).sum::<f64>() / n.max(1) as f64;
        Self { n, mean_m: mean(|r| r), rmse_m: mean(|r| r * r).sqrt() }
    }
}

impl Accuracy {
    pub(super) fn from_residuals(residuals: &[Residual]) -> Self {
        let horizontal: Vec<[f64; 2]> = residuals.iter().filter_map(|residual| residual.horizontal_m).collect();
        let up: Vec<f64> = residuals.iter().filter_map(|residual| residual.up_m).collect();
        let axis =
            |k: usize| AxisAccuracy::from_residuals(&horizontal.iter().map(|residual| residual[k]).collect::<Vec<_>>());
        Self {
            axes: [axis(0), axis(1), AxisAccuracy::from_residuals(&up)],
            ce90_m: percentile(horizontal.iter().map(|[x, y]| x.hypot(*y)).collect(), 0.9),
            le90_m: percentile(up.iter().map(|up| up.abs()).collect(), 0.9),
        }
    }

    /// The table of accuracy, one measure per line.
    pub(super) fn table(&self) -> String {
        let mut text = "measure,points,value_m\n".to_owned();
        for (name, AxisAccuracy { n, mean_m, rmse_m }) in ["x", "y", "z"].iter().zip(self.axes) {
            // Writing to a string cannot fail.
            let _ = match n {
                0 => writeln!(text, "mean_{name},0,\nrmse_{name},0,"),
                _ => writeln!(text, "mean_{name},{n},{mean_m:.4}\nrmse_{name},{n},{rmse_m:.4}"),
            };
        }
        for (name, n, value) in [("ce90", self.axes[0].n, self.ce90_m), ("le90", self.axes[2].n, self.le90_m)] {
            let _ = writeln!(text, "{name},{n},{}", metres(value));
        }
        text
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

/// The table of residuals, one check point per line.
pub(super) fn table(residuals: &[Residual]) -> String {
    let mut text = "name,x,y,z,dx_m,dy_m,dz_m,points,roughness_m\n".to_owned();
    for Residual { point, horizontal_m, up_m, n_points, roughness_m } in residuals {
        let [x, y, z] = point.xyz;
        let [dx, dy] = [0, 1].map(|axis| metres(horizontal_m.map(|residual| residual[axis])));
        let dz = metres(*up_m);
        let roughness = metres(*roughness_m);
        let name = csv_cell(&point.name);
        let _ = writeln!(text, "{name},{x},{y},{z},{dx},{dy},{dz},{n_points},{roughness}");
    }
    text
}

/// A value as text; empty if unknown.
fn metres(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:.4}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check_points::CheckPoint;

    #[test]
    fn measures_are_those_counted_by_hand() {
        let residual = |horizontal_m: Option<[f64; 2]>, up_m: Option<f64>| Residual {
            point: CheckPoint { name: "A".to_owned(), xyz: [1.0, 2.5, 3.0], ..CheckPoint::default() },
            horizontal_m,
            up_m,
            n_points: 20,
            roughness_m: Some(0.01),
        };
        let residuals = [
            residual(Some([0.03, 0.04]), Some(-0.02)),
            residual(Some([-0.03, 0.0]), Some(0.04)),
            residual(None, Some(0.04)),
            residual(None, None),
        ];
        let accuracy = Accuracy::from_residuals(&residuals);
        assert_eq!(accuracy.axes.map(|axis| axis.n), [2, 2, 3]);
        assert!((accuracy.axes[0].rmse_m - 0.03).abs() < 1e-12 && accuracy.axes[0].mean_m.abs() < 1e-12);
        assert!((accuracy.axes[2].rmse_m - (0.0036_f64 / 3.0).sqrt()).abs() < 1e-12);
        // Distances 0.03 and 0.05.
        assert!((accuracy.ce90_m.expect("has some") - 0.048).abs() < 1e-12, "{accuracy:?}");
        assert!((accuracy.le90_m.expect("has some") - 0.04).abs() < 1e-12);
        let text = table(&residuals);
        assert_eq!(text.lines().nth(1), Some("A,1,2.5,3,0.0300,0.0400,-0.0200,20,0.0100"));
        assert_eq!(text.lines().nth(4), Some("A,1,2.5,3,,,,20,0.0100"));
        let mut named = residual(None, None);
        named.point.name = "=1+2".to_owned();
        assert_eq!(table(&[named]).lines().nth(1), Some("'=1+2,1,2.5,3,,,,20,0.0100"));
        assert!(accuracy.table().contains("rmse_x,2,0.0300\n") && accuracy.table().contains("le90,3,0.0400\n"));
        assert!(Accuracy::from_residuals(&[]).table().contains("rmse_z,0,\n"));
    }
}
