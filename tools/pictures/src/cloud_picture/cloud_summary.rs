//! Statistics of a set of clouds.

use super::cloud_facts::{CloudFacts, Count};
use super::color_by::{self, ColorBy, ShownField};
use super::loaded_cloud::LoadedCloud;
use messages::{class_name, material_name};
use std::collections::{BTreeMap, BTreeSet};
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
    /// Smallest and largest standard deviation of the submaps.
    sigmas_m: Option<[f64; 2]>,
    bands: Vec<f64>,
    /// Values of the requested field; `None` without it.
    field: Option<Vec<f64>>,
    n_points: usize,
    n_colored: usize,
    has_color: bool,
    classes: BTreeMap<&'static str, usize>,
    materials: BTreeMap<&'static str, usize>,
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
        for material in cloud.materials().unwrap_or_default() {
            *self.materials.entry(material_name(*material)).or_default() += 1;
        }
        if let Some(ids) = cloud.instances() {
            self.instances.get_or_insert_default().extend(ids.iter().filter(|id| **id != 0));
        }
        if cloud.field().is_some() {
            self.field.get_or_insert_default();
        }
        cloud.times_s().unwrap_or_default().iter().for_each(|time_s| extend(&mut self.times_s, *time_s));
        cloud.sigma_m().into_iter().for_each(|sigma_m| extend(&mut self.sigmas_m, sigma_m));
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
        if let (Some(values), Some(field)) = (&mut self.field, cloud.field()) {
            values.push(field[i]);
        }
        // Few points have a spectrum, so that few samples do.
        self.bands.extend(cloud.band().map(|band| f64::from(band[i])).filter(|value| value.is_finite()));
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
    /// Positions of the lidar, m, in the order of the points. Empty if the clouds lack them.
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
    /// First and last time of a return, s.
    pub fn times_s(&self) -> [f64; 2] {
        self.times_s.unwrap_or_default()
    }
    /// Smallest and largest standard deviation of a submap, m.
    pub fn sigma_range_m(&self) -> [f64; 2] {
        self.sigmas_m.unwrap_or_default()
    }
    /// 1st and 99th percentile of the reflectances of the band.
    pub fn band_range(&self) -> [f64; 2] {
        percentiles(&self.bands)
    }
    /// Values at the ends of the ramp of a field: 1st and 99th percentile of the known values, unless the field has a range.
    pub fn field_range(&self, shown: &ShownField) -> [f64; 2] {
        let values = || self.field.iter().flatten().copied().filter(|value| Some(*value) != shown.none);
        shown.range.unwrap_or_else(|| percentiles(&values().collect::<Vec<_>>()))
    }
    /// Classes of the points, the most frequent first.
    pub fn classes(&self) -> Vec<&'static str> {
        by_frequency(&self.classes)
    }
    /// Materials of the points, the most frequent first.
    pub fn materials(&self) -> Vec<&'static str> {
        by_frequency(&self.materials)
    }
    /// Number of clouds.
    pub fn n_clouds(&self) -> usize {
        self.files.len()
    }
    /// The data of a coloring that the clouds lack.
    pub fn lacks(&self, by: &ColorBy) -> Option<String> {
        let (has, what) = match by {
            ColorBy::Color => (self.has_color, "colors: red, green, blue"),
            ColorBy::Class => (!self.classes.is_empty(), "classes: semantic"),
            ColorBy::Material => (!self.materials.is_empty(), "materials: material"),
            ColorBy::Instance => (self.instances.is_some(), "instances: instance"),
            ColorBy::Intensity => (!self.intensities.is_empty(), "intensities: intensity"),
            ColorBy::Field(field) => {
                let lack = format!("column `{}`; --by also takes {}", field.property, color_by::words().join(", "));
                return self.field.is_none().then_some(lack);
            }
            ColorBy::Time => (self.times_s.is_some(), "times: timestamp"),
            ColorBy::Band => (!self.bands.is_empty(), "spectra: files submap_N_spectra.ply in the same folder"),
            ColorBy::Sigma => {
                (self.sigmas_m.is_some(), "standard deviations: the drive had no GNSS, or was not placed")
            }
            ColorBy::Height | ColorBy::Submap => (true, ""),
        };
        (!has).then(|| what.to_owned())
    }
    /// The default coloring: the most informative one that the clouds have.
    pub fn default_coloring(&self) -> ColorBy {
        match () {
            () if self.n_colored > 0 => ColorBy::Color,
            () if !self.classes.is_empty() => ColorBy::Class,
            () => ColorBy::Height,
        }
    }

    /// The statistics, for the table and for JSON.
    pub fn facts(&self) -> CloudFacts {
        let counts = |(name, points): (&str, usize)| Count { name: name.to_owned(), points };
        let most_first = |points: &BTreeMap<&'static str, usize>| {
            let of = |name: &&'static str| counts((name, points[name]));
            by_frequency(points).iter().map(of).collect::<Vec<Count>>()
        };
        CloudFacts {
            points: self.n_points,
            bounds_m: self.bounds,
            seconds: self.times_s.map(|[first, last]| last - first),
            path_m: (!self.path.is_empty()).then(|| length_m(&self.path)),
            colored_points: self.has_color.then_some(self.n_colored),
            instances: self.instances.as_ref().map(BTreeSet::len),
            classes: most_first(&self.classes),
            materials: most_first(&self.materials),
            clouds: self.files.iter().map(|(name, n)| counts((name, *n))).collect(),
        }
    }
}

/// Names, sorted by number of points, the largest first.
fn by_frequency(points: &BTreeMap<&'static str, usize>) -> Vec<&'static str> {
    let mut names: Vec<&'static str> = points.keys().copied().collect();
    names.sort_by_key(|name| std::cmp::Reverse(points[name]));
    names
}

/// Extends the range by a value.
fn extend(range: &mut Option<[f64; 2]>, value: f64) {
    let [low, high] = range.get_or_insert([value; 2]);
    *low = low.min(value);
    *high = high.max(value);
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
