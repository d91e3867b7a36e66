//! Doubts about the colors and spectra of a run.

use crate::ExposureTally;
use doubts::{Doubt, ExposureUse};
use std::collections::BTreeMap;

/// Limits beyond which results are doubtful, as shares of 1.
#[derive(Clone, Copy, Debug)]
pub struct DoubtLimits {
    /// Least share of points with a color.
    pub min_colored_share: f64,
    /// Largest share of unused exposures per camera.
    pub max_unused_share: f64,
}

/// Kind of exposures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExposureKind {
    /// Exposures of color cameras.
    Images,
    /// Exposures of mosaic cameras.
    Cubes,
}

impl DoubtLimits {
    /// The doubts about one kind of exposures. `names` are the names of its cameras. `n_points` counts the points of all
    /// submaps, `n_seen` those with a color or a spectrum.
    pub fn doubts(
        &self,
        kind: ExposureKind,
        names: &[String],
        tallies: &BTreeMap<u32, ExposureTally>,
        [n_points, n_seen]: [u64; 2],
    ) -> Vec<Doubt> {
        let share = n_seen as f64 / n_points.max(1) as f64;
        let limit = self.min_colored_share;
        let exposures = sum(tallies);
        let (few, is_few) = match kind {
            ExposureKind::Images => (Doubt::FewPointsColored { share, limit, exposures }, share < limit),
            // Any point that a mosaic camera sees has a spectrum. The rig determines how many those are.
            ExposureKind::Cubes => (Doubt::NoSpectra { exposures }, n_seen == 0),
        };
        (n_points > 0 && is_few).then_some(few).into_iter().chain(self.unused(kind, names, tallies)).collect()
    }

    fn unused(&self, kind: ExposureKind, names: &[String], tallies: &BTreeMap<u32, ExposureTally>) -> Option<Doubt> {
        let limit = self.max_unused_share;
        let beyond: Vec<(&u32, &ExposureTally)> =
            tallies.iter().filter(|(_, tally)| tally.unused_share() > limit).collect();
        let share = beyond.iter().map(|(_, tally)| tally.unused_share()).fold(0.0, f64::max);
        let line = |(camera, tally): &(&u32, &ExposureTally)| {
            let name = names.get(**camera as usize).map_or_else(|| format!("camera {camera}"), Clone::clone);
            let ExposureTally { received, unusable, without_pose } = tally;
            format!("{name} ({unusable} of {received} do not match the rig, {without_pose} have no pose)")
        };
        let cameras: Vec<String> = beyond.iter().map(line).collect();
        (!cameras.is_empty()).then_some(match kind {
            ExposureKind::Images => Doubt::ImagesUnused { share, limit, cameras },
            ExposureKind::Cubes => Doubt::CubesUnused { share, limit, cameras },
        })
    }
}

fn sum(tallies: &BTreeMap<u32, ExposureTally>) -> ExposureUse {
    let sum = |of: fn(&ExposureTally) -> u64| tallies.values().map(of).sum();
    ExposureUse {
        received: sum(|tally| tally.received),
        unusable: sum(|tally| tally.unusable),
        without_pose: sum(|tally| tally.without_pose),
    }
}
