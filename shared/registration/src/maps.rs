//! The surfaces that features are matched with: smooth ones with smooth ones, rough ones with rough ones.

use crate::{Feature, LocalMap, MapPoint, MapSettings, SweepMotion};
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

/// Two maps: leaves beside a facade must not bend it.
#[derive(Debug, Default)]
pub(crate) struct Maps {
    pub smooth: LocalMap,
    rough: LocalMap,
}

/// The points of [`Maps`].
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct SavedMaps {
    smooth: Vec<MapPoint>,
    rough: Vec<MapPoint>,
}

impl Maps {
    /// The map for a feature.
    pub fn of(&self, feature: &Feature) -> &LocalMap {
        if feature.is_rough { &self.rough } else { &self.smooth }
    }
    /// Adds the features of a sweep, see [`LocalMap::insert`].
    pub fn insert(&mut self, batch: u32, features: &[Feature], motion: &SweepMotion, settings: &MapSettings) {
        self.smooth.insert(batch, &map_points(features, false, motion, batch), settings);
        self.rough.insert(batch, &map_points(features, true, motion, batch), settings);
    }
    /// Maps of one sweep.
    pub fn of_sweep(features: &[Feature], motion: &SweepMotion) -> Self {
        let [smooth, rough] =
            [false, true].map(|is_rough| LocalMap::from_points(map_points(features, is_rough, motion, 0)));
        Self { smooth, rough }
    }
    pub fn save(&self) -> SavedMaps {
        SavedMaps { smooth: self.smooth.points().to_vec(), rough: self.rough.points().to_vec() }
    }
    pub fn load(saved: SavedMaps) -> Self {
        Self { smooth: LocalMap::from_points(saved.smooth), rough: LocalMap::from_points(saved.rough) }
    }
}

/// Features of a kind in the odom frame.
fn map_points(features: &[Feature], is_rough: bool, motion: &SweepMotion, batch: u32) -> Vec<MapPoint> {
    let in_odom = |feature: &Feature| {
        let pose = motion.at(f64::from(feature.share));
        let position = pose * Point3::from(feature.position).cast::<f64>();
        let normal = pose.rotation * Vector3::from(feature.normal).cast::<f64>();
        MapPoint { position: position.coords.into(), normal: normal.cast::<f32>().into(), batch }
    };
    features.iter().filter(|feature| feature.is_rough == is_rough).map(in_odom).collect()
}
