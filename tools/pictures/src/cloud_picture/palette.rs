//! Colors of the points of a picture.

use super::cloud_summary::CloudSummary;
use super::color_by::{ColorBy, ShownField};
use super::loaded_cloud::LoadedCloud;
use crate::class_color::class_color;
use crate::material_color::material_color;
use messages::columns::Shown;
use messages::{ClassId, MaterialId};

/// Color of points that lack the attribute.
const GRAY: [u8; 3] = [90, 94, 102];

/// Viridis at five positions, dark violet to yellow: equal steps look equal, also in gray.
const RAMP: [[f64; 3]; 5] =
    [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];

/// Color of moving points.
const MOVING: [u8; 3] = [235, 70, 50];

/// Maps an attribute of the points to colors.
pub struct Palette {
    by: ColorBy,
    /// Range of the attribute, if it is a number.
    range: [f64; 2],
    intensity_range: [f64; 2],
}

/// Legend of the colors of a picture.
#[derive(Debug, PartialEq)]
pub enum Legend {
    /// A name for each color.
    Names(Vec<([u8; 3], String)>),
    /// A color ramp: its title, and the values at both ends.
    Ramp { title: String, ends: [String; 2] },
}

/// Largest number of classes or materials in a legend.
const MAX_NAMES: usize = 12;

impl Palette {
    /// A palette whose ranges cover all clouds, so that equal values get equal colors in each cloud.
    pub fn new(by: ColorBy, summary: &CloudSummary) -> Self {
        let range = match &by {
            ColorBy::Height => summary.height_range(),
            ColorBy::Intensity => summary.intensity_range(),
            ColorBy::Time => summary.times_s(),
            ColorBy::Band => summary.band_range(),
            ColorBy::Sigma => summary.sigma_range_m(),
            ColorBy::Field(field) => summary.field_range(field),
            _ => [0.0, 1.0],
        };
        Self { by, range, intensity_range: summary.intensity_range() }
    }

    /// sRGB of a point; `number` is the number of its cloud among all clouds.
    pub fn color(&self, cloud: &LoadedCloud, number: usize, i: usize) -> [u8; 3] {
        let scalar = |value: Option<f64>| match value.filter(|value| value.is_finite()) {
            Some(value) => ramp(share(value, self.range)),
            None => GRAY,
        };
        match &self.by {
            ColorBy::Color => cloud.color(i).unwrap_or_else(|| self.uncolored(cloud, i)),
            ColorBy::Class => cloud.classes().map_or(GRAY, |classes| class_color(classes[i])),
            ColorBy::Material => match cloud.materials().map_or(0, |materials| materials[i]) {
                0 => self.uncolored(cloud, i),
                material => material_color(material),
            },
            ColorBy::Instance => cloud.instances().map_or(GRAY, |ids| instance_color(ids[i])),
            ColorBy::Submap => instance_color(number as i64 + 1),
            ColorBy::Field(field) => match cloud.field().map(|values| values[i]).filter(|v| Some(*v) != field.none) {
                Some(value) => self.field_color(field, value, cloud, i),
                None if field.shown == Shown::Ids => GRAY,
                None => self.uncolored(cloud, i),
            },
            ColorBy::Height => scalar(Some(cloud.position(i)[2])),
            ColorBy::Intensity => match cloud.intensities() {
                Some(intensities) => ramp(share(f64::from(intensities[i]), self.range).sqrt()),
                None => GRAY,
            },
            ColorBy::Time => scalar(cloud.times_s().map(|times| times[i])),
            ColorBy::Band => match cloud.band().map(|band| f64::from(band[i])).filter(|value| value.is_finite()) {
                Some(value) => scalar(Some(value)),
                None => self.uncolored(cloud, i),
            },
            ColorBy::Sigma => scalar(cloud.sigma_m()),
        }
    }

    /// Color of point `i` by its value of a field.
    fn field_color(&self, field: &ShownField, value: f64, cloud: &LoadedCloud, i: usize) -> [u8; 3] {
        match field.shown {
            Shown::Ids | Shown::Names => instance_color(value as i64),
            Shown::Flag if value != 0.0 => MOVING,
            Shown::Flag => self.uncolored(cloud, i),
            _ if !value.is_finite() => GRAY,
            Shown::RootRamp => ramp(share(value, self.range).sqrt()),
            Shown::No | Shown::Color | Shown::Ramp => ramp(share(value, self.range)),
        }
    }

    /// A dim gray by intensity, for points without the attribute: it still shows shapes.
    fn uncolored(&self, cloud: &LoadedCloud, i: usize) -> [u8; 3] {
        let Some(intensities) = cloud.intensities() else { return GRAY };
        let level = share(f64::from(intensities[i]), self.intensity_range).sqrt();
        [52.0, 56.0, 64.0].map(|dark| (dark + 80.0 * level) as u8)
    }

