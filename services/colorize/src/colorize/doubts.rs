//! The end of the run: which results are doubtful.

use super::Colorize;
use crate::Settings;
use crate::window::Tally;
use stage::Outputs;
use std::collections::BTreeMap;

/// Limits beyond which results are doubtful.
pub(super) struct LimitsOfDoubt {
    min_colored_share: f64,
    max_unused_share: f64,
}

impl LimitsOfDoubt {
    pub(super) fn new(settings: &Settings) -> Self {
        Self { min_colored_share: settings.min_colored_share, max_unused_share: settings.max_unused_exposures_share }
    }
}

impl Colorize {
    pub(super) fn report_doubts(&self, outputs: &mut Outputs) {
        let (images, cubes) = (self.held.images.tallies(), self.held.cubes.tallies());
        if self.has_images {
            self.doubt_colors(images, outputs);
            if let Some((share, text)) = self.unused("images", &self.names, images) {
                outputs.doubt("images_unused", share, text);
            }
        }
        if self.has_cubes {
            doubt_spectra(cubes, outputs);
            if let Some((share, text)) = self.unused("cubes", &self.mosaic_names, cubes) {
                outputs.doubt("cubes_unused", share, text);
            }
        }
    }

    fn doubt_colors(&self, images: &BTreeMap<u32, Tally>, outputs: &mut Outputs) {
        let (n_points, n_colored) = (outputs.counted("points"), outputs.counted("points_with_color"));
        let (share, limit) = (n_colored as f64 / n_points.max(1) as f64, self.limits_of_doubt.min_colored_share);
        if n_points > 0 && share < limit {
            let text = format!(
                "{:.1} % of the points have a color (limit {:.1} %): {}",
                100.0 * share,
                100.0 * limit,
                arrived("images", images)
            );
            outputs.doubt("few_points_colored", share, text);
        }
    }

    /// The largest share of exposures of a camera that were not used, and a text, if it is beyond the limit.
    fn unused(&self, what: &str, names: &[String], tallies: &BTreeMap<u32, Tally>) -> Option<(f64, String)> {
        let limit = self.limits_of_doubt.max_unused_share;
        let beyond: Vec<(&u32, &Tally)> = tallies.iter().filter(|(_, tally)| tally.unused_share() > limit).collect();
        let largest = beyond.iter().map(|(_, tally)| tally.unused_share()).fold(0.0, f64::max);
        let line = |(camera, tally): &(&u32, &Tally)| {
            let name = names.get(**camera as usize).map_or_else(|| format!("camera {camera}"), Clone::clone);
            let Tally { received, unusable, without_pose } = tally;
            format!("{name} ({unusable} of {received} do not match the rig, {without_pose} have no pose)")
        };
        let list: Vec<String> = beyond.iter().map(line).collect();
        let text = format!(
            "more than {:.0} % of the {what} of a camera are not used; check its rig and its clock: {}",
            100.0 * limit,
            list.join(", ")
        );
        (!beyond.is_empty()).then_some((largest, text))
    }
}

/// Any point that a mosaic camera sees has a spectrum; how many those are depends on the rig.
fn doubt_spectra(cubes: &BTreeMap<u32, Tally>, outputs: &mut Outputs) {
    if outputs.counted("points") > 0 && outputs.counted("points_with_spectrum") == 0 {
        outputs.doubt("no_spectra", 0.0, format!("no point has a spectrum: {}", arrived("cubes", cubes)));
    }
}

fn arrived(what: &str, tallies: &BTreeMap<u32, Tally>) -> String {
    let sum = |of: fn(&Tally) -> u64| tallies.values().map(of).sum::<u64>();
    let (n, unusable, without_pose) = (sum(|t| t.received), sum(|t| t.unusable), sum(|t| t.without_pose));
    if n == 0 {
        return format!("no {what} arrived");
    }
    format!("{n} {what} arrived, {unusable} do not match the rig, {without_pose} have no pose")
}
