//! The models that are evaluated.

use super::{Args, Refine, knn};
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
        // A model with examples would have to draw them again.
        if args.semantickitti.is_some() && args.knn.is_none() && reads_intensities {
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
    };
    let options = Options { every: args.every, intensity, refinement, ..Options::default() };
    let model: Box<dyn Segmenter> = match (args.knn, &args.examples) {
        (Some(k), Some(recipe)) => Box::new(knn::load(path, recipe, usize::from(k))?.with_options(options)?),
        _ => segmentation::load(path, &options)?,
    };
    Ok(UnknownBelow::wrap(model, args.unknown_below))
}
