//! The check points on a map: height differences as colors, horizontal differences as enlarged lines.

use super::Residual;
use chart::{COLORS, Chart, Series};

/// Upper limits of the height differences of each color, m; larger differences have the last color.
const HEIGHT_STEPS_M: [f64; 2] = [0.02, 0.05];
/// Green, yellow and orange up to the steps and beyond, gray without height.
const HEIGHT_COLORS: [&str; 4] = [COLORS[2], COLORS[4], COLORS[1], COLORS[7]];
const PATH_COLOR: &str = COLORS[5];
const HORIZONTAL_COLOR: &str = COLORS[0];
/// Enlargement factor of horizontal differences.
const ENLARGED: f64 = 100.0;

/// Content of an SVG file. `path` is the path of the vehicle; all coordinates are in the system of the delivery, m.
pub(super) fn map(residuals: &[Residual], path: Vec<[f64; 2]>) -> String {
    let mut series = vec![Series::thin_line("path", PATH_COLOR, path)];
    for Residual { point, horizontal_m, .. } in residuals {
        let [x, y, _] = point.xyz;
        if let Some([east_m, north_m]) = horizontal_m {
            let end = [x + ENLARGED * east_m, y + ENLARGED * north_m];
            series.push(Series::thin_line(
                format!("horizontal, {ENLARGED} times"),
                HORIZONTAL_COLOR,
                vec![[x, y], end],
            ));
        }
    }
    let [fine, coarse] = HEIGHT_STEPS_M;
    let names = [
        format!("height within {fine} m"),
        format!("within {coarse} m"),
        format!("beyond {coarse} m"),
        "no height".to_owned(),
    ];
    for (step, (name, color)) in names.into_iter().zip(HEIGHT_COLORS).enumerate() {
        let of_step = residuals.iter().filter(|residual| step_of(residual.up_m) == step);
        let points: Vec<[f64; 2]> = of_step.map(|Residual { point, .. }| [point.xyz[0], point.xyz[1]]).collect();
        if !points.is_empty() {
            series.push(Series::dots(name, color, points));
        }
    }
    Chart::map("Check points: cloud minus check point", ["x, m", "y, m"], series).svg()
}

/// Index of a height difference in [`HEIGHT_COLORS`].
fn step_of(up_m: Option<f64>) -> usize {
    let Some(up_m) = up_m else { return HEIGHT_COLORS.len() - 1 };
    HEIGHT_STEPS_M.iter().filter(|step| up_m.abs() > **step).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check_points::CheckPoint;

    #[test]
    fn map_has_a_color_for_each_size_of_height_difference() {
        let residual = |x: f64, horizontal_m: Option<[f64; 2]>, up_m: Option<f64>| Residual {
            point: CheckPoint { name: "A".to_owned(), xyz: [x, 5.0, 3.0], ..CheckPoint::default() },
            horizontal_m,
            up_m,
            n_points: 20,
            roughness_m: None,
        };
        assert_eq!([Some(-0.02), Some(0.03), Some(-0.06), None].map(step_of), [0, 1, 2, 3]);
        let residuals = [residual(1.0, Some([0.01, 0.0]), Some(0.01)), residual(9.0, None, None)];
        let svg = map(&residuals, vec![[0.0, 0.0], [10.0, 10.0]]);
        for text in ["height within 0.02 m", "no height", "horizontal, 100 times", "path"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("beyond"), "no entry without points");
    }
}
