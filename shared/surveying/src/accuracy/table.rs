//! The table of accuracy.

use super::{Accuracy, AccuracyClass, AxisAccuracy, DriveHeights, PointAccuracy};
use files::csv::csv_cell;
use std::fmt::Write as _;

/// A line for each measure of check and control points, and its header. Values are in m, also the classes.
pub fn accuracy_table(PointAccuracy { control, check }: &PointAccuracy) -> String {
    let mut text = "measure,points,value_m,use,note\n".to_owned();
    add(&mut text, check, "check");
    if control.n() > 0 {
        add(&mut text, control, "control");
    }
    text
}

/// Lines for [`accuracy_table`] with the height differences between drives.
pub fn heights_rows(heights: &[DriveHeights]) -> String {
    let mut text = String::new();
    for DriveHeights { drives: [a, b], n, mean_m, rmsd_m, class_cm, is_within_class } in heights {
        let note = match is_within_class {
            Some(true) => "within 0.8 of the vertical class".to_owned(),
            Some(false) => "not within 0.8 of the vertical class".to_owned(),
            None => format!("a vertical class of {class_cm} cm allows it"),
        };
        let pair = format!("{a} and {b}");
        let pair = csv_cell(&pair);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "mean_dz,{n},{mean_m:.4},{pair},\nrmsd_z,{n},{rmsd_m:.4},{pair},{note}");
    }
    text
}

fn add(text: &mut String, accuracy: &Accuracy, point_use: &str) {
    for (name, AxisAccuracy { n, mean_m, rmse_m }) in ["x", "y", "z"].iter().zip(accuracy.axes) {
        // Writing to a string cannot fail.
        let _ = match n {
            0 => writeln!(text, "mean_{name},0,,{point_use},\nrmse_{name},0,,{point_use},"),
            _ => writeln!(text, "mean_{name},{n},{mean_m:.4},{point_use},\nrmse_{name},{n},{rmse_m:.4},{point_use},"),
        };
    }
    let [n_horizontal, n_up] = [accuracy.axes[0].n, accuracy.axes[2].n];
    for (name, n, value) in [
        ("rmse_h", n_horizontal, accuracy.rmse_h_m),
        ("ce90", n_horizontal, accuracy.ce90_m),
        ("ce95", n_horizontal, accuracy.ce95_m),
        ("le90", n_up, accuracy.le90_m),
        ("le95", n_up, accuracy.le95_m),
    ] {
        let _ = writeln!(text, "{name},{n},{},{point_use},", metres(value));
    }
    for (name, class) in [("h", &accuracy.horizontal_class), ("v", &accuracy.vertical_class)] {
        if let Some(class @ AccuracyClass { class_cm, rmse_m, check_points_m, n, .. }) = class {
            let note = class.test_text().replace(", ", "; ");
            let class_m = f64::from(*class_cm) / 100.0;
            let _ = writeln!(
                text,
                "check_points_{name},{n},{check_points_m:.4},{point_use},\nproduct_rmse_{name},{n},{rmse_m:.4},{point_use},\n\
                 class_{name},{n},{class_m:.2},{point_use},{note}"
            );
        }
    }
}

/// A value as text; empty if unknown.
fn metres(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:.4}"))
}

#[cfg(test)]
mod tests {
    use super::super::PointResidual;
    use super::*;
    use crate::check_points::PointUse;

    #[test]
    fn table_has_a_line_for_each_measure_of_each_use() {
        let residual = |point_use| PointResidual {
            name: "A".to_owned(),
            point_use,
            east_north_m: Some([0.03, 0.04]),
            up_m: None,
            sigma_m: [0.02, 0.03],
        };
        let residuals = [residual(PointUse::Check), residual(PointUse::Control)];
        let text = accuracy_table(&PointAccuracy::from_residuals(&residuals));
        for line in [
            "rmse_x,1,0.0300,check,",
            "rmse_z,0,,check,",
            "rmse_h,1,0.0500,control,",
            "ce95,1,0.0865,check,",
            "class_h,1,0.06,check,not tested: 1 check points; 29 are missing",
        ] {
            assert!(text.lines().any(|found| found == line), "{line}: {text}");
        }
        assert!(!text.contains("class_v") && text.lines().all(|line| line.matches(',').count() == 4), "{text}");
        assert!(!accuracy_table(&PointAccuracy::from_residuals(&residuals[..1])).contains("control"));
        let pair = ["a, b".to_owned(), "c".to_owned()];
        let heights = DriveHeights::new(pair, &[0.01], None).expect("has a difference");
        assert!(
            heights_rows(&[heights]).contains("rmsd_z,1,0.0100,\"a, b and c\",a vertical class of 2 cm allows it\n")
        );
    }
}
