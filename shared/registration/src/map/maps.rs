//! The maps used for matching: one of smooth and one of rough surfaces.

use crate::self_calibration::spin_direction::TurnLever;
use crate::{Feature, LocalMap, MapPoint, MapSettings, SweepMotion};
use serde::{Deserialize, Serialize};

/// Separate maps of smooth and rough surfaces, so that leaves next to a facade do not distort it.
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
    /// The map that a feature is matched to.
    pub fn map_for(&self, feature: &Feature) -> &LocalMap {
        if feature.is_rough { &self.rough } else { &self.smooth }
    }
    /// The points of both maps.
    pub fn points(&self) -> impl Iterator<Item = MapPoint> {
        self.smooth.points().into_iter().chain(self.rough.points())
    }
    /// Adds the features of a sweep, see [`LocalMap::insert`].
    pub fn insert(
        &mut self,
        batch: u32,
        features: &[Feature],
        motion: &SweepMotion,
        turn: &TurnLever,
        settings: &MapSettings,
    ) {
        let points = |is_rough| map_points(features, is_rough, motion, turn, batch);
        self.smooth.insert(batch, &points(false), settings);
        self.rough.insert(batch, &points(true), settings);
    }
    /// Maps with the features of one sweep.
    pub fn from_sweep(features: &[Feature], motion: &SweepMotion) -> Self {
        let map = |is_rough| LocalMap::from_points(&map_points(features, is_rough, motion, &TurnLever::NONE, 0));
        let [smooth, rough] = [false, true].map(map);
        Self { smooth, rough }
    }
    pub fn save(&self) -> SavedMaps {
        SavedMaps { smooth: self.smooth.points(), rough: self.rough.points() }
    }
    pub fn load(saved: &SavedMaps) -> Self {
        Self { smooth: LocalMap::from_points(&saved.smooth), rough: LocalMap::from_points(&saved.rough) }
    }
}

/// Smooth or rough features, transformed to the odom frame.
fn map_points(
    features: &[Feature],
    is_rough: bool,
    motion: &SweepMotion,
    turn: &TurnLever,
    batch: u32,
) -> Vec<MapPoint> {
    let mid = *motion.mid.rotation.to_rotation_matrix().matrix();
    let in_odom = |feature: &Feature| {
        let share = f64::from(feature.share);
        let arm = motion.rotated(&mid, &feature.position, share);
        let position = arm + motion.mid.translation.vector + motion.translation * share;
        let normal = motion.rotated(&mid, &feature.normal, share).normalize();
        let turn_lever = turn.at(&feature.position, &arm, &normal) as f32;
        let normal = normal.cast::<f32>().into();
        MapPoint { position: position.into(), normal, lever: feature.lever, turn_lever, batch }
    };
    features.iter().filter(|feature| feature.is_rough == is_rough).map(in_odom).collect()
}