    /// Legend of the colors.
    pub fn legend(&self, summary: &CloudSummary, band_nm: f64) -> Legend {
        let [low, high] = self.range;
        let ramp = |title: &str, ends: [String; 2]| Legend::Ramp { title: title.to_owned(), ends };
        let metres = |decimals: usize| [low, high].map(|value| format!("{value:.decimals$}"));
        match &self.by {
            ColorBy::Color => Legend::Names(vec![(GRAY, "gray: seen by no camera".to_owned())]),
            ColorBy::Class => {
                let id = |name: &str| ClassId::ALL.iter().position(|class| class.name() == name);
                let classes = summary.classes().into_iter().take(MAX_NAMES);
                Legend::Names(
                    classes.filter_map(|name| Some((class_color(id(name)? as u8), name.to_owned()))).collect(),
                )
            }
            ColorBy::Material => {
                let color = |name: &str| MaterialId::from_name(name).map(|material| material_color(material as u8));
                let names = summary.materials().into_iter().filter(|name| *name != MaterialId::Unknown.name());
                Legend::Names(names.take(MAX_NAMES).filter_map(|name| Some((color(name)?, name.to_owned()))).collect())
            }
            ColorBy::Instance => Legend::Names(vec![
                (instance_color(1), "a color for each object".to_owned()),
                (GRAY, "no object".to_owned()),
            ]),
            ColorBy::Submap => {
                Legend::Names(vec![(instance_color(1), format!("a color for each of {} clouds", summary.n_clouds()))])
            }
            ColorBy::Field(field) => self.field_legend(field),
            ColorBy::Height => ramp("height, m", metres(1)),
            ColorBy::Intensity => ramp("intensity (square root)", metres(0)),
            ColorBy::Time => ramp("time, s", ["0".to_owned(), format!("{:.1}", high - low)]),
            ColorBy::Band => ramp(&format!("reflectance near {band_nm:.0} nm; gray: none"), metres(2)),
            ColorBy::Sigma => ramp("deviation of the position, m", metres(2)),
        }
    }
}

impl Palette {
    /// Legend of a field.
    fn field_legend(&self, field: &ShownField) -> Legend {
        let name = &field.name;
        match field.shown {
            Shown::Flag => Legend::Names(vec![(MOVING, name.clone()), (GRAY, format!("not {name}"))]),
            Shown::Names => {
                let names = field.names.map(|ids| (ids.names)()).unwrap_or_default();
                let named = (0..).zip(names).take(MAX_NAMES).map(|(id, name)| (instance_color(id), name.to_owned()));
                Legend::Names(named.collect())
            }
            Shown::Ids => {
                let first = (instance_color(1), format!("a color for each {name}"));
                Legend::Names(vec![first, (GRAY, format!("no {name}"))])
            }
            Shown::No | Shown::Color | Shown::Ramp | Shown::RootRamp => {
                let decimals = if self.range[1] - self.range[0] < 1.0 { 3 } else { 1 };
                let title = if field.shown == Shown::RootRamp { format!("{name} (square root)") } else { name.clone() };
                Legend::Ramp { title, ends: self.range.map(|value| format!("{value:.decimals$}")) }
            }
        }
    }
}

/// Hues by the golden angle: consecutive ids get different colors.
fn instance_color(id: i64) -> [u8; 3] {
    if id == 0 {
        return GRAY;
    }
    let hue = (id as f64 * 0.618_033_988_749_895).rem_euclid(1.0) * 6.0;
    let channel = |shift: f64| {
        let distance = ((hue + shift).rem_euclid(6.0) - 3.0).abs();
        (80.0 + 170.0 * (distance - 1.0).clamp(0.0, 1.0)) as u8
    };
    [channel(0.0), channel(4.0), channel(2.0)]
}

/// Position of a value in a range, 0 to 1.
pub fn share(value: f64, [low, high]: [f64; 2]) -> f64 {
    let share = (value - low) / (high - low).max(1e-9);
    if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }
}

/// Viridis at 0 to 1.
pub fn ramp(share: f64) -> [u8; 3] {
    let position = share * (RAMP.len() - 1) as f64;
    let index = (position as usize).min(RAMP.len() - 2);
    let rest = position - index as f64;
    std::array::from_fn(|k| (RAMP[index][k] * (1.0 - rest) + RAMP[index + 1][k] * rest) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consecutive_instances_get_different_colors() {
        assert_eq!(instance_color(0), GRAY);
        for id in 1..200 {
            let a = instance_color(id);
            let b = instance_color(id + 1);
            assert!((0..3).map(|k| a[k].abs_diff(b[k]) as u32).sum::<u32>() > 100, "{id}: {a:?} {b:?}");
        }
    }

    #[test]
    fn ramp_spans_viridis_and_nan_gets_its_start() {
        assert_eq!(ramp(0.0), [68, 1, 84]);
        assert_eq!(ramp(1.0), [253, 231, 37]);
        assert_eq!(ramp(share(f64::NAN, [0.0, 1.0])), [68, 1, 84]);
    }
}
