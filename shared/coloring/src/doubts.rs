//! Which results of a run are doubtful.

use crate::ExposureTally;
use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

/// Limits beyond which results are doubtful; shares of 1.
#[derive(Clone, Copy, Debug)]
pub struct DoubtLimits {
    /// Least share of points with a color.
    pub min_colored_share: f64,
    /// Largest share of exposures of a camera that are not used.
    pub max_unused_share: f64,
}

/// Kind of exposures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExposureKind {
    /// Of color cameras.
    Images,
    /// Of mosaic cameras.
    Cubes,
}

/// A reason not to rely on colors or spectra.
#[derive(Clone, Debug, PartialEq)]
pub enum ColorDoubt {
    /// Too few points have a color, or no point has a spectrum.
    FewPoints {
        /// Colors or spectra.
        kind: ExposureKind,
        /// Share of points that have one.
        share: f64,
        /// Least share of points.
        limit: f64,
        /// All exposures.
        exposures: ExposureTally,
    },
    /// Too large a share of the exposures of a camera are not used.
    Unused {
        /// Their kind.
        kind: ExposureKind,
        /// The largest share of a camera.
        share: f64,
        /// Largest allowed share.
        limit: f64,
        /// The cameras beyond the limit, with their exposures.
        cameras: Vec<String>,
    },
}

impl DoubtLimits {
    /// The doubts about one kind of exposures. `names` of its cameras; `n_points` of all submaps; `n_seen` of these have a color or a
    /// spectrum.
    pub fn doubts(
        &self,
        kind: ExposureKind,
        names: &[String],
        tallies: &BTreeMap<u32, ExposureTally>,
        [n_points, n_seen]: [u64; 2],
    ) -> Vec<ColorDoubt> {
        let share = n_seen as f64 / n_points.max(1) as f64;
        let (limit, is_few) = match kind {
            ExposureKind::Images => (self.min_colored_share, share < self.min_colored_share),
            // Any point that a mosaic camera sees has a spectrum; how many those are depends on the rig.
            ExposureKind::Cubes => (0.0, n_seen == 0),
        };
        let few =
            (n_points > 0 && is_few).then(|| ColorDoubt::FewPoints { kind, share, limit, exposures: sum(tallies) });
        few.into_iter().chain(self.unused(kind, names, tallies)).collect()
    }

    fn unused(
        &self,
        kind: ExposureKind,
        names: &[String],
        tallies: &BTreeMap<u32, ExposureTally>,
    ) -> Option<ColorDoubt> {
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
        (!cameras.is_empty()).then_some(ColorDoubt::Unused { kind, share, limit, cameras })
    }
}

impl ColorDoubt {
    /// Name of the doubt.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::FewPoints { kind: ExposureKind::Images, .. } => "few_points_colored",
            Self::FewPoints { kind: ExposureKind::Cubes, .. } => "no_spectra",
            Self::Unused { kind: ExposureKind::Images, .. } => "images_unused",
            Self::Unused { kind: ExposureKind::Cubes, .. } => "cubes_unused",
        }
    }

    /// The share that breaks its limit.
    pub const fn size(&self) -> f64 {
        match self {
            Self::FewPoints { share, .. } | Self::Unused { share, .. } => *share,
        }
    }
}

impl Display for ExposureKind {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Images => "images",
            Self::Cubes => "cubes",
        })
    }
}

impl Display for ColorDoubt {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::FewPoints { kind, share, limit, exposures } => {
                match kind {
                    ExposureKind::Images => {
                        let (colored, limit) = (100.0 * share, 100.0 * limit);
                        write!(f, "{colored:.1} % of the points have a color (limit {limit:.1} %): ")?;
                    }
                    ExposureKind::Cubes => f.write_str("no point has a spectrum: ")?,
                }
                let ExposureTally { received, unusable, without_pose } = exposures;
                if *received == 0 {
                    return write!(f, "no {kind} arrived");
                }
                write!(f, "{received} {kind} arrived, {unusable} do not match the rig, {without_pose} have no pose")
            }
            Self::Unused { kind, limit, cameras, .. } => {
                let (limit, cameras) = (100.0 * limit, cameras.join(", "));
                write!(
                    f,
                    "more than {limit:.0} % of the {kind} of a camera are not used; check its rig and its clock: {cameras}"
                )
            }
        }
    }
}

fn sum(tallies: &BTreeMap<u32, ExposureTally>) -> ExposureTally {
    let sum = |of: fn(&ExposureTally) -> u64| tallies.values().map(of).sum();
    ExposureTally {
        received: sum(|tally| tally.received),
        unusable: sum(|tally| tally.unusable),
        without_pose: sum(|tally| tally.without_pose),
    }
}
