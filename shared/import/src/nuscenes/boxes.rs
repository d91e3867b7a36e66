//! Annotated boxes of key frames.

use super::category::class_of_category;
use super::table;
use crate::error::ImportError;
use geometry::{Point3, Pose};
use messages::ClassId;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A box in the world frame.
pub(super) struct TrueBox {
    pub world_from_box: Pose,
    /// Half of length, width and height, m: along x, y and z of the box.
    pub half: [f64; 3],
    pub class: ClassId,
    /// Number of the object in the drive, from 1.
    pub instance: u16,
}

/// A box in the frame of a sweep.
pub(super) struct SweepBox {
    pub box_from_lidar: Pose,
    pub half: [f64; 3],
    pub class: ClassId,
    pub instance: u16,
}

impl TrueBox {
    pub fn in_sweep(&self, world_from_lidar: &Pose) -> SweepBox {
        let Self { half, class, instance, .. } = *self;
        SweepBox { box_from_lidar: self.world_from_box.inverse() * world_from_lidar, half, class, instance }
    }
}

impl SweepBox {
    pub fn contains(&self, point: &Point3<f64>) -> bool {
        let p = self.box_from_lidar * point;
        [p.x, p.y, p.z].iter().zip(self.half).all(|(value, half)| value.abs() <= half)
    }
}

#[derive(Deserialize)]
struct Category {
    token: String,
    name: String,
}

#[derive(Deserialize)]
struct Instance {
    token: String,
    category_token: String,
}

#[derive(Deserialize)]
struct Annotation {
    sample_token: String,
    instance_token: String,
    translation: [f64; 3],
    /// Width, length, height, m.
    size: [f64; 3],
    rotation: [f64; 4],
}

/// Boxes of the samples by their tokens, in the order of the table.
pub(super) fn read(tables: &Path, samples: &BTreeSet<&str>) -> Result<BTreeMap<String, Vec<TrueBox>>, ImportError> {
    let path = tables.join("sample_annotation.json");
    let mut annotations: Vec<Annotation> = Vec::new();
    table::each_row(&path, |row: Annotation| {
        if samples.contains(row.sample_token.as_str()) {
            annotations.push(row);
        }
        Ok(())
    })?;
    let objects: BTreeSet<&str> = annotations.iter().map(|row| row.instance_token.as_str()).collect();
    let numbers = numbers(&objects);
    let categories: Vec<Category> = table::rows(&tables.join("category.json"))?;
    let names: BTreeMap<String, String> = categories.into_iter().map(|row| (row.token, row.name)).collect();
    let mut classes = BTreeMap::new();
    table::each_row(&tables.join("instance.json"), |row: Instance| {
        if objects.contains(row.token.as_str()) {
            let name = names.get(&row.category_token);
            let name = name.ok_or_else(|| format!("category {} is not in category.json", row.category_token))?;
            classes.insert(row.token, class_of_category(name)?);
        }
        Ok(())
    })?;
    let mut boxes: BTreeMap<String, Vec<TrueBox>> = BTreeMap::new();
    for row in &annotations {
        let fault = |rule: String| ImportError::at(&path, format!("box of {}: {rule}", row.instance_token));
        let object = row.instance_token.as_str();
        let class = classes.get(object).ok_or_else(|| fault("its instance is not in instance.json".into()))?;
        let instance = numbers.get(object).ok_or_else(|| fault("the scenes have more than 65535 objects".into()))?;
        let [width, length, height] = row.size;
        boxes.entry(row.sample_token.clone()).or_default().push(TrueBox {
            world_from_box: table::pose(row.translation, row.rotation).map_err(fault)?,
            half: [0.5 * length, 0.5 * width, 0.5 * height],
            class: *class,
            instance: *instance,
        });
    }
    Ok(boxes)
}

/// Numbers of objects from 1. Objects beyond the largest number get no number.
fn numbers<'a>(objects: &BTreeSet<&'a str>) -> BTreeMap<&'a str, u16> {
    objects.iter().copied().zip(1..=u16::MAX).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_beyond_the_last_number_have_none() {
        let names: Vec<String> = (0..70_000).map(|name| format!("{name:05}")).collect();
        let found = numbers(&names.iter().map(String::as_str).collect());
        assert_eq!((found.len(), found["00000"], found["65534"]), (65_535, 1, 65_535));
        assert!(!found.contains_key("65535"));
    }
}
