//! The models that are evaluated.

use super::{Args, Refine};
use segmentation::intensity::IntensityUse;
use segmentation::{Options, Refinement, Segmenter, UnknownBelow, ground_quasi_flat};
use settings::Word;
use std::path::Path;

/// A model, and the same model with other uses of the intensities.
pub struct Models {
    /// The model with the use of intensities from `--intensity`.
    pub asked: Box<dyn Segmenter>,
    /// The model with raw intensities and without intensities, except the use of `--intensity`: a word of `--intensity` and the
    /// model.
    pub other_uses: Vec<(&'static str, Box<dyn Segmenter>)>,
}

impl Models {
    /// Reads the model files. Other uses of the intensities are for real sweeps only.
    pub fn load(path: &Path, args: &Args) -> anyhow::Result<Self> {
        let asked = load(path, args, args.intensity)?;
        let reads_intensities = asked.card().architecture != ground_quasi_flat::ARCHITECTURE;
        let mut other_uses = Vec::new();
        if (args.semantickitti.is_some() || args.street_labels.is_some()) && reads_intensities {
            let others = [IntensityUse::Raw, IntensityUse::Off].into_iter();
            for intensity in others.filter(|intensity| *intensity != args.intensity) {
                other_uses.push((intensity.word(), load(path, args, intensity)?));
            }
        }
        Ok(Self { asked, other_uses })
    }
}

fn load(path: &Path, args: &Args, intensity: IntensityUse) -> anyhow::Result<Box<dyn Segmenter>> {
    let refine = |correction: Refine| args.refine.contains(&correction);
    let refinement = Refinement {
        poles: refine(Refine::Poles),
        small_regions: refine(Refine::SmallRegions),
        buildings: refine(Refine::Buildings),
        rough_ground: refine(Refine::RoughGround),
        vehicle_shape: refine(Refine::VehicleShape),
        driven_is_road: refine(Refine::DrivenIsRoad),
    };
    let options =
        Options { every: args.every, views: usize::from(args.views), intensity, refinement, ..Options::default() };
    Ok(UnknownBelow::wrap(segmentation::load(path, &options)?, args.unknown_below))
}
