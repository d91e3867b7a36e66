//! The table of residuals.

use super::Residual;
use files::csv::csv_cell;
use std::fmt::Write as _;

/// The table of residuals, one check point per line.
pub(super) fn table(residuals: &[Residual]) -> String {
    let mut text = "name,x,y,z,dx_m,dy_m,dz_m,points,roughness_m,use\n".to_owned();
    for Residual { point, horizontal_m, up_m, n_points, roughness_m } in residuals {
        let [x, y, z] = point.xyz;
        let [dx, dy] = [0, 1].map(|axis| metres(horizontal_m.map(|residual| residual[axis])));
        let dz = metres(*up_m);
        let roughness = metres(*roughness_m);
        let name = csv_cell(&point.name);
        let point_use = point.point_use.name();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name},{x},{y},{z},{dx},{dy},{dz},{n_points},{roughness},{point_use}");
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
    use crate::check_points::{CheckPoint, PointUse};

    #[test]
    fn row_of_a_residual_has_empty_cells_for_unknown_values() {
        let residual = |horizontal_m: Option<[f64; 2]>, up_m: Option<f64>| Residual {
            point: CheckPoint { name: "A".to_owned(), xyz: [1.0, 2.5, 3.0], ..CheckPoint::default() },
            horizontal_m,
            up_m,
            n_points: 20,
            roughness_m: Some(0.01),
        };
        let text = table(&[residual(Some([0.03, 0.04]), Some(-0.02)), residual(None, None)]);
        assert_eq!(text.lines().nth(1), Some("A,1,2.5,3,0.0300,0.0400,-0.0200,20,0.0100,check"));
        assert_eq!(text.lines().nth(2), Some("A,1,2.5,3,,,,20,0.0100,check"));
        let mut named = residual(None, None);
        named.point.name = "=1+2".to_owned();
        named.point.point_use = PointUse::Control;
        assert_eq!(table(&[named]).lines().nth(1), Some("'=1+2,1,2.5,3,,,,20,0.0100,control"));
    }
}
