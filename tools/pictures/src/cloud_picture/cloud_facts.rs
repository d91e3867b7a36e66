//! Statistics of clouds as a table and as JSON.

use page::grouped;
use serde::Serialize;
use std::fmt::Write;

/// Statistics of a set of clouds. `None` if the clouds do not have the column.
#[derive(Serialize)]
pub struct CloudFacts {
    /// Number of points of all clouds.
    pub points: usize,
    /// Smallest and largest x y z, m.
    pub bounds_m: Option<[[f64; 3]; 2]>,
    /// Time from the first return to the last one, s.
    pub seconds: Option<f64>,
    /// Length of the path of the LiDAR, m.
    pub path_m: Option<f64>,
    /// Points that a camera saw.
    pub colored_points: Option<usize>,
    /// Number of different instances.
    pub instances: Option<usize>,
    /// Points by class, the most frequent class first.
    pub classes: Vec<Count>,
    /// Points by material, the most frequent material first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<Count>,
    /// Points by cloud, in the order of the file names.
    pub clouds: Vec<Count>,
}

/// Points of a class or of a cloud.
#[derive(Serialize)]
pub struct Count {
    pub name: String,
    pub points: usize,
}

impl CloudFacts {
    /// A table; `path` names the clouds.
    pub fn table(&self, path: &str) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{path}: {} clouds, {} points", self.clouds.len(), grouped(self.points));
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            if let Some([min, max]) = self.bounds_m {
                let _ = writeln!(text, "{axis} {:>12.2} to {:>10.2} m, {:>8.2} m", min[k], max[k], max[k] - min[k]);
            }
        }
        if let Some(seconds) = self.seconds {
            let _ = writeln!(text, "time {seconds:.3} s");
        }
        if let Some(path_m) = self.path_m {
            let _ = writeln!(text, "path {path_m:.1} m");
        }
        if let Some(n_colored) = self.colored_points {
            let _ = writeln!(text, "color {:.1} % of the points", self.percent(n_colored));
        }
        if let Some(n_instances) = self.instances {
            let _ = writeln!(text, "instances {n_instances}");
        }
        self.list(&mut text, "class", &self.classes);
        self.list(&mut text, "material", &self.materials);
        self.list(&mut text, "cloud", &self.clouds);
        text
    }

    fn list(&self, text: &mut String, title: &str, rows: &[Count]) {
        if rows.is_empty() {
            return;
        }
        let width = rows.iter().map(|row| row.name.len()).max().unwrap_or_default().max(title.len());
        let _ = writeln!(text, "\n{title:<width$} {:>14} {:>8}", "points", "share");
        for Count { name, points } in rows {
            let _ = writeln!(text, "{name:<width$} {:>14} {:>6.1} %", grouped(*points), self.percent(*points));
        }
    }

    fn percent(&self, n: usize) -> f64 {
        100.0 * n as f64 / self.points.max(1) as f64
    }
}
