//! The maps to which features are matched: one of smooth and one of rough surfaces.

use crate::{Feature, LocalMap, MapPoint, MapSettings, SweepMotion};
use serde::{Deserialize, Serialize};

/// Two maps, so that leaves beside a facade do not distort it.
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
    /// Maps with one sweep.
    pub fn of_sweep(features: &[Feature], motion: &SweepMotion) -> Self {
        let [smooth, rough] =
            [false, true].map(|is_rough| LocalMap::from_points(&map_points(features, is_rough, motion, 0)));
        Self { smooth, rough }
    }
    pub fn save(&self) -> SavedMaps {
        SavedMaps { smooth: self.smooth.points(), rough: self.rough.points() }
    }
    pub fn load(saved: &SavedMaps) -> Self {
        Self { smooth: LocalMap::from_points(&saved.smooth), rough: LocalMap::from_points(&saved.rough) }
    }
}

/// Smooth or rough features in the odom frame.
fn map_points(features: &[Feature], is_rough: bool, motion: &SweepMotion, batch: u32) -> Vec<MapPoint> {
    let mid = *motion.mid.rotation.to_rotation_matrix().matrix();
    let in_odom = |feature: &Feature| {
        let share = f64::from(feature.share);
        let arm = motion.rotated(&mid, &feature.position, share);
        let position = arm + motion.mid.translation.vector + motion.translation * share;
        let normal = motion.rotated(&mid, &feature.normal, share).normalize();
        MapPoint { position: position.into(), normal: normal.cast::<f32>().into(), lever: feature.lever, batch }
    };
    features.iter().filter(|feature| feature.is_rough == is_rough).map(in_odom).collect()
}
