//! Profiles of a whole run, and the offset estimated from them.

use crate::depth_edges::depth_edges;
use crate::fit::{fit, fit_at_range};
use crate::offset::{CameraOffset, Offset};
use crate::profile::{AlignmentExposure, MAX_AGE_S, Profile};
use coloring::{SubmapPoints, seconds};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Largest number of profiles per camera, at 140 bytes: enough for a tenth of a pixel, and less than the saved state of a
/// submap.
const MAX_PROFILES: usize = 1200;

/// Reported ranges, m: a delay is visible at the nearest and invisible at the farthest.
pub const RANGES_M: [Range<f32>; 3] = [0.0..8.0, 8.0..20.0, 20.0..120.0];

/// Profiles at the depth edges in an exposure.
#[derive(Clone, Debug)]
pub struct ExposureProfiles {
    /// Index of the camera.
    pub camera: usize,
    /// The profiles.
    pub profiles: Vec<Profile>,
}

/// The offset of a camera in a range of distances.
#[derive(Clone, Debug)]
pub struct RangeOffset {
    /// Distances, m.
    pub range_m: Range<f32>,
    /// The offset.
    pub offset: CameraOffset,
}

/// The profiles of a submap's depth edges in some exposures.
pub fn profiles_of_exposures(points: &SubmapPoints<'_>, exposures: &[AlignmentExposure<'_>]) -> Vec<ExposureProfiles> {
    let span = |exposure: &AlignmentExposure<'_>| {
        let time = seconds(exposure.exposure.stamp, points.origin);
        [time - MAX_AGE_S, time + MAX_AGE_S]
    };
    let edges = depth_edges(points, &exposures.iter().map(span).collect::<Vec<_>>());
    let profiles = |exposure: &AlignmentExposure<'_>| ExposureProfiles {
        camera: exposure.image.camera(),
        profiles: exposure.profiles(points, &edges),
    };
    exposures.par_iter().map(profiles).collect()
}

/// Collects profiles, submap by submap.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct OffsetMonitor {
    /// Profiles of each camera.
    profiles: Vec<Vec<Profile>>,
}

impl OffsetMonitor {
    /// Whether a camera has the largest number of profiles.
    pub fn is_complete(&self, camera: usize) -> bool {
        self.profiles.get(camera).is_some_and(|profiles| profiles.len() >= MAX_PROFILES)
    }

    /// The exposures of cameras that have fewer profiles.
    pub fn needed<'a>(&self, exposures: impl Iterator<Item = AlignmentExposure<'a>>) -> Vec<AlignmentExposure<'a>> {
        exposures.filter(|exposure| !self.is_complete(exposure.image.camera())).collect()
    }

    /// Adds the profiles of a submap.
    pub fn add(&mut self, profiles: Vec<ExposureProfiles>) {
        for ExposureProfiles { camera, profiles: added } in profiles {
            if self.profiles.len() <= camera {
                self.profiles.resize(camera + 1, Vec::new());
            }
            self.profiles[camera].extend(added);
            self.profiles[camera].truncate(MAX_PROFILES);
        }
    }

    /// Whether there are no profiles at all.
    pub fn is_empty(&self) -> bool {
        self.profiles.iter().all(Vec::is_empty)
    }

    /// The offset estimated from all profiles.
    pub fn offset(&self) -> Offset {
        fit(&self.profiles)
    }

    /// The offset of a camera in each of [`RANGES_M`], with the delay of all profiles.
    pub fn by_range(&self, camera: usize, offset: &Offset) -> Vec<RangeOffset> {
        let delay_s = offset.delay_s.map_or(0.0, |[delay_s, _]| delay_s);
        let at = |range: Range<f32>| {
            let found = fit_at_range(&self.profiles[camera], range.clone(), &offset.cameras[camera], delay_s);
            RangeOffset { range_m: range, offset: found }
        };
        RANGES_M.into_iter().map(at).collect()
    }
}
