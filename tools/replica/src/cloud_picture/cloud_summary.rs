//! Statistics of a set of clouds.

use super::loaded_cloud::LoadedCloud;
use super::settings::ColorBy;
use messages::class_name;
use page::grouped;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

/// Points of one file that are sampled for percentiles and for the path.
const SAMPLES: usize = 20_000;

/// Least distance between two positions of the path, m.
const PATH_STEP_M: f64 = 0.2;

/// Statistics of the clouds that were added.
#[derive(Default)]
pub struct CloudSummary {
    files: Vec<(String, usize)>,
    bounds: Option<[[f64; 3]; 2]>,
    heights: Vec<f64>,
    intensities: Vec<f64>,
    path: Vec<[f64; 3]>,
    times_s: Option<[f64; 2]>,
    n_points: usize,
    n_colored: usize,
    has_color: bool,
    classes: BTreeMap<&'static str, usize>,
    instances: Option<BTreeSet<i64>>,
}

impl CloudSummary {
    /// Adds a cloud.
    pub fn add(&mut self, file: &Path, cloud: &LoadedCloud) {
        self.files.push((file.file_name().unwrap_or_default().to_string_lossy().into_owned(), cloud.len()));
        self.n_points += cloud.len();
        self.has_color |= cloud.has_color();
        self.n_colored += (0..cloud.len()).filter(|i| cloud.color(*i).is_some()).count();
        (0..cloud.len()).for_each(|i| self.extend_bounds(cloud.position(i)));
        for class in cloud.classes().unwrap_or_default() {
            *self.classes.entry(class_name(*class)).or_default() += 1;
        }
        if let Some(ids) = cloud.instances() {
            self.instances.get_or_insert_default().extend(ids.iter().filter(|id| **id != 0));
        }
        for time_s in cloud.times_s().unwrap_or_default() {
            let [first, last] = self.times_s.get_or_insert([*time_s; 2]);
            (*first, *last) = (first.min(*time_s), last.max(*time_s));
        }
        for i in (0..cloud.len()).step_by(cloud.len().div_ceil(SAMPLES).max(1)) {
            self.sample(cloud, i);
        }
    }

    fn extend_bounds(&mut self, position: [f64; 3]) {
        if !position.iter().all(|v| v.is_finite()) {
            return;
        }
        let [min, max] = self.bounds.get_or_insert([position; 2]);
        for k in 0..3 {
            min[k] = min[k].min(position[k]);
            max[k] = max[k].max(position[k]);
        }
    }

    fn sample(&mut self, cloud: &LoadedCloud, i: usize) {
        self.heights.push(cloud.position(i)[2]);
        if let Some(intensities) = cloud.intensities() {
            self.intensities.push(f64::from(intensities[i]));
        }
        let Some(position) = cloud.lidar_position(i).filter(|p| p.iter().all(|v| v.is_finite())) else { return };
        let is_new = |last: &[f64; 3]| (position[0] - last[0]).hypot(position[1] - last[1]) >= PATH_STEP_M;
        if self.path.last().is_none_or(is_new) {
            self.path.push(position);
        }
    }

    /// Smallest and largest x y z, m.
    pub fn bounds(&self) -> Option<[[f64; 3]; 2]> {
        self.bounds
    }
    /// Positions of the lidar, m, in the order of the points. Empty if the clouds have none.
    pub fn path(&self) -> &[[f64; 3]] {
        &self.path
    }
    /// 1st and 99th percentile of the heights, m.
    pub fn height_range(&self) -> [f64; 2] {
        percentiles(&self.heights)
    }
    /// 1st and 99th percentile of the intensities.
    pub fn intensity_range(&self) -> [f64; 2] {
        percentiles(&self.intensities)
    }
    /// The default coloring: the most informative one that the clouds have.
    pub fn default_coloring(&self) -> ColorBy {
        match () {
            () if self.n_colored > 0 => ColorBy::Color,
            () if !self.classes.is_empty() => ColorBy::Class,
            () => ColorBy::Height,
        }
    }

    /// The statistics as text.
    pub fn table(&self, path: &Path) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}: {} clouds, {} points", path.display(), self.files.len(), grouped(self.n_points));
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            if let Some([min, max]) = self.bounds {
                let _ = writeln!(text, "{axis} {:>12.2} to {:>10.2} m, {:>8.2} m", min[k], max[k], max[k] - min[k]);
            }
        }
        if let Some([first, last]) = self.times_s {
            let _ = writeln!(text, "time {:.3} s", last - first);
        }
        if !self.path.is_empty() {
            let _ = writeln!(text, "path {:.1} m", length_m(&self.path));
        }
        if self.has_color {
            let _ = writeln!(text, "color {:.1} % of the points", self.percent(self.n_colored));
        }
        if let Some(instances) = &self.instances {
            let _ = writeln!(text, "instances {}", instances.len());
        }
        let mut classes: Vec<(&str, usize)> = self.classes.iter().map(|(name, n)| (*name, *n)).collect();
        classes.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
        self.list(&mut text, "class", &classes);
        let files: Vec<(&str, usize)> = self.files.iter().map(|(name, n)| (name.as_str(), *n)).collect();
        self.list(&mut text, "cloud", &files);
        text
    }

    fn list(&self, text: &mut String, title: &str, rows: &[(&str, usize)]) {
        if rows.is_empty() {
            return;
        }
        let width = rows.iter().map(|(name, _)| name.len()).max().unwrap_or_default().max(title.len());
        let _ = writeln!(text, "\n{title:<width$} {:>14} {:>8}", "points", "share");
        for (name, n) in rows {
            let _ = writeln!(text, "{name:<width$} {:>14} {:>6.1} %", grouped(*n), self.percent(*n));
        }
    }

    fn percent(&self, n: usize) -> f64 {
        100.0 * n as f64 / self.n_points.max(1) as f64
    }
}

/// Length of a polyline, m.
pub fn length_m(path: &[[f64; 3]]) -> f64 {
    let step = |pair: &[[f64; 3]]| (0..3).map(|k| (pair[1][k] - pair[0][k]).powi(2)).sum::<f64>().sqrt();
    path.windows(2).map(step).sum()
}

/// 1st and 99th percentile.
pub fn percentiles(values: &[f64]) -> [f64; 2] {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((sorted.len() as f64 * share) as usize).copied();
    [at(0.01).unwrap_or(0.0), at(0.99).or(sorted.last().copied()).unwrap_or(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_ignore_outliers_and_nan() {
        let mut values: Vec<f64> = (0..1000).map(f64::from).collect();
        values.extend([1e9, f64::NAN]);
        assert_eq!(percentiles(&values), [10.0, 990.0]);
        assert_eq!(percentiles(&[]), [0.0, 1.0]);
    }

    #[test]
    fn path_length_is_sum_of_steps() {
        assert_eq!(length_m(&[[0.0; 3], [3.0, 4.0, 0.0], [3.0, 4.0, 2.0]]), 7.0);
    }
}
