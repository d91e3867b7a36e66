//! The end of the run: doubtful results.

use super::Colorize;
use coloring::ExposureKind;
use stage::Outputs;

impl Colorize {
    pub(super) fn report_doubts(&self, outputs: &mut Outputs) {
        let images = self.held.images.tallies();
        let cubes = self.held.cubes.tallies();
        let kinds = [
            (self.has_images, ExposureKind::Images, &self.names, images, "points_with_color"),
            (self.has_cubes, ExposureKind::Cubes, &self.mosaic_names, cubes, "points_with_spectrum"),
        ];
        for (_, kind, names, tallies, counter) in kinds.into_iter().filter(|(is_used, ..)| *is_used) {
            let counted = [outputs.counted("points"), outputs.counted(counter)];
            for doubt in self.limits_of_doubt.doubts(kind, names, tallies, counted) {
                outputs.report_doubt(&doubt);
            }
        }
    }
}
